// SPDX-License-Identifier: MIT
// The proxy: the point nearest to the finger that lies outside all planes, exactly, with
// multipliers that say how much each plane pushes. Paper 3.3; numerics 6.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "common/geometry.h"

namespace rikiseki::haptic {

inline constexpr std::size_t kMaxContactPlanes = 32;

/// The half-space normal . (x - point) >= 0 is free. The normal need not be of unit length.
struct HalfSpace {
  Vec3 point = Vec3::Zero();  // m
  Vec3 normal = Vec3::Zero();
};

struct ContactSolution {
  Vec3 proxy = Vec3::Zero();         // m, D
  Vec3 displacement = Vec3::Zero();  // m, e = D - C = sum of multiplier_i * unit normal_i
  std::array<double, kMaxContactPlanes> multiplier{};  // m, >= 0, at most 3 are not 0
  bool feasible = true;  // false: the half-spaces have no point in common
};

/// Finds D for the finger centre `finger` [m, finite] of radius `radius` [m]: every plane is
/// shifted outwards by it. Planes with a non-finite entry or a normal shorter than 1e-12 are
/// ignored; planes less than 1e-10 rad apart act as one. If nothing lies outside all planes, D
/// minimises the sum of the squared violations, and of all such points is the nearest to the
/// finger. Violations below 1e-12 m (or 1e-12 of the largest coordinate) count as none.
///
/// Method: a basis of at most three planes is grown by the plane violated most; each time the
/// nearest point for these at most four planes is found among all their subsets. Deterministic,
/// bounded, in extended precision so that thin wedges come out. // RT:
ContactSolution SolveContact(const Vec3& finger, double radius,
                             std::span<const HalfSpace> planes) noexcept;

}  // namespace rikiseki::haptic
