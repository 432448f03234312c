#include "haptic_server/render/surface_force.h"

#include <algorithm>

#include "haptic_server/render/feature_track.h"

namespace rikiseki::haptic {

SurfaceForce::SurfaceForce(const RenderSettings& settings, double period_s)
    : stiffness_(settings.stiffness_n_per_m),
      damping_(settings.damping_ns_per_m),
      adhesion_(settings.adhesion),
      period_s_(period_s) {}

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
  std::array<BodyContact, kMaxContactPlanes> now;
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
    const double stiffness = own ? surface.stiffness : stiffness_;
    body->spring += stiffness * displacement;
    body->stiffness += stiffness * multiplier;  // weighted, like damping; divided below
    body->damping += (own ? surface.damping : damping_) * multiplier;
    body->weight += multiplier;
  }

  const double elapsed_s =
      period_s_ * static_cast<double>(std::max<std::int64_t>(elapsed_ticks, 1));
  std::size_t share_count = 0;
  std::array<bool, kMaxContactPlanes> went_on{};
  for (std::size_t i = 0; i < count; ++i) {
    BodyContact& body = now[i];
    body.stiffness /= body.weight;
    body.damping /= body.weight;
    body.point = contact.proxy - radius * body.displacement.stableNormalized();
    Vec3 before = Vec3::Zero();
    for (std::size_t j = 0; j < count_; ++j) {
      if (contacts_[j].body == body.body && contacts_[j].generation == body.generation) {
        before = contacts_[j].displacement;
        went_on[j] = true;
      }
    }
    const Vec3 force = body.spring + body.damping * (body.displacement - before) / elapsed_s;
    if (!adhesion_ && !(force.dot(body.displacement) > 0)) continue;
    shares_[share_count++] = ShareOf(body, force);
    shares_[share_count - 1].displacement = body.displacement;
  }
  if (adhesion_) {  // e = 0 from now on: the damper pulls once more, which makes its impulse add up
                    // to 0
    for (std::size_t j = 0; j < count_; ++j) {
      const BodyContact& body = contacts_[j];
      if (went_on[j]) continue;
      const Vec3 force = -body.damping * body.displacement / elapsed_s;
      shares_[share_count++] = ShareOf(body, force);
    }
  }
  std::copy_n(now.begin(), count, contacts_.begin());
  count_ = count;
  return std::span(shares_).first(share_count);
}

}  // namespace rikiseki::haptic
