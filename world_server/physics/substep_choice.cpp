// SPDX-License-Identifier: MIT
#include "world_server/physics/substep_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kShortest = 1e-4;         // s: bounds what a scene can cost
constexpr double kLongestTouching = 5e-3;  // s
constexpr double kMostTurn = 0.1;          // rad in a substep of free flight
// ... while something is touched: the direction of slip is one and the same for a substep, and lags
// half of what the body turns in it. A tenth of a degree.
constexpr double kMostTouchingTurn = 0.004;
constexpr double kMostDragging = 0.05;  // of the speed in a substep
// A pair of 5 cm boxes, the lighter one below, stands at 2 ms up to this ratio, at 1 ms up to three
// times it.
constexpr double kBornRatio = 100;
constexpr double kHighStack = 10;  // bodies

double PerSecond(double rate, double most) {
  return rate > 0 ? most / rate : std::numeric_limits<double>::infinity();
}

// Ten boxes of size L stand at 0.03 sqrt(L/g), 2 ms for 5 cm.
double StackSubstep(const GroupMotion& motion) {
  if (!motion.meets_moving || !(motion.gravity > 0)) return std::numeric_limits<double>::infinity();
  const double fall_s = std::sqrt(motion.smallest / motion.gravity);
  return std::max(0.03 * fall_s * std::min(1.0, kBornRatio / motion.mass_ratio), kShortest);
}

}  // namespace

GroupMotion MotionOf(const Group& group, const BulletBodies& bodies, const Sleepers& sleepers) {
  GroupMotion motion;
  for (const std::size_t place : group.members) {
    if (sleepers.Sleeps(place)) continue;
    const MovingBody& body = bodies.moving[place];
    ++motion.awake;
    const double speed = body.rigid->getLinearVelocity().length();
    motion.turning = std::max(motion.turning, double{body.rigid->getAngularVelocity().length()});
    motion.speed = std::max(motion.speed, body.Speed());
    if (body.inner_radius > 0) {
      motion.crossing = std::max(motion.crossing, speed / body.inner_radius);
    }
    if (body.air.acts()) motion.drag = std::max(motion.drag, body.air.Rate(body.inertia));
    motion.gravity = std::max(motion.gravity, body.gravity);
  }
  double lightest = std::numeric_limits<double>::infinity();
  double heaviest = 0;
  double least = std::numeric_limits<double>::infinity();
  const auto join = [&](const btRigidBody& a, const btRigidBody& b) {
    motion.meets = true;
    if (a.getUserIndex() < 0 || b.getUserIndex() < 0) return;
    motion.meets_moving = true;
    for (const btRigidBody* rigid : {&a, &b}) {
      const MovingBody& body = bodies.moving[static_cast<std::size_t>(rigid->getUserIndex())];
      lightest = std::min(lightest, body.inertia.mass_kg);
      heaviest = std::max(heaviest, body.inertia.mass_kg);
      if (body.inner_radius > 0) least = std::min(least, 2 * body.inner_radius);
    }
  };
  for (const ContactPair* pair : group.pairs) {
    join(*pair->first, *pair->second);
    const auto [first, second] = pair->Order();
    motion.rebounds =
        motion.rebounds || bodies.restitutions[static_cast<std::size_t>(first)] *
                                   bodies.restitutions[static_cast<std::size_t>(second)] >
                               0;
  }
  motion.meets = motion.meets || !group.joints.empty();  // solved exactly, whatever their masses
  if (motion.meets_moving) {
    motion.mass_ratio = heaviest / lightest;
    motion.smallest = std::isfinite(least) ? least : bodies.smallest;
  }
  return motion;
}

int Sweeps(const GroupMotion& motion) {
  return static_cast<int>(std::clamp(20 * std::sqrt(motion.mass_ratio), 50.0, 400.0));
}

double PushedSubstep(const GroupMotion& motion, double substep_s) {
  return std::min(substep_s, StackSubstep(motion));
}

double CoarseSubstep(const GroupMotion& motion, double substep_s, double window_s) {
  const double pushed = PushedSubstep(motion, substep_s);
  double coarse = std::min(
      {window_s, PerSecond(motion.turning, kMostTurn), PerSecond(motion.drag, kMostDragging)});
  if (motion.rebounds) return pushed;
  if (motion.meets) {
    const double height = std::min(static_cast<double>(motion.awake), kHighStack) / kHighStack;
    const double touching = motion.speed < kResting ? window_s : kLongestTouching;
    coarse = std::min({coarse, touching, PerSecond(motion.turning, kMostTouchingTurn),
                       PerSecond(motion.crossing, 0.5), StackSubstep(motion) / (1 + height)});
  }
  return std::max(coarse, pushed);
}

}  // namespace rikiseki::world
