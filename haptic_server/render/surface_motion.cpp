// SPDX-License-Identifier: MIT
#include "haptic_server/render/surface_motion.h"

#include <algorithm>

namespace rikiseki::haptic {
namespace {

// Above a ball, of which every tick shows another plane, as above what it stays.
double HeightAbove(const Surface& surface, const Vec3& point) {
  const HalfSpace& plane = surface.plane;
  const Vec3 from_plane = point - plane.point;
  if (!(surface.radius > 0)) return plane.normal.dot(from_plane);
  return (from_plane + surface.radius * plane.normal).norm() - surface.radius;
}

}  // namespace

SurfaceMotion::WorkDone SurfaceMotion::Work(std::span<const Surface> surfaces, const Vec3& force,
                                            double elapsed_s) const noexcept {
  if (count_ == 0 || force.isZero(0)) return {};
  // f = c e + rest, and e = sum of multiplier_i n_i: plane i carries c multiplier_i along its normal.
  const double square = displacement_.squaredNorm();
  if (!(square > 0)) return {};
  const double c = force.dot(displacement_) / square;
  const Vec3 rest = force - c * displacement_;
  double total = 0;
  for (std::size_t i = 0; i < count_; ++i) total += pressing_[i].multiplier;
  if (!(total > 0)) return {};
  WorkDone done;
  for (std::size_t i = 0; i < count_; ++i) {
    const Pressing& before = pressing_[i];
    const auto now = std::find_if(surfaces.begin(), surfaces.end(), [&](const Surface& surface) {
      return surface.body == before.body && surface.generation == before.generation &&
             surface.feature == before.feature;
    });
    if (now == surfaces.end()) continue;
    const double along_normal = c * before.multiplier * (before.height - HeightAbove(*now, proxy_));
    const double along_surface = before.multiplier / total * elapsed_s * rest.dot(now->velocity);
    done.all += along_normal + along_surface;
    if (!now->fixed && !now->copied) done.split += along_normal + along_surface;
  }
  return done;
}

void SurfaceMotion::Remember(std::span<const Surface> surfaces,
                             const ContactSolution& contact) noexcept {
  count_ = 0;
  for (std::size_t i = 0; i < std::min(surfaces.size(), kMaxContactPlanes); ++i) {
    if (!(contact.multiplier[i] > 0)) continue;
    const Surface& surface = surfaces[i];
    pressing_[count_++] = {.body = surface.body,
                           .generation = surface.generation,
                           .feature = surface.feature,
                           .multiplier = contact.multiplier[i],
                           .height = HeightAbove(surface, contact.proxy)};
  }
  proxy_ = contact.proxy;
  displacement_ = contact.displacement;
}

}  // namespace rikiseki::haptic
