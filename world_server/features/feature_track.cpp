// SPDX-License-Identifier: MIT
#include "world_server/features/feature_track.h"

#include <algorithm>
#include <limits>

namespace rikiseki::world {
namespace {

// Surfaces that face each other like this, or more, are not the same surface gone round an edge.
constexpr double kOpposite = -0.5;
constexpr double kNudge = 1e-6;  // of the way to the foot

}  // namespace

void FeatureTrack::Find(const Shape& shape, const Vec3& p, double radius,
                        std::vector<NearestPoint>& found) const {
  FindFeatures(shape, p, radius, found);
  if (found.empty() || last_.empty()) return;
  if (!found.front().degenerate || found.front().distance >= 0) return;
  const Vec3 nudged = p + kNudge * (last_.front().point - p);
  FindFeatures(shape, nudged, radius, found);
  for (NearestPoint& feature : found) {
    feature.distance = feature.normal.dot(p - feature.point);
    feature.point = p - feature.distance * feature.normal;
  }
}

std::span<const std::uint32_t> FeatureTrack::Number(std::span<const NearestPoint> features,
                                                    double length_m) {
  std::vector<std::uint32_t> slots(features.size(), kMaxSlots);
  std::vector<bool> taken(last_.size(), false);
  std::uint32_t used = 0;  // bits of slots that this frame or the last one has
  for (const std::uint32_t slot : slots_) used |= 1U << slot;
  // The most similar pair first: foot and normal both count.
  for (std::size_t round = 0; round < std::min(features.size(), last_.size()); ++round) {
    double least = std::numeric_limits<double>::infinity();
    std::size_t best = 0, best_last = 0;
    for (std::size_t i = 0; i < features.size(); ++i) {
      for (std::size_t j = 0; j < last_.size(); ++j) {
        if (slots[i] != kMaxSlots || taken[j]) continue;
        if (features[i].normal.dot(last_[j].normal) < kOpposite) continue;
        const double difference = (features[i].point - last_[j].point).norm() +
                                  length_m * (features[i].normal - last_[j].normal).norm();
        if (difference >= least) continue;
        least = difference;
        best = i;
        best_last = j;
      }
    }
    if (least == std::numeric_limits<double>::infinity()) break;
    slots[best] = slots_[best_last];
    taken[best_last] = true;
  }
  for (std::uint32_t& slot : slots) {
    if (slot != kMaxSlots) continue;
    slot = 0;
    while ((used >> slot & 1U) != 0) ++slot;
    used |= 1U << slot;
  }
  last_.assign(features.begin(), features.end());
  slots_ = std::move(slots);
  return slots_;
}

}  // namespace rikiseki::world
