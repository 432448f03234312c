// SPDX-License-Identifier: MIT
#include "world_server/physics/contact_point.h"

#include <algorithm>

namespace rikiseki::world {
namespace {

constexpr double kDeeper = 1e-6;  // m

bool IsDeeper(const ContactPoint& a, const ContactPoint& b) {
  return a.gap < b.gap;
}

}  // namespace

void KeepSome(std::vector<ContactPoint>& points) {
  const std::size_t count = points.size();
  if (count <= kMostContactPoints) return;
  const auto deepest = std::min_element(points.begin(), points.end(), IsDeeper);
  const auto place = static_cast<std::size_t>(deepest - points.begin());
  std::vector<ContactPoint> kept;
  for (std::size_t i = 0; i < kMostContactPoints; ++i) {
    kept.push_back(points[i * count / kMostContactPoints]);
  }
  const double reached = std::min_element(kept.begin(), kept.end(), IsDeeper)->gap;
  if (deepest->gap < reached - kDeeper) kept[place * kMostContactPoints / count] = *deepest;
  points = std::move(kept);
}

void PutInWorld(const Pose& pose_WF, std::vector<ContactPoint>& points) {
  for (ContactPoint& point : points) {
    point.point_W = pose_WF * point.point_W;
    point.normal_W = pose_WF.orientation * point.normal_W;
  }
}

}  // namespace rikiseki::world
