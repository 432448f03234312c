// SPDX-License-Identifier: MIT
// What the readers of an SDFormat file share: where an element stands, and how it is refused.
#pragma once

#include <initializer_list>
#include <sdf/sdf.hh>
#include <string>

#include "common/geometry.h"

namespace rikiseki::world {

/// "file:line", of the file that the element stands in (an included one, perhaps).
std::string PlaceOf(const sdf::ElementPtr& element);

/// Throws ConfigError with the place and the reason.
[[noreturn]] void Refuse(const sdf::ElementPtr& element, const std::string& why);

/// The element at the end of a path of names, if every one of them stands in the file; else null.
sdf::ElementPtr FindExplicit(sdf::ElementPtr element, std::initializer_list<const char*> names);

/// The value, or a refusal of what is not finite and above 0.
double Positive(const sdf::ElementPtr& element, const std::string& what, double value);

inline Vec3 FromSdf(const ignition::math::Vector3d& v) {
  return {v.X(), v.Y(), v.Z()};
}

inline Pose FromSdf(const ignition::math::Pose3d& pose) {
  const auto& q = pose.Rot();
  return {FromSdf(pose.Pos()), Quat(q.W(), q.X(), q.Y(), q.Z()).normalized()};
}

}  // namespace rikiseki::world
