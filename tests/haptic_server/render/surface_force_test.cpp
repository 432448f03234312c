// SPDX-License-Identifier: MIT
#include "haptic_server/render/surface_force.h"

#include <catch2/catch.hpp>
#include <random>

#include "haptic_server/render/feature_track.h"

namespace rikiseki::haptic {
namespace {

constexpr double kPeriod = 1e-3;

RenderSettings Settings(double stiffness, double damping, bool adhesion) {
  RenderSettings settings;
  settings.stiffness_n_per_m = stiffness;
  settings.damping_ns_per_m = damping;
  settings.adhesion = adhesion;
  return settings;
}

Surface SurfaceOf(std::uint32_t body, const Vec3& point, const Vec3& normal) {
  Surface surface;
  surface.body = body;
  surface.plane = {point, normal.normalized()};
  return surface;
}

struct Touch {
  std::vector<Surface> surfaces;
  ContactSolution contact;
};

Touch TouchAt(const Vec3& finger, const std::vector<Surface>& surfaces, double radius = 0) {
  std::vector<HalfSpace> planes;
  for (const Surface& surface : surfaces) planes.push_back(surface.plane);
  return {surfaces, SolveContact(finger, radius, planes)};
}

Vec3 Total(std::span<const BodyShare> shares) {
  Vec3 total = Vec3::Zero();
  for (const BodyShare& share : shares) total += share.force;
  return total;
}

TEST_CASE("the force on one wall is the paper's spring and damper") {
  SurfaceForce law(Settings(2000, 3, true), kPeriod);
  const Surface wall = SurfaceOf(1, Vec3::Zero(), -Vec3::UnitX());  // free at x < 0
  double before = 0;
  double impulse = 0;
  double spring_impulse = 0;
  for (const double depth : {-0.001, 0.001, 0.003, 0.002, 0.0005, -0.001, -0.001}) {
    const Touch touch = TouchAt(Vec3(depth, 0, 0), {wall});
    const Vec3 force = Total(law.Update(touch.surfaces, touch.contact, 0, 1));
    const double e = std::max(depth, 0.0);
    REQUIRE(force.x() == Approx(-(2000 * e + 3 * (e - before) / kPeriod)).margin(1e-12));
    impulse += force.x() * kPeriod;
    spring_impulse -= 2000 * e * kPeriod;
    before = e;
  }
  REQUIRE(impulse == Approx(spring_impulse));  // the literal damper telescopes to nothing
}

TEST_CASE("without adhesion a surface never pulls") {
  SurfaceForce law(Settings(2000, 30, false), kPeriod);
  const Surface wall = SurfaceOf(1, Vec3::Zero(), -Vec3::UnitX());
  bool would_pull = false;
  double before = 0;
  for (int k = 0; k < 200; ++k) {
    const double depth = 0.003 * std::sin(0.1 * k);
    const double e = std::max(depth, 0.0);
    const double literal = 2000 * e + 30 * (e - before) / kPeriod;
    const Touch touch = TouchAt(Vec3(depth, 0, 0), {wall});
    const Vec3 force = Total(law.Update(touch.surfaces, touch.contact, 0, 1));
    REQUIRE(-force.x() == Approx(std::max(literal, 0.0)).margin(1e-12));
    would_pull = would_pull || literal < -1;
    before = e;
  }
  REQUIRE(would_pull);
}

TEST_CASE("with equal surfaces the shares add up to k e + d de/T, each normal to its body") {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss(0, 1);
  SurfaceForce law(Settings(1500, 4, true), kPeriod);
  Vec3 before = Vec3::Zero();
  std::vector<Surface> surfaces;
  for (std::uint32_t body = 0; body < 3; ++body) {
    surfaces.push_back(SurfaceOf(body, Vec3::Zero(), Vec3(gauss(random), 2, gauss(random))));
  }
  int several = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vec3 finger =
        0.01 * Vec3(std::sin(0.13 * k), std::sin(0.05 * k) - 0.7, std::sin(0.07 * k));
    const Touch touch = TouchAt(finger, surfaces, 0.002);
    const auto shares = law.Update(touch.surfaces, touch.contact, 0.002, 1);
    several += shares.size() > 1 ? 1 : 0;
    const Vec3 e = touch.contact.displacement;
    REQUIRE((Total(shares) - (1500 * e + 4 * (e - before) / kPeriod)).norm() < 1e-9);
    before = e;
    for (const BodyShare& share : shares) {  // the impulse acts on the sphere's skin
      if (touch.contact.multiplier[share.body] > 0) {
        REQUIRE((share.point - touch.contact.proxy).norm() == Approx(0.002));
      }
    }
  }
  REQUIRE(several > 100);
}

TEST_CASE("a surface may bring its own stiffness and damping") {
  SurfaceForce law(Settings(2000, 3, true), kPeriod);
  Surface wall = SurfaceOf(1, Vec3::Zero(), -Vec3::UnitX());
  wall.stiffness = 500;
  wall.damping = 1;
  const Touch touch = TouchAt(Vec3(0.002, 0, 0), {wall});
  REQUIRE(Total(law.Update(touch.surfaces, touch.contact, 0, 1)).x() == Approx(-(1 + 2)));
  REQUIRE(Total(law.Update(touch.surfaces, touch.contact, 0, 1)).x() == Approx(-1));
}

TEST_CASE("after missed deadlines the difference runs over the time that passed") {
  SurfaceForce law(Settings(0, 3, true), kPeriod);
  const Surface wall = SurfaceOf(1, Vec3::Zero(), -Vec3::UnitX());
  const Touch touch = TouchAt(Vec3(0.002, 0, 0), {wall});
  REQUIRE(Total(law.Update(touch.surfaces, touch.contact, 0, 4)).x() == Approx(-3 * 0.002 / 4e-3));
}

TEST_CASE("a feature that changes on a touched body does not kick the damper") {
  SurfaceForce law(Settings(2000, 3, false), kPeriod);
  const Surface wall = SurfaceOf(1, Vec3::Zero(), -Vec3::UnitX());
  Touch touch = TouchAt(Vec3(0.002, 0, 0), {wall});
  law.Update(touch.surfaces, touch.contact, 0, 1);
  // Another plane of the same body takes over at the same depth.
  const Surface other = SurfaceOf(1, Vec3(0, 1, 0), -Vec3::UnitX());
  touch = TouchAt(Vec3(0.002, 0, 0), {other});
  REQUIRE(Total(law.Update(touch.surfaces, touch.contact, 0, 1)).x() == Approx(-4));
}

}  // namespace
}  // namespace rikiseki::haptic
