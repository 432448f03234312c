// SPDX-License-Identifier: MIT
#include "world_server/features/near_bodies.h"

#include <algorithm>
#include <cmath>

#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

// Of as many a tree is quicker than asking each (engine notes: 0.3 us either way).
constexpr std::size_t kEnoughForATree = 100;

}  // namespace

NearBodies::NearBodies(const Scene& scene) {
  for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
    double radius = 0;
    for (const Collider& collider : scene.bodies[body].colliders) {
      const Ball ball = OuterBall(collider.shape);
      radius = std::max(radius, (collider.pose_BS * ball.centre).norm() + ball.radius);
    }
    radii_.push_back(radius);
    if (scene.bodies[body].fixed && std::isfinite(radius)) {
      planted_.push_back(body);
    } else {
      one_by_one_.push_back(body);
    }
  }
  if (planted_.size() < kEnoughForATree) {
    one_by_one_.insert(one_by_one_.end(), planted_.begin(), planted_.end());
    planted_.clear();
    return;
  }
  std::vector<Bounds> boxes;
  for (const std::size_t body : planted_) {
    Bounds box;
    for (const Collider& collider : scene.bodies[body].colliders) {
      const Ball ball = OuterBall(collider.shape);
      const Vec3 centre = scene.bodies[body].pose_WB * (collider.pose_BS * ball.centre);
      box.Add(Vec3(centre - Vec3::Constant(ball.radius)));
      box.Add(Vec3(centre + Vec3::Constant(ball.radius)));
    }
    boxes.push_back(box);
  }
  tree_ = BoxTree(boxes, 1);
}

double NearBodies::WayOf(std::size_t body, const BodyState& state, double time_s) const {
  const double turning = state.angular_velocity.norm();
  return time_s * (state.velocity.norm() + (turning > 0 ? turning * radii_[body] : 0));
}

void NearBodies::Find(std::span<const BodyState> states, const Vec3& p, double radius_m,
                      double time_s, std::vector<std::size_t>& found) const {
  found.clear();
  for (const std::size_t body : one_by_one_) {
    const BodyState& state = states[body];
    const double reach = radii_[body] + radius_m + WayOf(body, state, time_s);
    if (!((state.pose.position - p).squaredNorm() > reach * reach)) found.push_back(body);
  }
  tree_.VisitNear(
      p, radius_m, [](std::uint32_t) { return true; },
      [&](std::uint32_t place) { found.push_back(planted_[tree_.items()[place]]); });
  std::sort(found.begin(), found.end());
}

}  // namespace rikiseki::world
