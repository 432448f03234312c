// SPDX-License-Identifier: MIT
// The string that makes a SPIDAR's reading a fault: found in the tick, put into words by another thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "haptic_server/device/strings.h"

namespace rikiseki::haptic {

/// The strings fix the grip with a length or two to spare; if one length is off by more than this [m]
/// from what the others say, a string hangs slack or its pulley slipped, by some four times as much.
/// Quantisation accounts for less than one count.
inline constexpr double kSlipResidual = 1e-3;

class WrongString {
 public:
  /// The strings agree. // RT:
  void Clear() noexcept { blamed_.store({}, std::memory_order_relaxed); }

  /// None was blamed since they agreed. // RT:
  bool is_clear() const noexcept { return blamed_.load(std::memory_order_relaxed).number == 0; }

  // RT:
  void Blame(const SuspectString& suspect) noexcept;

  /// Names it, counted from 1 as the motors of the device file are, and says what it seems to have;
  /// empty if it is clear. From any thread.
  std::string Complaint() const;

 private:
  struct alignas(8) Blamed {  // so that every compiler does without a lock
    std::int32_t number = 0;  // 0: none
    float excess_mm = 0;
  };
  static_assert(std::atomic<Blamed>::is_always_lock_free);

  std::atomic<Blamed> blamed_{Blamed()};
};

}  // namespace rikiseki::haptic
