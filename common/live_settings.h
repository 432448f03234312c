// SPDX-License-Identifier: MIT
// Settings that were read again while the process runs: which of them it takes, and a line in the log for
// each that changed.
#pragma once

#include <string>
#include <vector>

#include "common/config.h"

namespace rikiseki {

class LiveSettings {
 public:
  /// `live`: the keys that the process takes while it runs. `running`: every key's present value.
  LiveSettings(std::vector<std::string> live, ConfigValues running)
      : live_(std::move(live)), running_(std::move(running)) {}

  struct Change {
    std::vector<std::string> now;         // "key = value" of live keys
    std::vector<std::string> at_restart;  // of the others
  };
  /// What is different from what runs.
  Change Compare(const ConfigValues& read) const;

  /// The process has taken the live ones: logs it, and what needs a restart.
  void Adopt(const ConfigValues& read);

 private:
  std::vector<std::string> live_;
  ConfigValues running_;
};

}  // namespace rikiseki
