// SPDX-License-Identifier: MIT
// A log-linear histogram of durations: 8 buckets an octave, 1 us to over an hour, 12 % wide, no
// allocation. The counts travel in the health streams, so the edges are part of SPEC.md 6.3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rikiseki {

inline constexpr std::size_t kHistogramSize = 256;
using HistogramCounts = std::array<std::uint64_t, kHistogramSize>;

/// The bucket of a duration; negative ones count as 0, too long ones fall into the last. // RT:
std::size_t HistogramBucket(std::int64_t duration_ns) noexcept;

/// The smallest duration [ns] that falls into `bucket`.
std::int64_t HistogramLowerEdge(std::size_t bucket) noexcept;

/// The duration [ns] that `fraction` (0..1) of the counts do not exceed: the upper edge of its bucket.
/// 0 for an empty histogram.
std::int64_t HistogramQuantile(const HistogramCounts& counts, double fraction) noexcept;

/// How many durations were counted.
std::uint64_t HistogramTotal(const HistogramCounts& counts) noexcept;

}  // namespace rikiseki
