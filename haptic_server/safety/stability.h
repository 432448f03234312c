// SPDX-License-Identifier: MIT
// What settings can be stable at all: the rules of numerics 2 and 3 in words, for the log at the
// start and when a world comes. Never in the tick.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "haptic_server/settings.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// A mass with viscous damping under a force that is held for a period, and comes late.
struct HeldMass {
  double mass_kg = 0;
  double damping_ns_per_m = 0;
  double period_s = 0;
  double latency_s = 0;  // from a measurement to the force that was computed from it
};

/// The device of the settings, with nobody's hand at it.
HeldMass DeviceAlone(const Settings& settings);

/// The largest stable stiffness [N/m] of a static wall with `damping` [N s/m, backward difference],
/// read and written in the same tick: exact, from the discrete transition matrix (Jury; eigenvalues
/// where there is a latency). 0 if the damping alone is unstable. The mass must be positive.
double LargestStableStiffness(const HeldMass& device, double damping_ns_per_m);

/// For --check: what DeviceAlone bears at this rate with the damping of the settings; empty where the
/// device file gives no mass.
std::string LargestStiffnessInWords(const Settings& settings);

/// One sentence for each setting that cannot be stable on the device alone, with nobody's hand to
/// damp it. Empty where nothing is to be said, and where the device file gives no mass.
std::vector<std::string> DeviceWarnings(const Settings& settings);

/// What a finger that is held still does to bodies that move, through this coupling at this world
/// period; empty where the rules know nothing to say.
std::string CouplingAdvice(const RenderSettings& render, protocol::Coupling coupling,
                           double world_period_s);

}  // namespace rikiseki::haptic
