// SPDX-License-Identifier: MIT
// What an operator asks for - emergency stop, enable, clutch - on its way from signal handlers and
// the keyboard into the loop.
#pragma once

#include <atomic>
#include <cstdint>

#include "haptic_server/step.h"

namespace rikiseki::haptic {

/// Requests are counted, so that none is lost however briefly it was made.
class OperatorPanel {
 public:
  /// From any thread, and from signal handlers.
  void Stop() noexcept { stops_.fetch_add(1, std::memory_order_relaxed); }
  void Enable() noexcept { enables_.fetch_add(1, std::memory_order_relaxed); }
  void ToggleClutch() noexcept { clutch_toggles_.fetch_add(1, std::memory_order_relaxed); }

  /// What was asked for since the last call. By the loop's thread. // RT:
  OperatorInput Take() noexcept {
    const std::uint32_t stops = stops_.load(std::memory_order_relaxed);
    const std::uint32_t enables = enables_.load(std::memory_order_relaxed);
    const OperatorInput wish{.stop = stops != stops_taken_,
                             .enable = enables != enables_taken_,
                             .clutch = clutch_toggles_.load(std::memory_order_relaxed) % 2 == 1};
    stops_taken_ = stops;
    enables_taken_ = enables;
    return wish;
  }

 private:
  std::atomic<std::uint32_t> stops_{0};
  std::atomic<std::uint32_t> enables_{0};
  std::atomic<std::uint32_t> clutch_toggles_{0};
  std::uint32_t stops_taken_ = 0;
  std::uint32_t enables_taken_ = 0;

  static_assert(std::atomic<std::uint32_t>::is_always_lock_free);  // for signal handlers
};

}  // namespace rikiseki::haptic
