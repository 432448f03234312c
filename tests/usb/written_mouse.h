// SPDX-License-Identifier: MIT
// An ordinary mouse that a test moves: the kernel's events through a pipe with a name.
#pragma once

#include <fcntl.h>
#include <linux/input.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace rikiseki::test {

class WrittenMouse {
 public:
  WrittenMouse() {
    static std::atomic<int> next{0};
    path_ = std::filesystem::temp_directory_path() /
            ("rikiseki-mouse-" + std::to_string(getpid()) + "-" + std::to_string(next++));
    Plug();
  }
  ~WrittenMouse() { Unplug(); }
  WrittenMouse(const WrittenMouse&) = delete;
  WrittenMouse& operator=(const WrittenMouse&) = delete;

  const std::string& path() const { return path_; }

  void Plug() {
    if (mkfifo(path_.c_str(), 0600) != 0) throw std::runtime_error("mkfifo " + path_);
    pipe_ = open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  }

  /// Who reads it sees its end.
  void Unplug() {
    if (pipe_ >= 0) close(pipe_);
    pipe_ = -1;
    unlink(path_.c_str());
  }

  /// By so many counts to the right, and towards the hand, as the kernel counts; false if nobody reads
  /// and the pipe is full.
  bool Move(int right, int towards) const {
    const std::array events = {
        input_event{.time = {}, .type = EV_REL, .code = REL_X, .value = right},
        input_event{.time = {}, .type = EV_REL, .code = REL_Y, .value = towards},
        input_event{.time = {}, .type = EV_SYN, .code = SYN_REPORT, .value = 0}};
    return write(pipe_, events.data(), sizeof events) == sizeof events;
  }

  /// An event that is no motion.
  bool Click() const {
    const input_event press{.time = {}, .type = EV_KEY, .code = BTN_LEFT, .value = 1};
    return write(pipe_, &press, sizeof press) == sizeof press;
  }

 private:
  std::string path_;
  int pipe_ = -1;
};

}  // namespace rikiseki::test
