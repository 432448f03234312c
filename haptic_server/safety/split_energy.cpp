// SPDX-License-Identifier: MIT
#include "haptic_server/safety/split_energy.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace rikiseki::haptic {

SplitEnergy::SplitEnergy(const PenaltyRule& rule, std::uint64_t history_ticks,
                         std::uint64_t own_epoch)
    : rule_(rule),
      own_epoch_(own_epoch),
      history_(std::bit_ceil(std::max<std::uint64_t>(history_ticks, 2))) {}

void SplitEnergy::Book(std::uint64_t tick, const Vec3& finger,
                       std::span<const BodyImpulse> booked) noexcept {
  for (const BodyImpulse& push : booked) {
    const auto end = pushed_.begin() + static_cast<std::ptrdiff_t>(pushed_count_);
    auto place = std::find_if(pushed_.begin(), end, [&](const Pushed& pushed) {
      return pushed.body == push.body && pushed.generation == push.generation;
    });
    if (place == end) {
      if (pushed_count_ < pushed_.size()) {
        ++pushed_count_;
      } else {
        // The one that was pushed longest ago, if all its pushes are acknowledged.
        place = std::min_element(pushed_.begin(), end, [](const Pushed& a, const Pushed& b) {
          return a.newest_tick < b.newest_tick;
        });
        if (place->newest_tick > acked_tick_) {
          overflow_tick_ = tick;
          continue;
        }
      }
      *place = {.body = push.body, .generation = push.generation, .first_tick = tick};
    }
    place->newest_tick = tick;
    place->total += push.impulse;
  }
  Record& record = At(tick);
  record.moved = moved_;
  record.finger = finger;
  for (std::size_t i = 0; i < pushed_count_; ++i) record.totals[i] = pushed_[i].total;
}

double SplitEnergy::Receive(std::uint64_t world_epoch, const protocol::WorldFrame& frame,
                            const LocalBodies& copies, std::uint64_t tick) noexcept {
  const bool is_about_us =
      frame.acked_epoch != 0 && (own_epoch_ == 0 || frame.acked_epoch == own_epoch_);
  const std::uint64_t acked = frame.acked_tick;
  // Tick acked + 1 has shown what the force of tick acked did.
  const bool is_remembered = is_about_us && acked < tick && tick - acked < history_.size();
  double added = 0;
  if (!is_remembered) {
    world_epoch_ = 0;
    return added;
  }
  const double moved = acked + 1 < tick ? At(acked + 1).moved : moved_;
  const bool follows = world_epoch_ == world_epoch && acked_tick_ <= acked &&
                       tick - acked_tick_ < history_.size() && overflow_tick_ <= acked_tick_;
  if (follows) {
    added =
        Judge({.before = At(acked_tick_), .now = At(acked), .frame = frame}, moved - moved_acked_);
  }
  world_epoch_ = world_epoch;
  acked_tick_ = acked;
  moved_acked_ = moved;
  Remember(frame, copies);
  return added;
}

// `moved`: J, of the surfaces in the ticks that are acknowledged.
double SplitEnergy::Judge(const Acked& acked, double moved) const noexcept {
  double added = moved;
  for (std::size_t i = 0; i < pushed_count_; ++i) {
    if (!Taken(i, acked, added)) return 0;
  }
  return std::isfinite(added) ? added : 0;
}

// Adds what the body took. False if that is not known.
bool SplitEnergy::Taken(std::size_t slot, const Acked& acked, double& energy) const noexcept {
  const Pushed& pushed = pushed_[slot];
  if (pushed.newest_tick <= acked_tick_) return true;
  Vec3 impulse = acked.now.totals[slot];
  if (pushed.first_tick <= acked_tick_) impulse -= acked.before.totals[slot];
  if (impulse.isZero(0)) return true;

  const Face* before = nullptr;
  if (acked.frame.coupling == protocol::Coupling::kPosition) {
    before = LowestFace(pushed, acked.now.finger, 1);  // where it is deepest
    if (before == nullptr) return false;
    const double depth =
        rule_.finger_radius_m - before->normal.dot(acked.now.finger - before->point);
    if (!(depth > 0)) return true;
    const double stiffness = before->stiffness > 0 ? before->stiffness : rule_.stiffness_n_per_m;
    const double period_s = static_cast<double>(acked.frame.period_ns) * 1e-9;
    impulse = -stiffness * depth * period_s * before->normal;
  } else {
    before = LowestFace(pushed, impulse, 0);  // what it presses most
    if (before == nullptr) return false;
  }
  const auto planes = std::span(acked.frame.planes).first(acked.frame.plane_count);
  const auto now = std::find_if(planes.begin(), planes.end(), [&](const protocol::Plane& plane) {
    return plane.body == before->body && plane.generation == before->generation;
  });
  if (now == planes.end()) return false;

  // Floors, walls and friction take their part of a kick at once, and that is no energy of the body:
  // what it keeps shows in its velocity.
  const double size = impulse.norm();
  const Vec3 direction = impulse / size;
  const double speed = before->velocity.dot(direction);
  const double gained = (ToVec3(now->velocity).dot(direction) - speed) / before->inverse_mass;
  const double kept = std::clamp(gained, 0.0, size);
  energy += kept * (speed + kept * before->inverse_mass / 2);
  return true;
}

void SplitEnergy::Remember(const protocol::WorldFrame& frame, const LocalBodies& copies) noexcept {
  face_count_ = 0;
  for (const protocol::Plane& plane : std::span(frame.planes).first(frame.plane_count)) {
    if (!(plane.inverse_mass > 0) || copies.Find(plane.body, plane.generation) != nullptr) continue;
    faces_[face_count_++] = {.body = plane.body,
                             .generation = plane.generation,
                             .point = ToVec3(plane.point),
                             .normal = ToVec3(plane.normal),
                             .velocity = ToVec3(plane.velocity),
                             .inverse_mass = plane.inverse_mass,
                             .stiffness = plane.stiffness};
  }
}

// Of the body's faces the one along whose normal `v - point_share * point` is least.
const SplitEnergy::Face* SplitEnergy::LowestFace(const Pushed& pushed, const Vec3& v,
                                                 double point_share) const noexcept {
  const Face* best = nullptr;
  double lowest = 0;
  for (const Face& face : std::span(faces_).first(face_count_)) {
    if (face.body != pushed.body || face.generation != pushed.generation) continue;
    const double height = face.normal.dot(v - point_share * face.point);
    if (best == nullptr || height < lowest) {
      best = &face;
      lowest = height;
    }
  }
  return best;
}

}  // namespace rikiseki::haptic
