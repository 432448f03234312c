// SPDX-License-Identifier: MIT
// The spring and damper between the finger and its proxy, shared out over the bodies that push.
// Paper 3.3; numerics 1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/friction.h"
#include "haptic_server/render/surface.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

inline constexpr std::size_t kMaxShares = 2 * kMaxContactPlanes;

/// The contact law of one pointer. For body b with e_b = sum of its multiplier_i * normal_i, so
/// that the e_b add up to e = D - C:  f_b = sum of k_i multiplier_i normal_i + d_b (e_b - e_b of
/// the tick before)/T. With equal k and d this is the paper's f = k e + d (e - e_before)/T, split
/// without remainder. A surface that fades is as much weaker. Without `adhesion` a body only
/// pushes: f_b is dropped where f_b . e_b <= 0, and when the finger is free. Where surfaces have
/// friction, the tangential force of friction.h is part of the share; where they have none, it costs
/// and changes nothing.
class SurfaceForce {
 public:
  SurfaceForce(const RenderSettings& settings, double period_s);

  /// `elapsed_ticks` is 1, or more after missed deadlines: the difference quotient runs over that
  /// many *nominal* periods, so that jitter of the wake-up does not become jitter of the force. //
  /// RT:
  std::span<BodyShare> Update(std::span<const Surface> surfaces, const ContactSolution& contact,
                              double radius, std::int64_t elapsed_ticks) noexcept;

  /// Other stiffness and damping of surfaces that bring none of their own, and of friction. // RT:
  void Tune(const RenderSettings& settings) noexcept {
    stiffness_ = settings.stiffness_n_per_m;
    damping_ = settings.damping_ns_per_m;
    friction_.SetStiffness(settings.friction_stiffness_n_per_m);
  }

  /// The finger is free, whatever came before. // RT:
  void Reset() noexcept {
    count_ = 0;
    stored_ = 0;
    friction_.Reset();
  }

  /// What the springs hold [J], as of the last Update. // RT:
  double stored() const noexcept { return stored_; }

 private:
  struct BodyContact {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
    bool fixed = false;
    double stiffness = 0;
    double damping = 0;
    Vec3 displacement = Vec3::Zero();  // e_b
    Vec3 spring = Vec3::Zero();        // N
    Vec3 point = Vec3::Zero();
    double weight = 0;
    // Of surfaces with friction, weighted like the damping.
    double static_friction = 0;
    double dynamic_friction = 0;
    Vec3 velocity = Vec3::Zero();  // m/s, of the material
    double rough_weight = 0;
  };

  Vec3 FrictionOf(const BodyContact& body, const Vec3& force, const Vec3& way,
                  double elapsed_s) noexcept;
  static BodyShare ShareOf(const BodyContact& body, const Vec3& force) noexcept;

  double stiffness_;
  double damping_;
  bool adhesion_;
  double period_s_;
  Friction friction_;
  Vec3 finger_ = Vec3::Zero();  // m, centre, in the tick before
  double stored_ = 0;
  // Of this tick and the one before, which change places: they are large, and few are used.
  using Contacts = std::array<BodyContact, kMaxContactPlanes>;
  std::array<Contacts, 2> contacts_;
  std::size_t newest_ = 0;
  std::size_t count_ = 0;  // of the tick before
  std::array<BodyShare, kMaxShares> shares_;
};

}  // namespace rikiseki::haptic
