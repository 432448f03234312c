// SPDX-License-Identifier: MIT
// One push of a block on a floor with friction, in one dimension: the experiment of the paper's Fig. 6,
// through both step functions. Paper section 4; numerics sections 3 and 5.
#pragma once

#include "haptic_server/device/hand.h"
#include "haptic_server/settings.h"
#include "protocol/messages.h"
#include "tests/lab/prepared_run.h"

namespace rikiseki::lab {

enum class PushScenario {
  kPoke,  // P: -40 mm -> +20 mm -> -40 mm, 120 ms each way, light hand, mu = 0.1
  kPush,  // H: -50 mm -> +100 mm in 0.30 s, 0.10 s there, back in 0.30 s, firm hand, mu = 0.3
};

enum class PushedWorld {
  kExactSlide,         // EX: exact Coulomb friction
  kSemiImplicitSlide,  // SE
  kBullet,             // BULLET: the engine, with a 6 cm cube on a floor
};

/// How `local` gets the push to the world.
enum class LocalVariant {
  kTicks,  // AUTH: every tick is replayed
  kBlock,  // M1: only the newest message of a period arrives, the rest was overwritten unread
  kLump,   // SE: one kick per world tick, the naive way
};

/// One push of the block, whose face is at x = 0 at rest.
struct BlockPush {
  PushScenario scenario = PushScenario::kPoke;
  PushedWorld world = PushedWorld::kExactSlide;
  protocol::Coupling coupling = protocol::Coupling::kImpulse;
  haptic::DisplayRule display = haptic::DisplayRule::kInterpolate;
  LocalVariant local = LocalVariant::kTicks;                 // where the coupling is `local`
  PositionRule position_rule = PositionRule::kSemiImplicit;  // of the copies, as written
  double haptic_period_s = 1e-3;
  double world_period_s = 0.05;  // a whole number of haptic periods
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 0;  // the literal damper, which may pull
  double mass_kg = 1;
  double friction = 0.1;
  int phase_ticks = 0;  // haptic tick of the first world tick
};

struct BlockPushResult {
  double final_position_m = 0;    // of the face, after 3 s
  double total_impulse_ns = 0;    // displayed
  double peak_speed_m_per_s = 0;  // of the block, after any world tick
};

/// The hand of the scenario, with its motor program.
haptic::Hand HandOf(PushScenario scenario);

/// Both loops up to tick 0, when the hand starts; body 0 is the block, which lies at x = 0. Throws
/// std::invalid_argument on a push that cannot be run.
PreparedRun PrepareBlockPush(const BlockPush& push, haptic::Hand hand);

/// Runs the scenario's push for 3 s of virtual time. Throws as PrepareBlockPush does.
BlockPushResult SimulateBlockPush(const BlockPush& push);

}  // namespace rikiseki::lab
