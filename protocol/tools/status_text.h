// SPDX-License-Identifier: MIT
// The report of Observer in words, for people: what `haptic_status` prints without --json.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace rikiseki::protocol {

enum class StatusDetail {
  kBrief,  // for a small terminal: without histograms, the books in one line
  kFull,
};

/// `report` as Observer::Read gives it. Lines end with \n and hold no control characters.
std::string StatusText(const nlohmann::ordered_json& report, StatusDetail detail);

}  // namespace rikiseki::protocol
