// SPDX-License-Identifier: MIT
// One run at the edge of what may happen to the pair: masses, stiffnesses and rates that nobody
// would choose, fingers that go where no finger goes, samples that are no numbers, a world that
// falls silent. numerics section 6, "Extremes".
#pragma once

#include <optional>
#include <string>

#include "haptic_server/device/hand.h"
#include "protocol/messages.h"

namespace rikiseki::lab {

enum class ExtremeEvent {
  // A hand holds a finger in the slot of a free block: contact that never ends, and so is stable or
  // not.
  kSlot,
  // A prescribed finger squeezes a cube against a wall, and ...
  kFast,       // ... leaves and comes back at 1e6 m/s
  kFar,        // ... is now and then 1e8 m away
  kNotFinite,  // ... is measured as nan, infinite or absurd now and then
  kDenormal,   // ... is in the surface by a denormal number
  kSilence,    // ... hears nothing of the world for 5 s
};

struct ExtremeRun {
  ExtremeEvent event = ExtremeEvent::kSlot;
  protocol::Coupling coupling = protocol::Coupling::kImpulse;
  double haptic_hz = 1000;
  double world_hz = 20;  // of any ratio to the other
  int latency_ticks = 0;
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 0;
  double mass_kg = 1;
  std::optional<haptic::Impedance> hand = {};  // with the device; none = the finger is clamped
  double duration_s = 10;
};

struct ExtremeResult {
  bool sound = false;         // every message that left either side was
  std::string complaint;      // about the first that was not
  bool force_finite = false;  // of every command to the device
  double largest_force_n = 0;
  double largest_step_n = 0;  // from tick to tick
  double force_cap_n = 0;     // what the two may be at most
  double step_limit_n = 0;
  bool flagged = false;  // the haptic side found the contact unstable
};

/// With the safety settings that ship, but without soft start. Throws std::invalid_argument on what
/// cannot be run.
ExtremeResult SimulateExtreme(const ExtremeRun& extreme);

}  // namespace rikiseki::lab
