// SPDX-License-Identifier: MIT
#include "tests/lab/push_rows.h"

#include <optional>

#include "tests/lab/choose.h"

namespace rikiseki::lab {
namespace {

constexpr Named<PushScript> kScripts[] = {
    {"push", PushScript::kPush},           {"poke", PushScript::kPoke},
    {"hold", PushScript::kHold},           {"press", PushScript::kPress},
    {"offcentre", PushScript::kOffCentre}, {"wall", PushScript::kWall},
    {"neighbour", PushScript::kNeighbour}, {"stick", PushScript::kStick},
    {"corner", PushScript::kCorner},       {"stack", PushScript::kStack},
};

constexpr Named<std::optional<protocol::Coupling>> kCouplings[] = {
    {"position", protocol::Coupling::kPosition},
    {"impulse", protocol::Coupling::kImpulse},
    {"local", protocol::Coupling::kLocal},
    {kSingleRate, std::nullopt},
};

constexpr double kSlowWorld = 0.15;  // s: at 5 Hz jumps may be twice as large

}  // namespace

CubePush ParsePush(const Row& row) {
  CubePush push;
  push.script = Choose(row, "script", kScripts);
  push.mass_kg = row.Number("mass_kg", 1e-6, 1e6);
  push.friction = row.NumberOr("mu", 0, 10, push.friction);
  push.stiffness_n_per_m = row.NumberOr("kp", 1, 1e6, push.stiffness_n_per_m);
  push.damping_ns_per_m = row.NumberOr("kd", 0, 1e4, push.damping_ns_per_m);
  const bool off_centre = push.script == PushScript::kOffCentre;
  push.offset_m = row.NumberOr("offset_m", -kCubeHalf, kCubeHalf, off_centre ? 0.01 : 0);
  const bool neighbour = push.script == PushScript::kNeighbour;
  push.gap_m = row.NumberOr("gap_m", 0, 1, neighbour ? 0.01 : 0.02);
  push.neighbour_kg = row.NumberOr("neighbour_kg", 1e-6, 1e6, push.mass_kg);
  return push;
}

PushLoops ParseLoops(const Row& row) {
  PushLoops loops;
  loops.coupling = Choose(row, "coupling", kCouplings);
  if (!loops.coupling) return loops;
  loops.world_period_s = row.Number("Tw_s", 1e-3, 10);
  if (row.Find("latency_ticks")) loops.latency_ticks = row.Integer("latency_ticks", 0, 100'000);
  return loops;
}

std::vector<std::string> PushOf(const Row& row) {
  std::vector<std::string> fields;
  for (const std::string& column : kPushColumns) fields.push_back(row.Find(column).value_or(""));
  return fields;
}

PushBars BarsOf(PushScript script, double world_period_s) {
  PushBars bars;
  bool doubles = true;  // the jump, for a slow world
  switch (script) {
    case PushScript::kPoke:
      bars.displacement = 0.015;
      break;
    case PushScript::kOffCentre:
      bars.sd = 0.005;
      bars.jump_m = 5e-4;
      break;
    case PushScript::kWall:
      bars.force = 0.005;
      break;
    case PushScript::kNeighbour:
      bars.displacement = bars.sd = 0.03;
      bars.jump_m = 1.5e-3;
      doubles = false;
      break;
    case PushScript::kPress:
    case PushScript::kStick:  // exact, but for the last digits that it is written with
      bars.force = bars.peak = 1e-3;
      break;
    default:
      break;
  }
  if (doubles && world_period_s > kSlowWorld) bars.jump_m *= 2;
  return bars;
}

}  // namespace rikiseki::lab
