// SPDX-License-Identifier: MIT
// A hand that stirs in a scene, whatever is in it: to and fro between random places of a box round the
// middle of the device, pressing, pushing, sliding and lifting what it meets, through both step
// functions and the engine that ship; then it withdraws until everything is accounted for. What must
// hold of any scene is measured.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/geometry.h"
#include "protocol/messages.h"
#include "world_server/scene/scene.h"

namespace rikiseki::lab {

struct Stir {
  world::Scene scene;
  double duration_s = 60;
  double world_rate_hz = 20;
  protocol::Coupling coupling = protocol::Coupling::kLocal;
  // As for people. Without it a press near the edge of a soft block gives the hand up to 0.1 J: the plane
  // turns over the edge while the finger is 20 mm deep.
  bool passivity_controller = true;
  double low_m = -0.03;  // the lower end of its box: where most scenes have their floor
  std::uint64_t seed = 1;
};

struct StirResult {
  bool finite = true;       // every force, place and velocity, in every tick
  double force_peak_n = 0;  // on the finger
  double over_cap_n = 0;    // of it, beyond the cap: must be 0
  double over_slew_n = 0;   // of its change from tick to tick, beyond the limit: must be 0
  double work_j = 0;        // that the finger did
  // Of the bodies that move, kinetic + potential, above that of the start.
  double energy_peak_j = 0;
  // The most that they ever had beyond what start and finger gave.
  double energy_excess_j = 0;
  double unaccounted_ns = 0;     // of the impulse, when all is said: must be 0
  double displayed_ns = 0;       // impulse on bodies, sum of what the books hold at the end
  double discarded_ns = 0;       // of it, declared not applied
  double farthest_m = 0;         // of any body from where it began
  double largest_jump_m = 0;     // of a local copy at a frame
  std::uint64_t flagged = 0;     // contacts that the energy meter found unstable
  std::vector<double> world_us;  // CPU of each world tick with what it consumed: wall clock
  std::uint64_t hash = 0;        // of every haptic tick and every body after every world tick
};

/// What does not hold of a run and must hold of any, in words; empty where all does. The bodies may
/// have 5 mJ and 2 % of the finger's work beyond what start and finger gave: the engine mends what
/// was pressed into each other.
std::string Broken(const StirResult& got);

/// The loops are configured as by default, but for what `stir` says.
StirResult SimulateStir(const Stir& stir);

}  // namespace rikiseki::lab
