// SPDX-License-Identifier: MIT
#include "common/clock.h"

#include <catch2/catch.hpp>

namespace rikiseki {

TEST_CASE("the monotonic clock never goes back, and a sleep never ends early") {
  const std::int64_t start = MonotonicNow();
  REQUIRE(start > 0);
  SleepUntil(start + 2'000'000);
  CHECK(MonotonicNow() >= start + 2'000'000);
  const std::int64_t past = MonotonicNow();
  SleepUntil(start);  // a deadline in the past returns
  CHECK(MonotonicNow() >= past);
}

TEST_CASE("seconds are nanoseconds divided by 1e9") {
  CHECK(Seconds(std::int64_t{1'000'000}) == Approx(1e-3).epsilon(1e-15));
  CHECK(Seconds(std::int64_t{-250'000'000}) == Approx(-0.25).epsilon(1e-15));
  CHECK(Seconds(std::uint64_t{3'000'000'000}) == Approx(3.0).epsilon(1e-15));
}

TEST_CASE("deadlines on time are one period apart") {
  PeriodicSchedule schedule(500, 1000);
  CHECK(schedule.period_ns() == 1000);
  for (std::int64_t k = 1; k < 100; ++k) {
    CHECK(schedule.deadline_ns() == 500 + 1000 * k);
    CHECK(schedule.Advance(schedule.deadline_ns() + 999) == 0);
  }
}

TEST_CASE("missed deadlines are skipped and counted, and the grid is kept") {
  PeriodicSchedule schedule(0, 1000);
  CHECK(schedule.Advance(1999) == 0);
  CHECK(schedule.deadline_ns() == 2000);
  CHECK(schedule.Advance(3000) == 1);  // the next deadline is now: too late for it
  CHECK(schedule.deadline_ns() == 4000);
  CHECK(schedule.Advance(4000 + 7 * 1000 + 1) == 7);
  CHECK(schedule.deadline_ns() == 12000);
  CHECK(schedule.Advance(12000) == 0);
  CHECK(schedule.deadline_ns() == 13000);
}

TEST_CASE(
    "deadlines that were slept through are known when the sleep ends, and not counted twice") {
  PeriodicSchedule schedule(0, 1000);
  CHECK(schedule.WakeUp(1000) == 0);
  CHECK(schedule.WakeUp(1999) == 0);
  CHECK(schedule.deadline_ns() == 1000);
  CHECK(schedule.WakeUp(8500) == 7);  // those of 1000 to 7000; the one of 8000 is worked on now
  CHECK(schedule.deadline_ns() == 8000);
  CHECK(schedule.Advance(8600) == 0);
  CHECK(schedule.deadline_ns() == 9000);
  CHECK(schedule.WakeUp(8999) == 0);  // a sleep never ends early; if it did, nothing is skipped
  CHECK(schedule.deadline_ns() == 9000);
}

TEST_CASE("whatever the lateness, the next deadline lies ahead and all are accounted for") {
  for (std::int64_t late = 0; late < 12000; late += 7) {
    PeriodicSchedule schedule(0, 1000);
    const std::int64_t now = schedule.deadline_ns() + late;
    const std::int64_t missed = schedule.Advance(now);
    CHECK(schedule.deadline_ns() > now);
    CHECK(schedule.deadline_ns() <= now + 1000);
    CHECK(schedule.deadline_ns() == 2000 + missed * 1000);
  }
}

}  // namespace rikiseki
