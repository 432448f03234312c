// SPDX-License-Identifier: MIT
// How benchmarks time single ticks.
#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

namespace rikiseki {

using Clock = std::chrono::steady_clock;

/// The q-quantile of `values`, which are sorted by it.
inline double Quantile(std::vector<double>& values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

/// What two readings of the clock cost by themselves [us].
inline double ClockCost() {
  std::vector<double> idle;
  for (int i = 0; i < 1000; ++i) {
    const auto start = Clock::now();
    idle.push_back(std::chrono::duration<double, std::micro>(Clock::now() - start).count());
  }
  return Quantile(idle, 0.5);
}

}  // namespace rikiseki
