// SPDX-License-Identifier: MIT
#include "common/histogram.h"

#include <catch2/catch.hpp>
#include <limits>
#include <random>

namespace rikiseki {

TEST_CASE("every bucket begins at its lower edge and ends before the next") {
  for (std::size_t bucket = 1; bucket < kHistogramSize; ++bucket) {
    CAPTURE(bucket);
    const std::int64_t edge = HistogramLowerEdge(bucket);
    CHECK(edge > HistogramLowerEdge(bucket - 1));
    CHECK(HistogramBucket(edge) == bucket);
    CHECK(HistogramBucket(edge - 1) == bucket - 1);
  }
}

TEST_CASE("the edges are 1 us times 2^o (1 + s/8)") {
  CHECK(HistogramLowerEdge(0) == 0);
  CHECK(HistogramLowerEdge(1) == 1000);
  CHECK(HistogramLowerEdge(2) == 1125);
  CHECK(HistogramLowerEdge(8) == 1875);
  CHECK(HistogramLowerEdge(9) == 2000);
  CHECK(HistogramLowerEdge(1 + 8 * 10 + 3) == 1000 * 1024 * 11 / 8);
}

TEST_CASE("buckets are at most an eighth wide and reach beyond an hour") {
  for (std::size_t bucket = 1; bucket + 1 < kHistogramSize; ++bucket) {
    const auto low = static_cast<double>(HistogramLowerEdge(bucket));
    CHECK(static_cast<double>(HistogramLowerEdge(bucket + 1)) <= low * 1.125);
  }
  CHECK(HistogramLowerEdge(kHistogramSize - 1) > std::int64_t{3600} * 1'000'000'000);
}

TEST_CASE("no duration is without a bucket, and longer ones never fall lower") {
  CHECK(HistogramBucket(std::numeric_limits<std::int64_t>::min()) == 0);
  CHECK(HistogramBucket(-1) == 0);
  CHECK(HistogramBucket(0) == 0);
  CHECK(HistogramBucket(999) == 0);
  CHECK(HistogramBucket(std::numeric_limits<std::int64_t>::max()) == kHistogramSize - 1);
  std::size_t previous = 0;
  for (double duration = 1; duration < 9.2e18; duration *= 1.01) {
    const std::size_t bucket = HistogramBucket(static_cast<std::int64_t>(duration));
    CHECK(bucket >= previous);
    previous = bucket;
  }
  CHECK(previous == kHistogramSize - 1);
}

TEST_CASE("a quantile is the upper edge of the bucket that holds it") {
  HistogramCounts counts{};
  CHECK(HistogramTotal(counts) == 0);
  CHECK(HistogramQuantile(counts, 0.5) == 0);

  counts[3] = 90;
  counts[20] = 9;
  counts[kHistogramSize - 1] = 1;
  CHECK(HistogramTotal(counts) == 100);
  CHECK(HistogramQuantile(counts, 0) == HistogramLowerEdge(4));
  CHECK(HistogramQuantile(counts, 0.5) == HistogramLowerEdge(4));
  CHECK(HistogramQuantile(counts, 0.9) == HistogramLowerEdge(4));
  CHECK(HistogramQuantile(counts, 0.901) == HistogramLowerEdge(21));
  CHECK(HistogramQuantile(counts, 0.99) == HistogramLowerEdge(21));
  CHECK(HistogramQuantile(counts, 1) == HistogramLowerEdge(kHistogramSize));
  CHECK(HistogramQuantile(counts, 7) == HistogramLowerEdge(kHistogramSize));
}

TEST_CASE("the quantiles of evenly spread durations are those of the uniform distribution") {
  HistogramCounts counts{};
  for (std::int64_t duration = 0; duration < 1'000'000; duration += 10) {
    ++counts[HistogramBucket(duration)];
  }
  for (const double fraction : {0.01, 0.1, 0.5, 0.9, 0.99, 0.999}) {
    const double quantile = static_cast<double>(HistogramQuantile(counts, fraction));
    CHECK(quantile >= fraction * 1e6);
    CHECK(quantile <= fraction * 1e6 * 1.125 + 10);  // one bucket wide
  }
}

}  // namespace rikiseki
