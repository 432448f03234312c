// SPDX-License-Identifier: MIT
#include "haptic_server/render/contact_render.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {
namespace {

// How much of `whole` is left in `part`, 0..1.
double Fraction(const Vec3& part, const Vec3& whole) {
  const double square = whole.squaredNorm();
  return square > 0 && std::isfinite(square) ? std::clamp(part.dot(whole) / square, 0.0, 1.0) : 0;
}

}  // namespace

Vec3 Sum(std::span<const BodyShare> shares) noexcept {
  Vec3 sum = Vec3::Zero();
  for (const BodyShare& share : shares) sum += share.force;
  return sum;
}

ContactRender::ContactRender(const RenderSettings& settings, std::uint32_t pointer, double period_s)
    : pointer_(pointer),
      radius_(settings.finger_radius_mm * 1e-3),
      period_s_(period_s),
      surface_force_(settings, period_s) {}

// RT:
std::span<const BodyShare> ContactRender::Update(const Finger& finger, FeatureTrack& track,
                                                 LocalBodies& copies, Ledger& ledger,
                                                 bool& no_channel) noexcept {
  track.MoveFinger(pointer_, finger.position);
  const std::span<const Surface> surfaces = track.Surfaces(copies);
  for (std::size_t i = 0; i < surfaces.size(); ++i) planes_[i] = surfaces[i].plane;
  const ContactSolution contact =
      SolveContact(finger.position, radius_, std::span(planes_).first(surfaces.size()));
  penetration_ = contact.displacement.norm();
  surface_work_ = surface_motion_.Work(surfaces, finger.displayed,
                                       period_s_ * static_cast<double>(finger.elapsed_ticks));
  surface_motion_.Remember(surfaces, contact);
  std::size_t count = 0;
  for (const BodyShare& share :
       surface_force_.Update(surfaces, contact, radius_, finger.elapsed_ticks)) {
    if (share.fixed || ledger.Open(share.body, share.generation, pointer_, finger.tick)) {
      shares_[count++] = share;
    } else {
      no_channel = true;
    }
  }
  const std::span<BodyShare> shares = std::span(shares_).first(count);
  const Vec3 as_sprung = Sum(shares);
  copies.SolveStiff(shares);
  // What was solved together with its copy holds as much less: f^2/2k.
  const double left = Fraction(Sum(shares), as_sprung);
  stored_ = left * left * surface_force_.stored();
  return shares;
}

// RT:
void ContactRender::Reset() noexcept {
  surface_force_.Reset();
  surface_motion_.Reset();
  penetration_ = 0;
  surface_work_ = {};
  stored_ = 0;
}

}  // namespace rikiseki::haptic
