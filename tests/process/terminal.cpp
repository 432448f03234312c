// SPDX-License-Identifier: MIT
#include "tests/process/terminal.h"

#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>

namespace rikiseki::test {

OnTerminal::OnTerminal(const std::vector<std::string>& command, int columns, int rows) {
  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  REQUIRE(master_ >= 0);
  REQUIRE(grantpt(master_) == 0);
  REQUIRE(unlockpt(master_) == 0);
  const std::string slave = ptsname(master_);
  Resize(columns, rows);
  std::vector<char*> arguments;
  for (const std::string& argument : command) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    setsid();
    const int terminal = open(slave.c_str(), O_RDWR);  // becomes the controlling one
    dup2(terminal, STDIN_FILENO);
    dup2(terminal, STDOUT_FILENO);
    dup2(terminal, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
}

OnTerminal::~OnTerminal() {
  if (pid_ > 0) {
    Signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  close(master_);
}

void OnTerminal::Press(char key) const {
  REQUIRE(write(master_, &key, 1) == 1);
}

void OnTerminal::Resize(int columns, int rows) const {
  const winsize size{.ws_row = static_cast<unsigned short>(rows),
                     .ws_col = static_cast<unsigned short>(columns),
                     .ws_xpixel = 0,
                     .ws_ypixel = 0};
  REQUIRE(ioctl(master_, TIOCSWINSZ, &size) == 0);
}

bool OnTerminal::Echoes() const {
  termios settings{};
  REQUIRE(tcgetattr(master_, &settings) == 0);
  return (settings.c_lflag & ECHO) != 0;
}

const std::string& OnTerminal::Output() {
  std::array<char, 4096> buffer{};
  for (ssize_t got; (got = read(master_, buffer.data(), buffer.size())) > 0;) {
    output_.append(buffer.data(), static_cast<std::size_t>(got));
  }
  return output_;
}

void OnTerminal::Signal(int signal) const {
  kill(pid_, signal);
}

int OnTerminal::Wait() {
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace rikiseki::test
