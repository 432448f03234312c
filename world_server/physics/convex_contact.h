// SPDX-License-Identifier: MIT
// Where two convex shapes touch or would touch, whatever they are: the direction in which they are
// furthest apart, and in it all points of the contact at once. Flat faces are clipped against each
// other, lines beside lines give both ends of what they share, everything else one point.
#pragma once

#include <vector>

#include "world_server/physics/contact_point.h"
#include "world_server/physics/placed_convex.h"

namespace rikiseki::world {

/// A direction out of the second shape, towards the first, and how far they are apart along it;
/// points of the cores that are nearest to each other, where they meet at a point.
struct ContactAxis {
  Vec3 normal = Vec3::UnitZ();
  double separation = 0;  // m, roundings included; < 0: they overlap
  Vec3 on_first = Vec3::Zero(), on_second = Vec3::Zero();
};

/// The best direction: exact where the shapes are apart, a local best near `start` where they overlap.
/// Stops looking where they are farther apart than `reach_m`.
ContactAxis FindContactAxis(const PlacedConvex& first, const PlacedConvex& second, double reach_m);

/// How far the shapes are apart along a unit direction out of the second.
double Separation(const PlacedConvex& first, const PlacedConvex& second, const Vec3& normal);

/// The points along an axis with a gap of at most `reach_m`.
std::vector<ContactPoint> PointsAlong(const PlacedConvex& first, const PlacedConvex& second,
                                      const ContactAxis& axis, double reach_m);

/// Both: empty where the two are farther apart than `reach_m`, or pass each other.
std::vector<ContactPoint> FindConvexContact(const PlacedConvex& first, const PlacedConvex& second,
                                            double reach_m);

}  // namespace rikiseki::world
