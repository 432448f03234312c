// SPDX-License-Identifier: MIT
#include "world_server/features/nearest_point.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace rikiseki::world {
namespace {

constexpr double kPi = 3.14159265358979323846;

// > 0 outside, < 0 inside, 0 on the surface; not the distance. Written independently of the code
// under test, from the shapes' definitions; each is in units of length near the surface.
double Implicit(const Shape& shape, const Vec3& p) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    return (p.cwiseAbs() - box->half_extents).maxCoeff();
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return p.norm() - sphere->radius;
  if (const auto* half = std::get_if<HalfSpace>(&shape)) return half->normal.dot(p);
  if (const auto* c = std::get_if<Cylinder>(&shape)) {
    return std::max(std::hypot(p.x(), p.y()) - c->radius, std::abs(p.z()) - c->half_length);
  }
  if (const auto* c = std::get_if<Capsule>(&shape)) {
    const double beyond = std::max(std::abs(p.z()) - c->half_length, 0.0);
    return std::sqrt(p.x() * p.x() + p.y() * p.y() + beyond * beyond) - c->radius;
  }
  const auto& e = std::get<Ellipsoid>(shape);
  return (p.cwiseQuotient(e.radii).norm() - 1) * e.radii.minCoeff();
}

// Points on the surface by casting rays from the centre: every shape here is star-shaped about it.
std::vector<Vec3> Surface(const Shape& shape, int count, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::vector<Vec3> points;
  while (static_cast<int>(points.size()) < count) {
    const Vec3 direction = Vec3(normal(random), normal(random), normal(random)).normalized();
    double low = 0, high = 10;
    for (int i = 0; i < 70; ++i) {
      const double middle = (low + high) / 2;
      (Implicit(shape, middle * direction) < 0 ? low : high) = middle;
    }
    points.push_back(low * direction);
  }
  return points;
}

std::vector<Shape> RoundedShapes() {
  return {Box{{0.03, 0.05, 0.08}},       Box{{0.5, 0.5, 0.01}},         Sphere{0.04},
          Cylinder{0.03, 0.05},          Cylinder{0.2, 0.01},           Capsule{0.02, 0.06},
          Ellipsoid{{0.03, 0.05, 0.08}}, Ellipsoid{{0.05, 0.05, 0.02}}, Ellipsoid{{0.02, 0.3, 0.3}},
          Ellipsoid{{0.04, 0.04, 0.04}}};
}

void RequireConsistent(const Shape& shape, const Vec3& p) {
  const NearestPoint nearest = FindNearestPoint(shape, p);
  CAPTURE(shape.index(), p.transpose(), nearest.point.transpose(), nearest.distance);
  const double scale = 1 + p.norm();
  REQUIRE(nearest.normal.norm() == Approx(1).epsilon(1e-14));
  REQUIRE(std::abs(Implicit(shape, nearest.point)) <= 1e-12 * scale);
  REQUIRE((nearest.point + nearest.distance * nearest.normal - p).norm() <= 1e-12 * scale);
  const double implicit = Implicit(shape, p);
  if (std::abs(implicit) > 1e-13 * scale) REQUIRE((nearest.distance > 0) == (implicit > 0));
}

}  // namespace

TEST_CASE("the foot is on the surface, along the normal, and no sample is nearer") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Shape& shape : RoundedShapes()) {
    const std::vector<Vec3> samples = Surface(shape, 4000, random);
    double size = 0;
    for (const Vec3& sample : samples) size = std::max(size, sample.norm());
    for (int probe = 0; probe < 150; ++probe) {
      // Inside and out, and close to the surface on both sides.
      Vec3 p = 1.5 * size * Vec3(uniform(random), uniform(random), uniform(random));
      if (probe % 3 == 0) {
        p = samples[static_cast<std::size_t>(probe)] *
            (1 + std::pow(10.0, -(probe % 13)) * uniform(random));
      }
      RequireConsistent(shape, p);
      double nearest_sample = 1e9;
      for (const Vec3& sample : samples)
        nearest_sample = std::min(nearest_sample, (p - sample).norm());
      const double distance = std::abs(FindNearestPoint(shape, p).distance);
      REQUIRE(distance <= nearest_sample + 1e-12);
      // 4000 rays meet the surface no more than about a quarter of its size apart.
      REQUIRE(nearest_sample <= distance + 0.25 * size);
    }
  }
}

TEST_CASE("a step along the normal of an outside point changes the distance by just that step") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  for (const Shape& shape : RoundedShapes()) {
    for (int probe = 0; probe < 200; ++probe) {
      const Vec3 p(uniform(random), uniform(random), uniform(random));
      const NearestPoint nearest = FindNearestPoint(shape, p);
      if (nearest.distance < 0) continue;
      const NearestPoint beyond = FindNearestPoint(shape, p + 0.01 * nearest.normal);
      REQUIRE(beyond.distance - nearest.distance == Approx(0.01).epsilon(1e-10));
      REQUIRE((beyond.point - nearest.point).norm() < 1e-11);
    }
  }
}

TEST_CASE("closed forms") {
  const Box box{{1, 2, 3}};
  CHECK(FindNearestPoint(box, {4, 0.5, 0.5}).distance == 3);
  CHECK(FindNearestPoint(box, {4, 6, 3}).distance == 5);  // an edge: 3, 4, 5
  CHECK(FindNearestPoint(box, {0.75, 0.5, 0.5}).distance == -0.25);
  CHECK(FindNearestPoint(box, {-0.75, 0.5, 0.5}).normal == Vec3(-1, 0, 0));
  CHECK(FindNearestPoint(Sphere{2}, {0, 0, -5}).distance == 3);
  CHECK(FindNearestPoint(Sphere{2}, {0, 1.5, 0}).distance == -0.5);
  const HalfSpace half{Vec3(0, 0.6, 0.8)};
  CHECK(FindNearestPoint(half, {7, 0, 5}).distance == Approx(4).epsilon(1e-15));
  CHECK(FindNearestPoint(half, {7, 0, -5}).distance == Approx(-4).epsilon(1e-15));
  CHECK(FindNearestPoint(half, {7, 0, -5}).normal == half.normal);
  const Cylinder cylinder{1, 2};
  CHECK(FindNearestPoint(cylinder, {4, 0, 6}).distance == 5);  // the rim
  CHECK(FindNearestPoint(cylinder, {0, 0.75, 0}).distance == -0.25);
  CHECK(FindNearestPoint(cylinder, {0.25, 0, 1.5}).normal == Vec3(0, 0, 1));
  const Capsule capsule{1, 2};
  CHECK(FindNearestPoint(capsule, {3, 0, 6}).distance == 4);
  CHECK(FindNearestPoint(capsule, {0.5, 0, 1}).distance == -0.5);
  const Ellipsoid ellipsoid{{3, 2, 1}};
  CHECK(FindNearestPoint(ellipsoid, {5, 0, 0}).distance == Approx(2).epsilon(1e-14));
  CHECK(FindNearestPoint(ellipsoid, {0, 0, 0.5}).distance == Approx(-0.5).epsilon(1e-14));
}

TEST_CASE("where the normal is not unique it is said, and the choice is finite and repeatable") {
  const std::vector<std::pair<Shape, Vec3>> cases = {{Sphere{1}, Vec3::Zero()},
                                                     {Box{{1, 1, 1}}, Vec3::Zero()},
                                                     {Box{{1, 2, 3}}, Vec3(0, 1, 0)},
                                                     {Box{{1, 1, 3}}, Vec3(0.5, 0.5, 0)},
                                                     {Capsule{1, 2}, Vec3(0, 0, 1)},
                                                     {Capsule{1, 2}, Vec3(0, 0, 2)},
                                                     {Cylinder{1, 3}, Vec3(0, 0, 0)},
                                                     {Cylinder{3, 1}, Vec3(0.5, 0, 0)},
                                                     {Ellipsoid{{3, 2, 1}}, Vec3(0.5, 0.5, 0)},
                                                     {Ellipsoid{{2, 2, 2}}, Vec3::Zero()},
                                                     {Ellipsoid{{3, 1, 1}}, Vec3(0.5, 0, 0)}};
  for (const auto& [shape, p] : cases) {
    CAPTURE(shape.index(), p.transpose());
    RequireConsistent(shape, p);
    CHECK(FindNearestPoint(shape, p).degenerate);
    CHECK(FindNearestPoint(shape, p).normal == FindNearestPoint(shape, p).normal);
  }
  CHECK_FALSE(FindNearestPoint(Sphere{1}, {0.5, 0, 0}).degenerate);
  CHECK_FALSE(FindNearestPoint(Box{{1, 2, 3}}, {0.5, 0.2, 0}).degenerate);
  CHECK_FALSE(FindNearestPoint(Ellipsoid{{3, 2, 1}}, {2.99, 0, 0}).degenerate);
}

TEST_CASE("extreme points: denormal penetration, and a finger at 1e8 m") {
  for (const Shape& shape : RoundedShapes()) {
    for (const Vec3& p :
         {Vec3(1e8, -1e8, 3e7), Vec3(1e-310, 0, 0), Vec3(1e-310, 1e-310, -1e-310)}) {
      RequireConsistent(shape, p);
    }
  }
  // Just at the edge of the medial disc of a flat ellipsoid, where Newton starts farthest from the
  // root.
  for (const double z : {1e-300, 1e-20, 1e-9}) {
    RequireConsistent(Ellipsoid{{0.3, 0.3, 0.02}}, Vec3((0.3 * 0.3 - 0.02 * 0.02) / 0.3, 0, z));
  }
}

TEST_CASE("the nearest point of an ellipse section agrees with a fine scan") {
  const Ellipsoid ellipsoid{{0.3, 0.1, 0.2}};
  const Vec3 p(0.2, 0, 0.25);
  double best = 1e9;
  for (int i = 0; i < 200000; ++i) {
    const double angle = 2 * kPi * i / 200000;
    best = std::min(best, std::hypot(0.3 * std::cos(angle) - p.x(), 0.2 * std::sin(angle) - p.z()));
  }
  CHECK(FindNearestPoint(ellipsoid, p).distance == Approx(best).epsilon(1e-8));
}

// Independent of Eberly's scaling: bisection of the secular equation, sum (e_i y_i / (e_i^2 + t))^2 = 1,
// in long double, for its largest root.
TEST_CASE("ellipsoids agree with bisection in long double") {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Vec3& radii : {Vec3(0.03, 0.05, 0.08), Vec3(0.05, 0.05, 0.02), Vec3(0.02, 0.3, 0.3),
                            Vec3(0.5, 0.01, 0.02)}) {
    for (int probe = 0; probe < 500; ++probe) {
      Vec3 p = 1.5 * radii.cwiseProduct(Vec3(uniform(random), uniform(random), uniform(random)));
      if (probe % 3 == 0) p *= std::pow(10.0, -(probe % 9));
      long double least = std::numeric_limits<long double>::infinity();
      for (const double radius : radii) least = std::min<long double>(least, radius);
      const auto value = [&](long double t) {
        long double sum = -1;
        for (int i = 0; i < 3; ++i) {
          const long double e = radii[i];
          const long double term = e * static_cast<long double>(p[i]) / (e * e + t);
          sum += term * term;
        }
        return sum;
      };
      long double low = -least * least, high = 10;
      for (int i = 0; i < 300; ++i) {
        const long double middle = (low + high) / 2;
        (value(middle) > 0 ? low : high) = middle;
      }
      long double squared = 0;
      for (int i = 0; i < 3; ++i) {
        const long double e = radii[i];
        const long double x = e * e * static_cast<long double>(p[i]) / (e * e + high);
        squared += (x - p[i]) * (x - p[i]);
      }
      const auto expected = static_cast<double>(std::copysign(std::sqrt(squared), high));
      const NearestPoint nearest = FindNearestPoint(Ellipsoid{radii}, p);
      CAPTURE(radii.transpose(), p.transpose());
      REQUIRE(std::abs(nearest.distance - expected) <= 1e-9 * radii.maxCoeff());
    }
  }
}

}  // namespace rikiseki::world
