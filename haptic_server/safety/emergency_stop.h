// SPDX-License-Identifier: MIT
// The latch of the emergency stop: whoever asks for it gets it at once, and it stays until somebody
// enables again while nobody asks for it and the device's enable input is closed.
#pragma once

namespace rikiseki::haptic {

class EmergencyStop {
 public:
  /// One call per tick. `stop` and `enable`: asked for since the last tick; of both, stop wins.
  /// `input_closed`: the device's enable input. Returns whether to be stopped. // RT:
  bool Update(bool stop, bool enable, bool input_closed) noexcept {
    if (stop || !input_closed) {
      engaged_ = true;
    } else if (enable) {
      engaged_ = false;
    }
    return engaged_;
  }

 private:
  bool engaged_ = false;
};

}  // namespace rikiseki::haptic
