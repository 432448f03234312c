// SPDX-License-Identifier: MIT
// A program on a terminal of its own, as a person at the keyboard has it.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace rikiseki::test {

class OnTerminal {
 public:
  /// Starts command[0] with its arguments. Fails the test if no terminal can be had.
  explicit OnTerminal(const std::vector<std::string>& command, int columns = 80, int rows = 24);
  /// Kills it if it still runs.
  ~OnTerminal();
  OnTerminal(const OnTerminal&) = delete;
  OnTerminal& operator=(const OnTerminal&) = delete;

  void Press(char key) const;
  void Resize(int columns, int rows) const;

  /// Whether the terminal shows what is typed, as it does by itself.
  bool Echoes() const;

  /// All that was written to the terminal so far.
  const std::string& Output();

  void Signal(int signal) const;
  /// Waits until it ends. Its exit status, or minus the signal that ended it.
  int Wait();

 private:
  int master_ = -1;
  pid_t pid_ = 0;
  std::string output_;
};

}  // namespace rikiseki::test
