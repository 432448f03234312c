// SPDX-License-Identifier: MIT
// Scenes that several tests use.
#pragma once

#include "world_server/scene/scene.h"

namespace rikiseki::world::test {

inline SceneBody Floor(double friction) {
  SceneBody floor;
  floor.name = "floor::link";
  floor.fixed = true;
  floor.colliders.push_back({.shape = HalfSpace{}, .friction = friction});
  return floor;
}

inline SceneBody Cube(double edge, double mass_kg, double friction, const Vec3& position) {
  SceneBody cube;
  cube.name = "cube::link";
  cube.mass_kg = mass_kg;
  cube.inertia = Mat3::Identity() * (mass_kg * edge * edge / 6);
  cube.pose_WB.position = position;
  cube.colliders.push_back({.shape = Box{Vec3::Constant(edge / 2)}, .friction = friction});
  return cube;
}

/// Body 0 is the floor (top at z = 0), body 1 a cube that stands on it.
inline Scene CubeOnFloor(double friction, double edge = 0.06, double mass_kg = 1) {
  Scene scene;
  scene.name = "cube on floor";
  scene.bodies = {Floor(friction), Cube(edge, mass_kg, friction, {0, 0, edge / 2})};
  return scene;
}

/// Body 0 is a cube of 6 cm at the origin that nothing holds.
inline Scene FreeCube(double mass_kg) {
  Scene scene;
  scene.gravity.setZero();
  scene.bodies = {Cube(0.06, mass_kg, 0.3, Vec3::Zero())};
  return scene;
}

}  // namespace rikiseki::world::test
