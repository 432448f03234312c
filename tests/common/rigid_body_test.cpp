// SPDX-License-Identifier: MIT
#include "common/rigid_body.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace rikiseki {
namespace {

const Quat kTilted = Quat(0.2, -0.4, 0.1, 0.9).normalized();

Mat3 PlateInertia() {
  const Mat3 axes = Quat(0.5, 0.1, -0.7, 0.3).normalized().toRotationMatrix();
  return axes * Vec3(0.010, 0.007, 0.004).asDiagonal() * axes.transpose();
}

Vec3 AngularMomentum(const BodyInertia& inertia, const BodyState& state) {
  const Mat3 axes = state.pose.orientation.toRotationMatrix();
  return axes * inertia.inertia_B * axes.transpose() * state.angular_velocity;
}

BodyState Tumbled(const BodyInertia& inertia, double seconds, int steps) {
  BodyState state{.pose = {.orientation = kTilted}, .angular_velocity = Vec3(1, 5, -2)};
  for (int i = 0; i < steps; ++i) AdvanceRotation(inertia, seconds / steps, state);
  return state;
}

}  // namespace

TEST_CASE("a kick gives J/m and the spin that the inertia in world axes says") {
  const BodyInertia inertia = BodyInertia::Of(0.7, PlateInertia());
  BodyState state{.pose = {.orientation = kTilted}, .velocity = Vec3(1, 2, 3)};
  const Vec3 angular_impulse(0.002, 0.001, -0.003);
  ApplyImpulse(inertia, {0.3, -0.1, 0.05}, angular_impulse, state);
  CHECK((state.velocity - Vec3(1, 2, 3) - Vec3(0.3, -0.1, 0.05) / 0.7).norm() < 1e-15);
  CHECK((AngularMomentum(inertia, state) - angular_impulse).norm() < 1e-15);
}

TEST_CASE("only equal moments about all axes are isotropic") {
  CHECK(BodyInertia::Of(1, 0.3 * Mat3::Identity()).isotropic);
  CHECK_FALSE(BodyInertia::Of(1, PlateInertia()).isotropic);
  CHECK_FALSE(BodyInertia::Of(1, Vec3(1, 1, 1 + 1e-9).asDiagonal()).isotropic);
  Mat3 product = Mat3::Identity();
  product(0, 1) = product(1, 0) = 1e-9;
  CHECK_FALSE(BodyInertia::Of(1, product).isotropic);
}

TEST_CASE("a turn is the exponential map, for tiny angles as well") {
  const Vec3 axis = Vec3(1, -2, 0.5).normalized();
  for (const double angle : {0.0, 1e-300, 1e-9, 0.99e-4, 1.01e-4, 0.5, 3.1, 7.0}) {
    const Quat exact = Quat(Eigen::AngleAxisd(angle, axis)) * kTilted;
    CHECK((Turned(kTilted, angle * axis).coeffs() - exact.coeffs()).norm() < 1e-15);
  }
}

TEST_CASE("a body with equal moments turns exactly, whatever the step") {
  const BodyInertia inertia = BodyInertia::Of(1, 0.02 * Mat3::Identity());
  const Vec3 spin(1, 5, -2);
  const Quat exact = Quat(Eigen::AngleAxisd(spin.norm(), spin.normalized())) * kTilted;
  for (const int steps : {1, 100, 1000}) {
    const BodyState state = Tumbled(inertia, 1, steps);
    CHECK(state.pose.orientation.angularDistance(exact) < 1e-12);
    CHECK((state.angular_velocity - spin).norm() == 0);
  }
}

TEST_CASE("a tumbling plate keeps its angular momentum and energy") {
  const BodyInertia inertia = BodyInertia::Of(1, PlateInertia());
  BodyState state{.pose = {.orientation = kTilted}, .angular_velocity = Vec3(1, 5, -2)};
  const Vec3 momentum = AngularMomentum(inertia, state);
  const double energy = state.angular_velocity.dot(momentum);
  for (int i = 0; i < 1000; ++i) {
    AdvanceRotation(inertia, 1e-3, state);
    REQUIRE((AngularMomentum(inertia, state) - momentum).norm() < 1e-12 * momentum.norm());
    REQUIRE(std::abs(state.angular_velocity.dot(momentum) - energy) < 1e-6 * energy);
  }
}

TEST_CASE("the attitude of a tumbling plate converges with the square of the step") {
  const BodyInertia inertia = BodyInertia::Of(1, PlateInertia());
  const Quat truth = Tumbled(inertia, 1, 32000).pose.orientation;
  const double coarse = Tumbled(inertia, 1, 500).pose.orientation.angularDistance(truth);
  const double fine = Tumbled(inertia, 1, 1000).pose.orientation.angularDistance(truth);
  CHECK(fine < 1e-3);
  CHECK(coarse / fine == Approx(4).margin(0.3));
}

TEST_CASE("half of a velocity change acts where no contact forbids it") {
  const Vec3 change(1, 2, 4);
  PushingContacts none;
  CHECK(none.HalfAct(change) == change);

  PushingContacts sticking;
  sticking.Add(Vec3::UnitZ(), 0.5e-6);
  CHECK(sticking.HalfAct(change) == Vec3::Zero());

  PushingContacts sliding;  // four corners on one floor, one of them slips
  for (const double slip : {0.0, 0.0, 0.1, 0.0}) sliding.Add(Vec3::UnitZ(), slip);
  CHECK((sliding.HalfAct(change) - Vec3(1, 2, 0)).norm() < 1e-15);

  PushingContacts groove;
  groove.Add(Vec3(0, 0.6, 0.8), 0.1);
  groove.Add(Vec3(0, -0.6, 0.8), 0.1);
  CHECK((groove.HalfAct(change) - Vec3(1, 0, 0)).norm() < 1e-15);

  PushingContacts corner = groove;
  corner.Add(Vec3(0.6, 0, 0.8), 0.1);
  corner.Add(Vec3(-0.6, 0, 0.8), 0.1);
  CHECK(corner.HalfAct(change).norm() < 1e-15);
}

}  // namespace rikiseki
