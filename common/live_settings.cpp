// SPDX-License-Identifier: MIT
#include "common/live_settings.h"

#include <spdlog/spdlog.h>

#include <algorithm>

namespace rikiseki {

LiveSettings::Change LiveSettings::Compare(const ConfigValues& read) const {
  Change change;
  for (const auto& [key, value] : read) {
    const auto known = running_.find(key);
    if (known != running_.end() && known->second == value) continue;
    const bool live = std::find(live_.begin(), live_.end(), key) != live_.end();
    (live ? change.now : change.at_restart).push_back(key + " = " + value);
  }
  return change;
}

void LiveSettings::Adopt(const ConfigValues& read) {
  const Change change = Compare(read);
  for (const std::string& line : change.now) spdlog::info("now {}", line);
  for (const std::string& line : change.at_restart) spdlog::warn("needs a restart: {}", line);
  if (change.now.empty() && change.at_restart.empty()) spdlog::info("no setting has changed");
  for (const std::string& key : live_) {
    if (const auto value = read.find(key); value != read.end()) running_[key] = value->second;
  }
}

}  // namespace rikiseki
