// SPDX-License-Identifier: MIT
// What an SDFormat link says of itself without its joints: shapes, mass, air and gravity.
#pragma once

#include <sdf/sdf.hh>
#include <string>
#include <vector>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// The pose in the frame that the document gives, finite, or a refusal.
Pose Resolve(const sdf::SemanticPose& semantic, const sdf::ElementPtr& element);

/// Everything but a mesh; refuses heightmaps and polylines.
Shape ReadPrimitive(const sdf::Collision& collision);

/// Mass [kg] and inertia [kg m^2] about the centre of mass, along the link's axes.
void ReadInertia(const sdf::Link& link, SceneBody& body, std::vector<std::string>& warnings);

/// What the link or its model says of the air, the wind [m/s] and of gravity.
void ReadForces(const sdf::Link& link, const sdf::Model& model, const Vec3& wind, SceneBody& body,
                std::vector<std::string>& warnings);

}  // namespace rikiseki::world
