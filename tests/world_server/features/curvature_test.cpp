// SPDX-License-Identifier: MIT
#include "world_server/features/curvature.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace rikiseki::world {
namespace {

// The surface's distance from the tangent plane, a little way along it, tells how it bends.
double MeasuredRadius(const Shape& shape, const NearestPoint& nearest, const Vec3& along) {
  const double way = 1e-4;
  const double drop =
      FindNearestPoint(shape, nearest.point + way * along).distance;  // d = w^2 / 2 r + O(w^4)
  return way * way / (2 * drop);
}

}  // namespace

TEST_CASE("the ball bends as the surface does along the finger's way") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] { return Vec3(any(random), any(random), any(random)); };
  for (const Shape& shape : {Shape(Sphere{0.03}), Shape(Ellipsoid{{0.03, 0.02, 0.05}}),
                             Shape(Cylinder{0.03, 0.04}), Shape(Capsule{0.03, 0.04})}) {
    int round = 0;
    for (int i = 0; i < 300; ++i) {
      const NearestPoint nearest = FindNearestPoint(shape, 0.06 * vector());
      // Not where the measuring way would go over the seam of side and cap.
      if (shape.index() != 5 && std::abs(std::abs(nearest.point.z()) - 0.04) < 2e-4) continue;
      const Vec3 way = vector();
      const Vec3 along = (way - way.dot(nearest.normal) * nearest.normal).normalized();
      const double radius = RadiusAlong(shape, nearest, way);
      CAPTURE(shape.index(), i, radius, nearest.point.transpose());
      REQUIRE(radius >= 0);
      const double strongest = RadiusAlong(shape, nearest, Vec3::Zero());
      if (radius == 0) {
        // Flat, an edge, or as good as flat that way.
        CHECK((strongest == 0 || MeasuredRadius(shape, nearest, along) > 50 * strongest));
        continue;
      }
      ++round;
      CHECK(radius == Approx(MeasuredRadius(shape, nearest, along)).epsilon(0.01));
      CHECK(strongest <= radius * (1 + 1e-12));
    }
    CHECK(round > 100);
  }
}

TEST_CASE("flat shapes, edges and corners have no radius") {
  const Cylinder cylinder{0.03, 0.04};
  const auto radius = [](const Shape& shape, const Vec3& p) {
    return RadiusAlong(shape, FindNearestPoint(shape, p), Vec3::Zero());
  };
  CHECK(radius(cylinder, {0.01, 0, 0.06}) == 0);  // the cap
  CHECK(radius(cylinder, {0.05, 0, 0.06}) == 0);  // the rim
  CHECK(radius(cylinder, {0.05, 0, 0.01}) == Approx(0.03));
  CHECK(radius(Box{Vec3::Constant(0.03)}, {0.05, 0.05, 0.05}) == 0);
  CHECK(radius(HalfSpace{}, {0, 0, 0.01}) == 0);
}

}  // namespace rikiseki::world
