// SPDX-License-Identifier: MIT
#include "haptic_server/render/surface_force.h"

#include <algorithm>

namespace rikiseki::haptic {

SurfaceForce::SurfaceForce(const RenderSettings& settings, double period_s)
    : stiffness_(settings.stiffness_n_per_m),
      damping_(settings.damping_ns_per_m),
      adhesion_(settings.adhesion),
      period_s_(period_s),
      friction_(settings.friction_stiffness_n_per_m) {}

// On the user, [N]; `force` is the share without it, `way` that of the finger since the tick before.
Vec3 SurfaceForce::FrictionOf(const BodyContact& body, const Vec3& force, const Vec3& way,
                              double elapsed_s) noexcept {
  const Vec3 normal = body.displacement.stableNormalized();
  return friction_.Force({.body = body.body,
                          .generation = body.generation,
                          .normal = normal,
                          .normal_force = std::max(0.0, force.dot(normal)),
                          .static_friction = body.static_friction / body.weight,
                          .dynamic_friction = body.dynamic_friction / body.weight,
                          .damping = body.damping,
                          .slip = way - elapsed_s * body.velocity / body.rough_weight},
                         elapsed_s);
}

BodyShare SurfaceForce::ShareOf(const BodyContact& body, const Vec3& force) noexcept {
  return {.body = body.body,
          .generation = body.generation,
          .force = force,
          .point = body.point,
          .fixed = body.fixed,
          .stiffness = body.stiffness,
          .damping = body.damping};
}

std::span<BodyShare> SurfaceForce::Update(std::span<const Surface> surfaces,
                                          const ContactSolution& contact, double radius,
                                          std::int64_t elapsed_ticks) noexcept {
  const Contacts& before = contacts_[newest_];
  newest_ = 1 - newest_;
  Contacts& now = contacts_[newest_];
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(surfaces.size(), kMaxContactPlanes); ++i) {
    const double multiplier = contact.multiplier[i];
    if (!(multiplier > 0)) continue;
    const Surface& surface = surfaces[i];
    const auto end = now.begin() + static_cast<std::ptrdiff_t>(count);
    auto body = std::find_if(now.begin(), end, [&](const BodyContact& other) {
      return other.body == surface.body && other.generation == surface.generation;
    });
    if (body == end) {
      now[count++] = {};
      body->body = surface.body;
      body->generation = surface.generation;
      body->fixed = surface.fixed;
    }
    const bool own = surface.stiffness > 0;
    const Vec3 displacement = multiplier * surface.plane.normal;
    body->displacement += displacement;
    const double stiffness = surface.strength * (own ? surface.stiffness : stiffness_);
    body->spring += stiffness * displacement;
    body->stiffness += stiffness * multiplier;  // weighted, like damping; divided below
    body->damping += surface.strength * (own ? surface.damping : damping_) * multiplier;
    body->weight += multiplier;
    if (surface.static_friction > 0 || surface.dynamic_friction > 0) {
      body->static_friction += multiplier * surface.static_friction;
      body->dynamic_friction += multiplier * surface.dynamic_friction;
      body->velocity += multiplier * surface.velocity;
      body->rough_weight += multiplier;
    }
  }

  const double elapsed_s =
      period_s_ * static_cast<double>(std::max<std::int64_t>(elapsed_ticks, 1));
  const Vec3 finger = contact.proxy - contact.displacement;
  const Vec3 way = finger - finger_;
  finger_ = finger;
  stored_ = 0;
  std::size_t share_count = 0;
  std::array<bool, kMaxContactPlanes> went_on{};
  for (std::size_t i = 0; i < count; ++i) {
    BodyContact& body = now[i];
    body.stiffness /= body.weight;
    body.damping /= body.weight;
    stored_ += 0.5 * body.spring.dot(body.displacement);
    body.point = contact.proxy - radius * body.displacement.stableNormalized();
    Vec3 displaced_before = Vec3::Zero();
    for (std::size_t j = 0; j < count_; ++j) {
      if (before[j].body == body.body && before[j].generation == body.generation) {
        displaced_before = before[j].displacement;
        went_on[j] = true;
      }
    }
    Vec3 force = body.spring + body.damping * (body.displacement - displaced_before) / elapsed_s;
    if (!adhesion_ && !(force.dot(body.displacement) > 0)) continue;
    if (body.static_friction > 0 || body.dynamic_friction > 0) {
      force += FrictionOf(body, force, way, elapsed_s);
    }
    shares_[share_count++] = ShareOf(body, force);
    shares_[share_count - 1].displacement = body.displacement;
  }
  if (friction_.holds()) {
    friction_.EndTick();
    stored_ += friction_.stored();
  }
  if (adhesion_) {  // e = 0 from now on: the damper pulls once more, which makes its impulse add up
                    // to 0
    for (std::size_t j = 0; j < count_; ++j) {
      const BodyContact& body = before[j];
      if (went_on[j]) continue;
      const Vec3 force = -body.damping * body.displacement / elapsed_s;
      shares_[share_count++] = ShareOf(body, force);
    }
  }
  count_ = count;
  return std::span(shares_).first(share_count);
}

}  // namespace rikiseki::haptic
