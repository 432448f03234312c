// SPDX-License-Identifier: MIT
// A wanted force -> the tensions of four strings that pull on one point.
#pragma once

#include <array>

#include "common/geometry.h"

namespace rikiseki::haptic {

inline constexpr std::size_t kTensionStrings = 4;
using FourStrings = std::array<double, kTensionStrings>;

struct TensionBounds {
  double min_n = 0;
  double max_n = 0;
};

struct TensionAllocation {
  FourStrings tension{};      // N, each within the bounds, always
  Vec3 force = Vec3::Zero();  // N, what these tensions display
  bool feasible = false;      // the wanted force is displayed to rounding
};

/// The force [N] of `tension` along the unit `directions` from the grip to the motors. // RT:
Vec3 StringForce(const std::array<Vec3, kTensionStrings>& directions,
                 const FourStrings& tension) noexcept;

/// Of all tensions within the bounds that display `force` [N], those of the smallest sum; if there
/// are none, those that miss it least, again of the smallest sum. Exact: four tensions balance
/// three components, so the solutions form a line; outside, the best point lies on a face of the
/// box, and all faces are tried. A force that is not finite counts as zero. // RT:
TensionAllocation AllocateTensions(const std::array<Vec3, kTensionStrings>& directions,
                                   const Vec3& force, const TensionBounds& bounds) noexcept;

}  // namespace rikiseki::haptic
