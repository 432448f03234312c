// SPDX-License-Identifier: MIT
#include "haptic_server/selftest.h"

#include <sched.h>

#include <catch2/catch.hpp>

#include "common/histogram.h"

namespace rikiseki::haptic {
namespace {

using Catch::Matchers::Contains;

// So many wake-ups, each late by this.
protocol::HapticHealth Late(std::uint64_t count, std::int64_t by_ns) {
  protocol::HapticHealth health;
  health.ticks = count;
  health.lateness[HistogramBucket(by_ns)] = count;
  health.scheduling = {.policy = SCHED_FIFO, .priority = 80, .memory_locked = 1, .cpu = 0};
  return health;
}

TEST_CASE("a PC is judged by its tail, not by its average") {
  protocol::HapticHealth health = Late(60000, 20'000);
  CHECK(Judge(health, 60) == Hold::kWell);
  // One in ten thousand: p99.9 does not see it, the worst does.
  health.lateness[HistogramBucket(600'000)] = 6;
  CHECK(Judge(health, 60) == Hold::kEnough);
  health.lateness[HistogramBucket(600'000)] = 120;
  CHECK(Judge(health, 60) == Hold::kNot);
}

TEST_CASE("missed deadlines are allowed one in a minute, and never three in a row") {
  protocol::HapticHealth health = Late(60000, 20'000);
  health.missed = 1;
  health.worst_missed_in_a_row = 1;
  CHECK(Judge(health, 60) == Hold::kEnough);
  health.missed = 2;
  CHECK(Judge(health, 60) == Hold::kNot);
  CHECK(Judge(health, 120) == Hold::kEnough);
  health.worst_missed_in_a_row = 3;
  CHECK(Judge(health, 1200) == Hold::kNot);
  CHECK(Judge(protocol::HapticHealth{}, 10) == Hold::kNot);
}

TEST_CASE("the report says the verdict, what was obtained and what to change") {
  const std::string good = SelftestReport(Late(1000, 20'000), 1, {"", ""});
  CHECK_THAT(good, Contains("holds the loop well"));
  CHECK_THAT(good, Contains("SCHED_FIFO 80, memory locked"));
  CHECK_THAT(good, !Contains("To change"));
  const std::string bad = SelftestReport(Late(1000, 5'000'000), 1, {"SCHED_FIFO 80: no", ""});
  CHECK_THAT(bad, Contains("does not hold the loop"));
  CHECK_THAT(bad, Contains("To change: SCHED_FIFO 80: no"));
  CHECK_THAT(bad, Contains("scripts/tune_host"));
}

}  // namespace
}  // namespace rikiseki::haptic
