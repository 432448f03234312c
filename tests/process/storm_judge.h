// SPDX-License-Identifier: MIT
// What must hold of everything that a StormWatch saw, whoever was killed or stopped at whatever
// instant. Each function returns one line per violation, at most a few.
//
// The books, on paper. D_E(k) is what haptic epoch E had delivered to bodies when it published tick
// k, q_k its growth. World W acknowledges (E, b, a): baseline tick b, last tick a of a *published*
// frame; A and X are what that frame calls applied and discarded. Then exactly, in units of 1e-12 N
// s, for every frame ever published:
//
//   A + X = D_E(a) - D_E(b) (1)
//
// W starts to read in the middle of E's ring, so that the stretches (b, a] of two worlds may
// overlap; but a tick is displayed against one world only, which the tick names, and only that
// world may apply it. With own = sum of q_k over (b, a] where tick k names W, foreign = the rest of
// it:
//
//   A + X[gap] + X[unknown body] = own,   X[foreign world] = foreign (2)
//
// (where W was not lapped: then a message brings the growth of several ticks). What nobody covers
// is lost: it was displayed to a world that died before its next frame, or by a haptic side that
// the world never met.
//
//   sum over E of D_E(end) = sum over (E, W) of (A + X - foreign) + lost (3)
//
// A world that went on from E to a later epoch has read E to its end: a = last tick of E
// (SPEC.md 5.3).    (4) What the haptic side itself books in health, at its tick K, follows from
// what it can know: displayed = D_E(K), and with (W, n) the newest frame that it took in, pending =
// D_E(K) - D_E(a_n), and applied = what all worlds before W said last, plus what n says. (5)
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/process/storm_watch.h"

namespace rikiseki::test {

using Violations = std::vector<std::string>;

/// What the daemons of the storm were set to.
struct StormLimits {
  double slew_n_per_s = 0;
  std::uint64_t lost_after_ns = 0;  // from the last frame of a silent world
  std::uint64_t fade_ns = 0;
  std::uint64_t fault_after_misses = 0;
  double friction = 0;     // of the block on the floor
  double settling_ns = 0;  // N s, what the engine's contacts add to a block at rest
};

/// Finite, capped, slew-limited, zero when the world is silent, zero after a stop of its own.
Violations JudgeForce(const HapticHistory& haptic, const StormLimits& limits);

/// Bodies and ground together got the integral of minus the displayed force over the true
/// durations.
Violations JudgeImpulseOfForce(const HapticHistory& haptic);

/// (1), (2), (4) for every world, (3) in sum.
struct Sums {
  protocol::ImpulseUnits delivered{};
  protocol::ImpulseUnits applied{};
  protocol::ImpulseUnits discarded{};  // X - foreign
  protocol::ImpulseUnits lost{};
};
Violations JudgeBooks(const StormWatch& watch, Sums& sums);

/// (5).
Violations JudgeHapticBooks(const HapticHistory& haptic, const StormWatch& watch);

/// The block's velocity follows from what its world says it applied, and from friction and gravity.
Violations JudgeBlock(const WorldHistory& world, const StormLimits& limits);

}  // namespace rikiseki::test
