// SPDX-License-Identifier: MIT
#include "haptic_server/keyboard.h"

#include <poll.h>
#include <unistd.h>

#include <chrono>

namespace rikiseki::haptic {
namespace {

constexpr int kPollMs = 50;

// In the background, reading or setting the terminal would stop the process.
bool InForeground() {
  return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

}  // namespace

Keyboard::Keyboard(OperatorPanel& panel) : panel_(panel) {
  if (isatty(STDIN_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before_) != 0) return;
  thread_ = std::thread([this] { Run(); });
}

Keyboard::~Keyboard() {
  if (!thread_.joinable()) return;
  end_ = true;
  thread_.join();
  if (InForeground()) tcsetattr(STDIN_FILENO, TCSADRAIN, &before_);
}

void Keyboard::Run() {
  termios one_key = before_;
  one_key.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  one_key.c_cc[VMIN] = 1;
  one_key.c_cc[VTIME] = 0;
  bool set = false;
  while (!end_) {
    if (!InForeground()) {
      set = false;  // the shell has put its own settings there
      std::this_thread::sleep_for(std::chrono::milliseconds(kPollMs));
      continue;
    }
    if (!set) set = tcsetattr(STDIN_FILENO, TCSADRAIN, &one_key) == 0;
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (poll(&input, 1, kPollMs) <= 0) continue;
    char key = 0;
    if (read(STDIN_FILENO, &key, 1) <= 0) return;  // the terminal is gone
    switch (key) {
      case ' ':
      case '\n':
      case '\r':
        panel_.Stop();
        break;
      case 'e':
      case 'E':
        panel_.Enable();
        break;
      case 'c':
      case 'C':
        panel_.ToggleClutch();
        break;
      default:
        break;
    }
  }
}

}  // namespace rikiseki::haptic
