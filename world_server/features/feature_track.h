// SPDX-License-Identifier: MIT
// Which feature of this frame is which of the last one, for one finger and one collider: a surface
// keeps its number while the finger slides along it, however many minima the distance has. And where
// a point has no one nearest surface - a sphere's centre, a box's middle - the one felt before stays.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "world_server/features/nearest_point.h"

namespace rikiseki::world {

class FeatureTrack {
 public:
  /// A number for each of `features`, different from each other, below kMaxSlots. `length_m` is how
  /// far a foot moves from frame to frame, roughly.
  std::span<const std::uint32_t> Number(std::span<const NearestPoint> features, double length_m);

  /// FindFeatures, with what is degenerate inside decided by the last frame.
  void Find(const Shape& shape, const Vec3& p, double radius,
            std::vector<NearestPoint>& found) const;

  /// Those of two frames at once.
  static constexpr std::uint32_t kMaxSlots = 2 * kMaxFeatures;

 private:
  std::vector<NearestPoint> last_;
  std::vector<std::uint32_t> slots_;  // of last_
};

}  // namespace rikiseki::world
