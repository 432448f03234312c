// SPDX-License-Identifier: MIT
#include "common/clock.h"

#include <cerrno>
#include <ctime>

namespace rikiseki {

std::int64_t MonotonicNow() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
}

void SleepUntil(std::int64_t deadline_ns) noexcept {
  const timespec deadline{.tv_sec = deadline_ns / kNanosecondsPerSecond,
                          .tv_nsec = deadline_ns % kNanosecondsPerSecond};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
  }
}

std::int64_t PeriodicSchedule::WakeUp(std::int64_t now_ns) noexcept {
  if (now_ns < deadline_ns_) return 0;
  const std::int64_t missed = (now_ns - deadline_ns_) / period_ns_;
  deadline_ns_ += missed * period_ns_;
  return missed;
}

std::int64_t PeriodicSchedule::Advance(std::int64_t now_ns) noexcept {
  deadline_ns_ += period_ns_;
  if (now_ns < deadline_ns_) return 0;
  const std::int64_t missed = (now_ns - deadline_ns_) / period_ns_ + 1;
  deadline_ns_ += missed * period_ns_;
  return missed;
}

}  // namespace rikiseki
