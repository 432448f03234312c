// SPDX-License-Identifier: MIT
// How a program of this project ends; systemd and scripts act on the number (sysexits.h).
#pragma once

#include <stdexcept>
#include <string>

namespace rikiseki {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFault = 1;
inline constexpr int kExitUsage = 64;      // wrong command line: do not restart
inline constexpr int kExitTemporary = 75;  // somebody else holds the role: try again
inline constexpr int kExitConfig = 78;     // wrong configuration: do not restart

/// A reason not to start, with the exit status that tells it. what() is one line for people.
class StartError : public std::runtime_error {
 public:
  StartError(int exit_code, const std::string& what)
      : std::runtime_error(what), exit_code_(exit_code) {}
  int exit_code() const { return exit_code_; }

 private:
  int exit_code_;
};

}  // namespace rikiseki
