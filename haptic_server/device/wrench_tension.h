// SPDX-License-Identifier: MIT
// A wanted force and torque -> the tensions of the eight strings of a grip: the G6 family.
#pragma once

#include <array>
#include <cstddef>

#include "common/geometry.h"
#include "haptic_server/device/strings.h"
#include "haptic_server/device/tension.h"

namespace rikiseki::haptic {

inline constexpr std::size_t kGripStrings = kMaxStrings;
using EightStrings = PerString;

/// How the strings hold the grip in one pose, device axes.
struct GripStrings {
  std::array<Vec3, kGripStrings> direction;  // unit, from the grip to the motor
  std::array<Vec3, kGripStrings> arm;        // m, from the grip's centre to where the string ends
};

/// On the user, device axes, about the grip's centre.
struct Wrench {
  Vec3 force = Vec3::Zero();   // N
  Vec3 torque = Vec3::Zero();  // N m
};

struct WrenchAllocation {
  EightStrings tension{};  // N, each within the bounds, always
  Wrench wrench;           // what these tensions display
  bool feasible = false;   // the wanted wrench is displayed to 1e-6 of 1 N and its size
};

/// The wrench of `tension` [N]. // RT:
Wrench StringWrench(const GripStrings& strings, const EightStrings& tension) noexcept;

/// Of all tensions within the bounds that display `wrench`, those nearest to `rest_n` [N] on every
/// string: a light internal tension that costs no force. If there are none, those that miss the
/// wrench least, a torque counting as a force at the strings' mean arm. A quadratic program that
/// has one solution, which follows the wrench without jumps; solved by an active set, without
/// memory of earlier ticks. A wrench that is not finite counts as zero. // RT:
WrenchAllocation AllocateWrench(const GripStrings& strings, const Wrench& wrench,
                                const TensionBounds& bounds, double rest_n) noexcept;

}  // namespace rikiseki::haptic
