// SPDX-License-Identifier: MIT
// Time as the loops see it: nanoseconds of CLOCK_MONOTONIC, or of an experiment's virtual time.
#pragma once

#include <cstdint>

namespace rikiseki {

inline constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

inline constexpr double Seconds(std::int64_t duration_ns) {
  return static_cast<double>(duration_ns) * 1e-9;
}
inline constexpr double Seconds(std::uint64_t duration_ns) {
  return static_cast<double>(duration_ns) * 1e-9;
}

/// Now, ns of CLOCK_MONOTONIC. // RT: a vDSO read.
std::int64_t MonotonicNow() noexcept;

/// Sleeps until an absolute time of CLOCK_MONOTONIC; a signal does not shorten it. // RT:
void SleepUntil(std::int64_t deadline_ns) noexcept;

/// Absolute deadlines of a periodic loop. A missed one is skipped and counted, never caught up.
class PeriodicSchedule {
 public:
  /// The first deadline is one period after `start_ns`.
  PeriodicSchedule(std::int64_t start_ns, std::int64_t period_ns)
      : deadline_ns_(start_ns + period_ns), period_ns_(period_ns) {}

  std::int64_t deadline_ns() const { return deadline_ns_; }
  std::int64_t period_ns() const { return period_ns_; }

  /// The sleep until the deadline ended at `now_ns`. Moves to the last deadline that has come by then and
  /// returns how many were slept through before it: a process that was stopped meanwhile. // RT:
  std::int64_t WakeUp(std::int64_t now_ns) noexcept;

  /// Moves to the next deadline that lies after `now_ns`, the time when the work of the current one
  /// ended. Returns how many deadlines were skipped. // RT:
  std::int64_t Advance(std::int64_t now_ns) noexcept;

 private:
  std::int64_t deadline_ns_;
  std::int64_t period_ns_;
};

}  // namespace rikiseki
