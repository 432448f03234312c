// SPDX-License-Identifier: MIT
#include "haptic_server/render/friction.h"

#include <algorithm>

namespace rikiseki::haptic {
namespace {

Vec3 Tangential(const Vec3& v, const Vec3& normal) {
  return v - normal.dot(v) * normal;
}

}  // namespace

Vec3 Friction::Force(const FrictionContact& contact, double elapsed_s) noexcept {
  const auto end = stuck_.begin() + static_cast<std::ptrdiff_t>(count_);
  auto found = std::find_if(stuck_.begin(), end, [&](const Stuck& other) {
    return other.body == contact.body && other.generation == contact.generation;
  });
  if (found == end) {
    if (count_ == stuck_.size()) return Vec3::Zero();
    ++count_;
    *found = {.body = contact.body, .generation = contact.generation, .touched = true};
    return Vec3::Zero();  // sticks where it touched
  }
  Stuck& stuck = *found;
  stuck.touched = true;
  const Vec3 before = Tangential(stuck.stretch, contact.normal);
  stuck.stretch = before + Tangential(contact.slip, contact.normal);
  const double pull = stiffness_ * stuck.stretch.stableNorm();
  const double slides_at = contact.dynamic_friction * contact.normal_force;
  const double sticks_to = std::max(contact.static_friction * contact.normal_force, slides_at);
  stuck.slides = pull > (stuck.slides ? slides_at : sticks_to);
  if (stuck.slides) {
    stuck.stretch *= slides_at / pull;
    return -stiffness_ * stuck.stretch;
  }
  const Vec3 force =
      -stiffness_ * stuck.stretch - contact.damping * (stuck.stretch - before) / elapsed_s;
  const double size = force.stableNorm();
  return size > sticks_to ? Vec3(force * (sticks_to / size)) : force;
}

void Friction::EndTick() noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (!stuck_[i].touched) continue;
    stuck_[kept] = stuck_[i];
    stuck_[kept++].touched = false;
  }
  count_ = kept;
}

double Friction::stored() const noexcept {
  double stored = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    stored += stiffness_ / 2 * stuck_[i].stretch.squaredNorm();
  }
  return stored;
}

}  // namespace rikiseki::haptic
