// SPDX-License-Identifier: MIT
// A motor board whose grip the test holds: it reads what the test says, and keeps what it was commanded.
#pragma once

#include <string>

#include "haptic_server/device/motor_board.h"

namespace rikiseki::haptic {

class ScriptedBoard final : public MotorBoard {
 public:
  bool ReadCounts(std::int64_t, EncoderCounts& out) noexcept override {
    out = counts;
    return answers;
  }
  bool WriteTensions(const PerString& out) noexcept override {
    tension = out;
    return answers;
  }
  bool Enabled() const noexcept override { return enabled; }
  const Hand* hand() const noexcept override { return nullptr; }
  std::string Name() const override { return "scripted"; }

  EncoderCounts counts{};
  PerString tension{};
  bool answers = true;
  bool enabled = true;
};

}  // namespace rikiseki::haptic
