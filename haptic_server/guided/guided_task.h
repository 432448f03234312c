// SPDX-License-Identifier: MIT
// A procedure that a person goes through at the device - calibration, identification, the search for the
// largest stiffness - as a step function: the shell (guided_run.h) drives it with real time, tests with
// virtual time.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "haptic_server/step.h"

namespace rikiseki::haptic {

/// What a procedure found: words for the person, values for the device file.
struct Finding {
  std::string text;
  std::vector<std::pair<std::string, std::string>> values;  // {"spidar.key", "value"}
};

/// Nothing was found; what() says why, and what to do.
class NothingFound : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class GuidedTask {
 public:
  virtual ~GuidedTask() = default;

  /// One tick. False once there is nothing left to do; the strings are at minimum tension then.
  /// // RT: no allocation, lock, log or throw.
  virtual bool Tick(const TickTime& time, const OperatorInput& wish) noexcept = 0;

  /// Lets go: minimum tension. // RT:
  virtual void Release() noexcept = 0;

  /// What the person should know or do now. From any thread.
  virtual std::string Prompt() const = 0;

  /// To be asked after the last tick. Throws NothingFound.
  virtual Finding Result() const = 0;
};

}  // namespace rikiseki::haptic
