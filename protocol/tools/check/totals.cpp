// SPDX-License-Identifier: MIT
#include "protocol/tools/check/totals.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace rikiseki::protocol::check {
std::int64_t Units(double newton_seconds) {
  return static_cast<std::int64_t>(std::llround(newton_seconds / kImpulseUnit));
}

double Largest(const ImpulseUnits& units) {
  double largest = 0;
  for (const std::int64_t unit : units) {
    largest = std::max(largest, std::abs(static_cast<double>(unit)));
  }
  return largest;
}

std::string Text(const ImpulseUnits& units) {
  std::string text;
  for (const std::int64_t unit : units) {
    text += text.empty() ? "(" : ", ";
    text += std::to_string(unit);
  }
  return text + ")";
}

double Norm(const Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}
double Dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector Scaled(const Vector& v, double factor) {
  return {v[0] * factor, v[1] * factor, v[2] * factor};
}
Vector Sum(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Vector Difference(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

ChannelKey KeyOf(const Channel& channel) {
  return {channel.body, channel.generation, channel.pointer, channel.opened_tick};
}

Totals TotalsOf(const HapticTick& tick) {
  Totals totals;
  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    totals.emplace(KeyOf(tick.channels[i]), tick.channels[i]);
  }
  return totals;
}

ImpulseUnits Growth(const Totals& before, const Totals& after) {
  ImpulseUnits growth{};
  for (const auto& [key, channel] : after) {
    const auto known = before.find(key);
    const ImpulseUnits from = known == before.end() ? ImpulseUnits{} : known->second.impulse;
    growth = Plus(growth, Minus(channel.impulse, from));
  }
  return growth;
}

}  // namespace rikiseki::protocol::check
