// SPDX-License-Identifier: MIT
#include "world_server/geometry/triangle.h"

#include <algorithm>

namespace rikiseki::world {

// Regions after C. Ericson, Real-Time Collision Detection, 5.1.5; each foot by its own formula.
TriangleFoot FootOnTriangle(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& p) {
  using Part = TriangleFoot::Part;
  const Vec3 ab = b - a, ac = c - a, bc = c - b;
  const Vec3 ap = p - a, bp = p - b, cp = p - c;
  const auto share = [](double along, double whole) {
    return whole > 0 ? std::clamp(along / whole, 0.0, 1.0) : 0.0;
  };
  const double ab_a = ab.dot(ap), ac_a = ac.dot(ap);
  if (ab_a <= 0 && ac_a <= 0) return {a, {1, 0, 0}, Part::kCorner, 0};
  const double ab_b = ab.dot(bp), ac_b = ac.dot(bp);
  if (ab_b >= 0 && ac_b <= ab_b) return {b, {0, 1, 0}, Part::kCorner, 1};
  const double ab_c = ab.dot(cp), ac_c = ac.dot(cp);
  if (ac_c >= 0 && ab_c <= ac_c) return {c, {0, 0, 1}, Part::kCorner, 2};
  const double beyond_ab = ab_a * ac_b - ab_b * ac_a;
  if (beyond_ab <= 0 && ab_a >= 0 && ab_b <= 0) {
    const double t = share(ab_a, ab.squaredNorm());
    return {a + t * ab, {1 - t, t, 0}, Part::kEdge, 0};
  }
  const double beyond_ca = ab_c * ac_a - ab_a * ac_c;
  if (beyond_ca <= 0 && ac_a >= 0 && ac_c <= 0) {
    const double t = share(ac_a, ac.squaredNorm());
    return {a + t * ac, {1 - t, 0, t}, Part::kEdge, 2};
  }
  const double beyond_bc = ab_b * ac_c - ab_c * ac_b;
  if (beyond_bc <= 0 && ac_b - ab_b >= 0 && ab_c - ac_c >= 0) {
    const double t = share(bc.dot(bp), bc.squaredNorm());
    return {b + t * bc, {0, 1 - t, t}, Part::kEdge, 1};
  }
  const double whole = beyond_ab + beyond_ca + beyond_bc;
  const double v = beyond_ca / whole, w = beyond_ab / whole;
  return {a + v * ab + w * ac, {1 - v - w, v, w}, Part::kFace, 0};
}

}  // namespace rikiseki::world
