// SPDX-License-Identifier: MIT
// The written slides: a finger sphere of 1 cm goes at 0.3 m/s over a body that cannot move - round a
// sphere, off the edge of a box, round that edge - or pushes one that nothing holds.
#pragma once

#include "common/geometry.h"
#include "world_server/scene/scene.h"

namespace rikiseki::lab {

inline constexpr double kSlideRadius = 0.01;  // m, of the finger sphere
inline constexpr double kSlideSpeed = 0.3;    // m/s, of the finger, in the world
inline constexpr double kFreeMass = 0.5;      // kg, of the block that nothing holds

enum class SlideScript {
  kSphere,  // twice round a fixed sphere of 3 cm
  kEdge,    // along the top of a fixed box, and straight on where it ends
  kRound,   // ... round the edge, and down the side
  kFree,    // into a face of a block without gravity, which takes the push and leaves
};

struct Slide {
  SlideScript script = SlideScript::kSphere;
  double friction = 0;     // Coulomb, of finger and body
  double depth_m = 0.002;  // how far the finger sphere is in the surface while it slides
};

/// The finger rests, pressed in, before it slides. The force is compared while it slides.
double SlideStart(const Slide& slide);
double SlideEnd(const Slide& slide);
double Duration(const Slide& slide);

/// The finger's centre [m, W] at `t_s`.
Vec3 FingerPosition(const Slide& slide, double t_s);

world::Scene SlideScene(const Slide& slide);

/// Of the free block about any axis [kg m^2].
double FreeInertia();

}  // namespace rikiseki::lab
