// SPDX-License-Identifier: MIT
// Keys for whoever sits at the device: space or enter = emergency stop, e = enable, c = clutch.
#pragma once

#include <termios.h>

#include <atomic>
#include <thread>

#include "haptic_server/operator_panel.h"

namespace rikiseki::haptic {

/// Reads stdin on a thread of its own, one key at a time and without echo, while it is a terminal
/// and this process is in its foreground; otherwise leaves it alone. Ctrl-C and Ctrl-Z keep their
/// meaning. The terminal gets its old settings back at the end.
class Keyboard {
 public:
  /// `panel` outlives the keyboard.
  explicit Keyboard(OperatorPanel& panel);
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  /// Whether stdin is a terminal.
  bool is_there() const { return thread_.joinable(); }

 private:
  void Run();

  OperatorPanel& panel_;
  termios before_{};
  std::atomic<bool> end_{false};
  std::thread thread_;
};

}  // namespace rikiseki::haptic
