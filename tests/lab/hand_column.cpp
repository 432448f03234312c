// SPDX-License-Identifier: MIT
#include "tests/lab/hand_column.h"

#include <sstream>
#include <string>

namespace rikiseki::lab {

LoopHand ParseHand(const Row& row) {
  const std::string text = row.Text("hand");
  for (const NamedHand& hand : kHands) {
    if (text == hand.name) return hand.impedance;
  }
  std::istringstream words(text);
  haptic::Impedance hand;
  std::string rest;
  if (!(words >> hand.mass_kg >> hand.damping_ns_per_m >> hand.stiffness_n_per_m) ||
      words >> rest || !(hand.mass_kg > 0) || !(hand.damping_ns_per_m >= 0) ||
      !(hand.stiffness_n_per_m >= 0)) {
    row.Refuse("hand", "finger, light, medium, firm, stiff, clamped, or m b k is expected");
  }
  return hand;
}

}  // namespace rikiseki::lab
