// SPDX-License-Identifier: MIT
// The column `coupling`: for Choose.
#pragma once

#include "protocol/messages.h"
#include "tests/lab/choose.h"

namespace rikiseki::lab {

inline constexpr Named<protocol::Coupling> kCouplings[] = {
    {"position", protocol::Coupling::kPosition},
    {"impulse", protocol::Coupling::kImpulse},
    {"local", protocol::Coupling::kLocal}};

}  // namespace rikiseki::lab
