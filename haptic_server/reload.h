// SPDX-License-Identifier: MIT
// SIGHUP: reads the settings again and hands what may change to the running loop. A wrong file is refused
// whole, and what runs goes on.
#pragma once

#include <string>
#include <vector>

#include "common/live_settings.h"
#include "haptic_server/loop.h"

namespace rikiseki::haptic {

class Reload {
 public:
  /// `set` wins over the file, as at the start; `running` are the values of the start.
  Reload(std::string path, std::vector<std::string> set, ConfigValues running)
      : path_(std::move(path)), set_(std::move(set)), live_(LiveKeys(), std::move(running)) {}

  /// Says in the log what it did.
  void Again(HapticLoop& loop);

 private:
  std::string path_;
  std::vector<std::string> set_;
  LiveSettings live_;
};

}  // namespace rikiseki::haptic
