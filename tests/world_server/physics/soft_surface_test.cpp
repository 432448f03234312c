// SPDX-License-Identifier: MIT
// What a finger meets of a soft body: pushes that arrive whole, and a compliance that is the body's.
#include "world_server/physics/soft_surface.h"

#include <catch2/catch.hpp>
#include <random>

#include "world_server/features/nearest_point.h"

namespace rikiseki::world {
namespace {

using NodeVectors = SoftBody::NodeVectors;

const Vec3 kHalf(0.04, 0.04, 0.03);
constexpr double kEdge = 0.01;

SoftBody Block(double youngs_modulus_pa, double edge = kEdge) {
  const TetrahedralMesh mesh = MeshBox(kHalf, edge);
  std::vector<std::uint8_t> held;
  for (const Vec3& node : mesh.nodes) held.push_back(node.z() < -kHalf.z() + 1e-9 ? 1 : 0);
  return {mesh,
          {.youngs_modulus_pa = youngs_modulus_pa, .poisson_ratio = 0.3, .relaxation_s = 0.02},
          0.4,
          held,
          Vec3::Zero()};
}

NodeVectors None(const SoftBody& body) {
  return NodeVectors::Zero(3, body.positions().cols());
}

struct Wrench {
  Vec3 impulse, moment;
};

Wrench Sum(const SoftBody& body, const NodeVectors& impulses) {
  Wrench sum{impulses.rowwise().sum(), Vec3::Zero()};
  for (Eigen::Index i = 0; i < impulses.cols(); ++i) {
    sum.moment += Vec3(body.positions().col(i)).cross(Vec3(impulses.col(i)));
  }
  return sum;
}

}  // namespace

TEST_CASE("node impulses add up to the impulse and its moment, however deformed the body is") {
  SoftBody body = Block(1e4);
  const SoftSurface surface(body);
  std::mt19937 random(3);
  const auto number = [&] { return static_cast<double>(random() % 2001) / 1000 - 1; };
  for (int i = 0; i < 200; ++i) {
    Vec3 impulse(number(), number(), number());
    // Pushes on the top, some of them beside the body, some with a couple that no line has.
    const Vec3 point(0.05 * number(), 0.05 * number(), kHalf.z());
    Vec3 moment = point.cross(impulse);
    if (i % 3 == 0) moment += 0.01 * Vec3(number(), number(), number());
    if (i % 7 == 0) impulse.setZero();
    NodeVectors impulses = None(body);
    surface.Spread(impulse, moment, impulses);
    const Wrench sum = Sum(body, impulses);
    // Some hundred terms of the size of the impulse, each rounded.
    REQUIRE((sum.impulse - impulse).norm() < 1e-12 * (impulse.norm() + 1));
    REQUIRE((sum.moment - moment).norm() < 1e-12 * (moment.norm() + 1));
    body.Push(0.02 * impulses);
    body.Step(0.01);
  }
  CHECK((body.positions() - body.unloaded()).cwiseAbs().maxCoeff() > 1e-3);  // deformed it was
}

TEST_CASE("a push reaches the nodes under its line of action and no others") {
  const SoftBody body = Block(1e4);
  const SoftSurface surface(body);
  const Vec3 point(0.012, -0.007, kHalf.z()), impulse(0, 0, -1);
  NodeVectors impulses = None(body);
  surface.Spread(impulse, point.cross(impulse), impulses);
  int pushed = 0;
  for (Eigen::Index i = 0; i < impulses.cols(); ++i) {
    if (impulses.col(i).isZero(0)) continue;
    ++pushed;
    CHECK(body.positions()(2, i) == kHalf.z());
    CHECK((Vec3(body.positions().col(i)) - point).norm() < 0.03);
  }
  CHECK(pushed >= 3);
  CHECK(pushed < 30);
}

TEST_CASE(
    "the compliance is that of the surface under the pad, and smooth under a sliding finger") {
  const SoftBody body = Block(1e4);
  const SoftSurface surface(body);
  double least = 1e9, most = 0, last = 0;
  for (double x = -0.015; x <= 0.015; x += 0.0005) {
    const Vec3 point(x, 0.003, kHalf.z());
    const SoftSurface::Yield yield = surface.YieldAt(point, Vec3::UnitZ());
    CHECK(yield.inverse_mass > 1 / 0.4);  // less than all of it yields at once
    least = std::min(least, yield.compliance_m_per_n);
    most = std::max(most, yield.compliance_m_per_n);
    // In no step of half a millimetre does it change by a hundredth.
    if (last > 0) CHECK(yield.compliance_m_per_n == Approx(last).epsilon(0.01));
    last = yield.compliance_m_per_n;
  }
  CHECK(most / least < 1.08);
  // A rigid punch as wide as the pad on a half-space gives (1 - nu^2) / (2 a E), a = 10..20 mm.
  CHECK(least > 0.91 / (2 * 0.02 * 1e4));
  CHECK(most < 0.91 / (2 * 0.01 * 1e4));
}

TEST_CASE("two springs in series, and a damper that is never more than the finger's own") {
  // 2000 N/m before 500 N/m are 400; a fifth of a slow push goes into the first.
  const SoftSurface::Yield bare{.compliance_m_per_n = 0.002};
  const auto felt = SoftSurface::InSeries({2000, 2}, bare);
  CHECK(felt.stiffness_n_per_m == Approx(400));
  CHECK(felt.damping_ns_per_m == Approx(2 * 0.2 * 0.2));
  // 1 ms of 500 N/m are a damper of 0.5 N s/m, and four fifths of the push go into it.
  const SoftSurface::Yield slack{.compliance_m_per_n = 0.002, .relaxation_s = 1e-3};
  CHECK(SoftSurface::InSeries({2000, 2}, slack).damping_ns_per_m ==
        Approx(2 * 0.2 * 0.2 + 0.5 * 0.8 * 0.8));
  const SoftSurface::Yield pitch{.compliance_m_per_n = 0.002, .relaxation_s = 10};
  CHECK(SoftSurface::InSeries({2000, 2}, pitch).damping_ns_per_m == 2);
  CHECK(SoftSurface::InSeries({0, 2}, bare).stiffness_n_per_m == Approx(500));
}

TEST_CASE(
    "a steady push moves the surface by compliance times force, and the finger is told back") {
  SoftBody body = Block(1e4);
  const SoftSurface surface(body);
  const Vec3 point(0.003, 0.004, kHalf.z()), force(0, 0, -0.02);
  for (int i = 0; i < 200; ++i) {
    NodeVectors impulses = None(body);
    surface.Spread(0.01 * force, point.cross(0.01 * force), impulses);
    body.Push(impulses);
    body.Step(0.01);
  }
  NodeVectors weights = None(body);
  surface.Spread(-Vec3::UnitZ(), -point.cross(Vec3::UnitZ()), weights);
  const double way = weights.cwiseProduct(body.positions() - body.unloaded()).sum();
  const double compliance = surface.YieldAt(point, Vec3::UnitZ()).compliance_m_per_n;
  // 0.1 mm: as small that the law is linear to a hundredth.
  CHECK(way == Approx(compliance * force.norm()).epsilon(0.01));
  CHECK(way > 5e-5);

  // The nearest point of the dent goes back to where it was.
  const Vec3 over = point + Vec3(0, 0, 0.005);
  const Vec3 told = surface.WithoutDisplacement(over);
  CHECK(told.z() > over.z() + 0.5 * way);
  CHECK((told - over).head<2>().norm() < 0.2 * way);
  CHECK(FindNearestPoint(surface.unloaded(), told).normal.z() == Approx(1));
}

TEST_CASE("of a body at rest nothing is taken back, near and far, inside and outside") {
  const SoftBody body = Block(1e4);
  const SoftSurface surface(body);
  for (const Vec3& p : {Vec3(0, 0, 0.05), Vec3(0.01, 0.02, 0.02), Vec3(1, 2, 3), Vec3(0, 0, 0)}) {
    CHECK((surface.WithoutDisplacement(p) - p).norm() < 1e-15 * (1 + p.norm()));
  }
}

}  // namespace rikiseki::world
