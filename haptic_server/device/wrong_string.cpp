// SPDX-License-Identifier: MIT
#include "haptic_server/device/wrong_string.h"

#include <cmath>
#include <iomanip>
#include <sstream>

namespace rikiseki::haptic {

void WrongString::Blame(const SuspectString& suspect) noexcept {
  blamed_.store(
      {static_cast<std::int32_t>(suspect.string) + 1, static_cast<float>(1e3 * suspect.excess_m)},
      std::memory_order_relaxed);
}

std::string WrongString::Complaint() const {
  const Blamed wrong = blamed_.load(std::memory_order_relaxed);
  if (wrong.number == 0) return "";
  std::ostringstream text;
  text << "string " << wrong.number << " seems " << std::fixed << std::setprecision(1)
       << std::abs(wrong.excess_mm)
       << (wrong.excess_mm > 0 ? " mm too long: it hangs slack or has slipped off"
                               : " mm too short: it has slipped, or its encoder lost counts");
  return text.str();
}

}  // namespace rikiseki::haptic
