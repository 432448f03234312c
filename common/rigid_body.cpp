// SPDX-License-Identifier: MIT
#include "common/rigid_body.h"

#include <algorithm>
#include <cmath>

namespace rikiseki {
namespace {

constexpr double kIsotropy = 1e-12;    // relative
constexpr double kSlip = 1e-6;         // m/s: slower is called sticking
constexpr double kSameNormal = 1e-12;  // squared sine: what is left of a normal after projection

}  // namespace

BodyInertia BodyInertia::Of(double mass_kg, const Mat3& inertia_B) {
  BodyInertia result;
  result.mass_kg = mass_kg;
  result.inertia_B = inertia_B;
  result.inverse_B = inertia_B.inverse();
  const double largest = inertia_B.diagonal().maxCoeff();
  const Mat3 deviation = inertia_B - largest * Mat3::Identity();
  result.isotropic = deviation.cwiseAbs().maxCoeff() <= kIsotropy * largest;
  return result;
}

Mat3 BodyInertia::InverseInertia(const Quat& q_WB) const {
  if (isotropic) return inverse_B;
  const Mat3 rotation = q_WB.toRotationMatrix();
  return rotation * inverse_B * rotation.transpose();
}

void ApplyImpulse(const BodyInertia& inertia, const Vec3& impulse_ns,
                  const Vec3& angular_impulse_nms, BodyState& state) noexcept {
  state.velocity += impulse_ns / inertia.mass_kg;
  state.angular_velocity += inertia.InverseInertia(state.pose.orientation) * angular_impulse_nms;
}

void PushingContacts::Add(const Vec3& normal, double slip_speed) noexcept {
  slips_ = slips_ || slip_speed > kSlip;
  Vec3 rest = normal;
  for (std::size_t i = 0; i < rank_; ++i) rest -= rest.dot(basis_[i]) * basis_[i];
  if (rank_ < 3 && rest.squaredNorm() > kSameNormal) basis_[rank_++] = rest.normalized();
}

Vec3 PushingContacts::HalfAct(const Vec3& dv) const noexcept {
  return Sticks() ? Vec3(Vec3::Zero()) : Along(dv);
}

Vec3 PushingContacts::Along(const Vec3& v) const noexcept {
  Vec3 rest = v;
  for (std::size_t i = 0; i < rank_; ++i) rest -= rest.dot(basis_[i]) * basis_[i];
  return rest;
}

Quat Turned(const Quat& q, const Vec3& rotation) noexcept {
  const double angle = rotation.norm();
  // sin(a/2)/a, whose series at 0 is 1/2 - a^2/48.
  const double scale = angle > 1e-4 ? std::sin(angle / 2) / angle : 0.5 - angle * angle / 48;
  const Vec3 axis = scale * rotation;
  return (Quat(std::cos(angle / 2), axis.x(), axis.y(), axis.z()) * q).normalized();
}

void AdvanceRotation(const BodyInertia& inertia, double step_s, BodyState& state) noexcept {
  const Vec3& w = state.angular_velocity;
  if (w.isZero(0)) return;
  const Quat q = state.pose.orientation;
  if (inertia.isotropic) {
    state.pose.orientation = Turned(q, step_s * w);
    return;
  }
  const Vec3 momentum = q * (inertia.inertia_B * (q.conjugate() * w));
  const auto velocity_at = [&](const Quat& attitude) -> Vec3 {
    return attitude * (inertia.inverse_B * (attitude.conjugate() * momentum));
  };
  Vec3 middle = w;
  for (int i = 0; i < 6; ++i) {
    const Vec3 next = velocity_at(Turned(q, step_s / 2 * middle));
    const bool settled = (next - middle).squaredNorm() <= 1e-28 * next.squaredNorm();
    middle = next;
    if (settled) break;
  }
  state.pose.orientation = Turned(q, step_s * middle);
  state.angular_velocity = velocity_at(state.pose.orientation);
}

}  // namespace rikiseki
