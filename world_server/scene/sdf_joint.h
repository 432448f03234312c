// SPDX-License-Identifier: MIT
// The <joint>s of an SDFormat file: which links they make one body, and how they let others move.
// Fixed ones are no joints to the engine: what they connect becomes one body, or fixed with the world.
#pragma once

#include <cstddef>
#include <sdf/sdf.hh>
#include <string>
#include <vector>

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// A joint of the file. Ends are links by their full names, "model::link", or "world".
struct SdfJoint {
  sdf::ElementPtr element;
  std::string name;  // "model::joint"
  bool fixed = false;
  std::string parent, child;
  Pose pose_WJ = {};  // z along its axis
  Joint joint = {};   // type, limits, damping, friction
};

/// Appends the joints of a model; `name` is its full name, `pose_WM` its pose. Throws ConfigError with
/// file and line for a type that is not built.
void ReadModelJoints(const sdf::Model& model, const std::string& name, const Pose& pose_WM,
                     std::vector<SdfJoint>& joints, std::vector<std::string>& warnings);

/// One link of the file, before fixed joints are followed.
struct SdfLink {
  std::string name;  // "model::link"
  bool fixed = false;
  Pose pose_WL = {};
};

/// For each link the first of those with which fixed joints make it one body. Those that hang on the
/// world, or on a link that is fixed, become fixed.
std::vector<std::size_t> FollowFixedJoints(const std::vector<SdfJoint>& joints,
                                           std::vector<SdfLink>& links);

/// One body of two that move as one: mass, centre of mass, inertia and shapes; drags add up. The
/// frame keeps the axes and the name of the first.
SceneBody Merged(const SceneBody& first, const SceneBody& second);

}  // namespace rikiseki::world
