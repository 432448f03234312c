// SPDX-License-Identifier: MIT
// The `<rikiseki:...>` elements of an SDFormat file: what SDF has no word for. SDFormat lets elements
// with a name space pass unread, so they are checked here to the letter.
//
//   in <surface> of a collision:
//     <rikiseki:static_friction>  Coulomb, for the finger; from <mu> to 100; absent: as <mu>
//     <rikiseki:recovery_s>       how long the surface's force takes to come and go, above 0 to 10 s
//   in <link>:
//     <rikiseki:drag>          of the air, N s/m, 0 to 1e6: force = drag * (wind - velocity)
//     <rikiseki:angular_drag>  N m s, 0 to 1e6: torque = -angular_drag * angular velocity
//     <rikiseki:youngs_modulus>  Pa, 100 to 1e12: makes the link soft; one box, sphere or ellipsoid,
//                                held by the static models that it touches
//     <rikiseki:poisson_ratio>   of a soft link, 0 to 0.45; absent: 0.3
//     <rikiseki:relaxation_s>    its damping: stress follows strain + relaxation * strain rate; 0 to 10,
//                                absent: 0.02
//     <rikiseki:element_size>    m, edge of its elements; absent: about 200 nodes
#pragma once

#include <sdf/Element.hh>
#include <string>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Whether an element is one of ours, known or not.
bool IsExtension(const sdf::ElementPtr& element);

/// Throws ConfigError, with file, line and what would be right, for one that is not known there.
void CheckExtension(const sdf::ElementPtr& parent, const sdf::ElementPtr& element);

/// Fills in what the <surface> of a collision says. Throws ConfigError likewise. The collider's
/// friction is known.
void ReadSurfaceExtensions(const sdf::ElementPtr& collision, Collider& collider);

/// Fills in what a <link> says. Throws ConfigError likewise.
void ReadLinkExtensions(const sdf::ElementPtr& link, SceneBody& body);

/// Whether a <link> is soft, and of what. Throws ConfigError likewise. The body's colliders are known.
void ReadSoftness(const sdf::ElementPtr& link, SceneBody& body);

/// Throws ConfigError where nothing holds a soft body, or it would collapse. All bodies are known.
void RequireHeld(const sdf::ElementPtr& link, const Scene& scene, const SceneBody& body);

/// "file:line" of what makes a link soft.
std::string PlaceOfSoftness(const sdf::ElementPtr& link);

}  // namespace rikiseki::world
