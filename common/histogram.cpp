// SPDX-License-Identifier: MIT
#include "common/histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace rikiseki {
namespace {

constexpr std::int64_t kFloorNs = 1000;  // everything below one microsecond shares bucket 0
constexpr int kPerOctave = 8;

}  // namespace

// Bucket 0 holds [0, 1000); bucket 1 + 8 o + s holds 1000 * 2^o * [1 + s/8, 1 + (s+1)/8).
std::size_t HistogramBucket(std::int64_t duration_ns) noexcept {
  if (duration_ns < kFloorNs) return 0;
  if (duration_ns >= HistogramLowerEdge(kHistogramSize - 1)) return kHistogramSize - 1;
  const auto floors = static_cast<std::uint64_t>(duration_ns / kFloorNs);  // >= 1
  const auto octave = static_cast<std::int64_t>(std::bit_width(floors | 1)) - 1;
  const std::int64_t base = kFloorNs << octave;
  const std::int64_t step = (duration_ns - base) * kPerOctave / base;
  return static_cast<std::size_t>(1 + octave * kPerOctave + step);
}

std::int64_t HistogramLowerEdge(std::size_t bucket) noexcept {
  if (bucket == 0) return 0;
  const auto octave = static_cast<int>((bucket - 1) / kPerOctave);
  const auto step = static_cast<std::int64_t>((bucket - 1) % kPerOctave);
  const std::int64_t base = kFloorNs << octave;
  return base + (base * step + kPerOctave - 1) / kPerOctave;
}

std::int64_t HistogramQuantile(const HistogramCounts& counts, double fraction) noexcept {
  const std::uint64_t total = HistogramTotal(counts);
  if (total == 0) return 0;
  const auto wanted = static_cast<std::uint64_t>(
      std::ceil(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(total)));
  std::uint64_t seen = 0;
  for (std::size_t bucket = 0; bucket < kHistogramSize; ++bucket) {
    seen += counts[bucket];
    if (seen >= std::max<std::uint64_t>(wanted, 1)) return HistogramLowerEdge(bucket + 1);
  }
  return HistogramLowerEdge(kHistogramSize);
}

std::uint64_t HistogramTotal(const HistogramCounts& counts) noexcept {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

}  // namespace rikiseki
