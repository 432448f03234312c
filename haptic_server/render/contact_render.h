// SPDX-License-Identifier: MIT
// From the finger's place to each body's share of the force: feature track -> contact solve -> surface
// force, for one pointer, with what the energy meter must know of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/feature_track.h"
#include "haptic_server/render/ledger.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/render/surface_force.h"
#include "haptic_server/render/surface_motion.h"

namespace rikiseki::haptic {

/// The sum of the shares' forces [N].
Vec3 Sum(std::span<const BodyShare> shares) noexcept;

class ContactRender {
 public:
  ContactRender(const RenderSettings& settings, std::uint32_t pointer, double period_s);

  /// Where the finger is in this tick.
  struct Finger {
    std::uint64_t tick = 0;
    Vec3 position = Vec3::Zero();    // m, centre, in W
    Vec3 displayed = Vec3::Zero();   // N, in W, of the tick before
    std::int64_t elapsed_ticks = 1;  // since then; more than 1 after missed deadlines
  };

  /// The force wanted [N, on the user, W], body by body; valid until the next call. Bodies that can move
  /// and find no free channel in `ledger` are left out, and `no_channel` says so. // RT:
  std::span<const BodyShare> Update(const Finger& finger, FeatureTrack& track, LocalBodies& copies,
                                    Ledger& ledger, bool& no_channel) noexcept;

  /// Other stiffness and damping from the next Update on. // RT:
  void Tune(const RenderSettings& settings) noexcept { surface_force_.Tune(settings); }

  /// There is no contact in this tick. // RT:
  void Reset() noexcept;

  double radius() const noexcept { return radius_; }            // m, of the finger
  double penetration() const noexcept { return penetration_; }  // m, |e| of the newest tick
  /// Of the displayed surfaces on the hand, since the tick before [J].
  const SurfaceMotion::WorkDone& surface_work() const noexcept { return surface_work_; }
  double stored() const noexcept { return stored_; }  // J, in the rendered springs

 private:
  std::uint32_t pointer_;
  double radius_;
  double period_s_;
  SurfaceForce surface_force_;
  SurfaceMotion surface_motion_;
  double penetration_ = 0;
  SurfaceMotion::WorkDone surface_work_;
  double stored_ = 0;
  std::array<HalfSpace, kMaxContactPlanes> planes_;
  std::array<BodyShare, kMaxShares> shares_;
};

}  // namespace rikiseki::haptic
