// SPDX-License-Identifier: MIT
#include "tests/lab/error_run.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <utility>

#include "protocol/codec.h"
#include "protocol/impulse_units.h"
#include "tests/lab/block_push.h"
#include "tests/lab/thread_cpu.h"

namespace rikiseki::lab {
namespace {

constexpr double kRunawayDistance = 100;  // m: nothing on a lab's floor, but a loop that diverged

PushScript ScriptOf(ErrorSystem system) {
  switch (system) {
    case ErrorSystem::kCorner:
      return PushScript::kCorner;
    case ErrorSystem::kStack:
      return PushScript::kStack;
    default:
      return PushScript::kOffCentre;
  }
}

PreparedRun PrepareBlock(ErrorSystem system, const PushLoops& loops) {
  const bool poke = system == ErrorSystem::kPoke;
  BlockPush push;
  push.scenario = poke ? PushScenario::kPoke : PushScenario::kPush;
  push.mass_kg = poke ? 0.5 : 2;
  push.friction = poke ? 0.1 : 0.3;
  push.coupling = loops.coupling.value_or(protocol::Coupling::kImpulse);
  push.display = loops.coupling ? loops.display : haptic::DisplayRule::kHold;
  push.position_rule = loops.position_rule;
  push.haptic_period_s = loops.haptic_period_s;
  push.world_period_s = loops.coupling ? loops.world_period_s : loops.haptic_period_s;
  push.phase_ticks = loops.phase_ticks;
  return PrepareBlockPush(push, HandOf(push.scenario));
}

PreparedRun Prepare(ErrorSystem system, const PushLoops& loops) {
  if (system == ErrorSystem::kPoke || system == ErrorSystem::kPush) {
    return PrepareBlock(system, loops);
  }
  CubePush push{.script = ScriptOf(system), .mass_kg = 0.5, .neighbour_kg = 0.25};
  if (system == ErrorSystem::kOffCentre) push.offset_m = 0.01;
  return PrepareCubePush(push, loops);
}

// Bytes of the messages of one tick on their way to the other side.
class Wire {
 public:
  void Count(const CoupledRun& loops, bool world_ticked) {
    bytes_ += protocol::Encode(loops.haptic_tick(), words_).used_bytes;
    if (world_ticked) bytes_ += protocol::Encode(loops.world_frame(), words_).used_bytes;
  }
  double bytes() const { return bytes_; }

 private:
  std::array<std::uint64_t, protocol::kWorldFrameBytes / 8> words_{};
  double bytes_ = 0;
};
static_assert(protocol::kWorldFrameBytes >= protocol::kHapticTickBytes);

void ReadBodies(const CoupledRun& loops, RunRecord& record) {
  for (const protocol::Body& body : loops.world().Bodies()) {
    if (body.mass == 0) continue;
    BodyState state;
    state.pose = {ToVec3(body.position), ToQuat(body.orientation)};
    state.velocity = ToVec3(body.velocity);
    record.diverged = record.diverged || !(state.pose.position.norm() < kRunawayDistance) ||
                      !state.pose.orientation.coeffs().allFinite();
    record.bodies.push_back(state);
  }
}

// One run of every system and period that was asked for. A lock is held while one is made, so that
// two rows do not make the same.
struct Records {
  std::mutex mutex;
  std::map<std::pair<ErrorSystem, double>, RunRecord> made;
};

}  // namespace

RunRecord RunErrorSystem(ErrorSystem system, const PushLoops& loops, Measure measure) {
  const PreparedRun prepared = Prepare(system, loops);
  CoupledRun& run = *prepared.loops;
  const long long ticks = std::llround(prepared.duration_s / loops.haptic_period_s);
  RunRecord record;
  record.force_n.reserve(static_cast<std::size_t>(ticks));
  record.haptic_us.reserve(static_cast<std::size_t>(ticks));
  Wire wire;
  const double start_s = ThreadCpu();
  long long k = 0;
  for (bool world_ticked = false; !(world_ticked && k > ticks); ++k) {
    world_ticked = run.Tick();
    if (measure == Measure::kBytes) wire.Count(run, world_ticked);
    if (k >= ticks) continue;
    record.force_n.push_back(ToVec3(run.haptic_tick().pointers[0].force));
    if (measure == Measure::kCost) {
      record.haptic_us.push_back(static_cast<float>(1e6 * run.effort().haptic_s));
    }
  }
  if (measure == Measure::kCost) record.cpu_s = ThreadCpu() - start_s;
  record.bytes = wire.bytes();
  record.duration_s = static_cast<double>(k) * loops.haptic_period_s;
  const protocol::HapticHealth& health = run.haptic_health();
  record.impulse_ns = ToVec3(protocol::InSi(health.books.displayed));
  record.largest_force_step_n = health.largest_force_step;
  record.injected_j = health.energy.injected;
  record.jump_m = health.reconciliation.largest_jump;
  ReadBodies(run, record);
  return record;
}

const RunRecord& SingleRateRecord(ErrorSystem system, double period_s) {
  static Records records;
  const std::lock_guard lock(records.mutex);
  const auto known = records.made.find({system, period_s});
  if (known != records.made.end()) return known->second;
  PushLoops loops;
  loops.haptic_period_s = period_s;
  loops.substep_s = std::min(period_s, loops.substep_s);
  return records.made
      .emplace(std::pair(system, period_s), RunErrorSystem(system, loops, Measure::kBytes))
      .first->second;
}

PlaceError CompareBodies(const std::vector<RunRecord>& runs, const RunRecord& truth) {
  PlaceError error;
  const auto count = static_cast<double>(runs.size());
  double squares = 0, variance = 0, bias = 0, turns = 0;
  for (std::size_t body = 0; body < truth.bodies.size(); ++body) {
    const Pose& exact = truth.bodies[body].pose;
    Vec3 mean = Vec3::Zero();
    for (const RunRecord& run : runs) {
      const Pose& pose = run.bodies[body].pose;
      mean += (pose.position - exact.position) / count;
      squares += (pose.position - exact.position).squaredNorm() / count;
      const double turn = pose.orientation.angularDistance(exact.orientation);
      turns += turn * turn / count;
    }
    bias += mean.squaredNorm();
    for (const RunRecord& run : runs) {
      variance += (run.bodies[body].pose.position - exact.position - mean).squaredNorm() / count;
    }
  }
  error.rms_m = std::sqrt(squares);
  error.bias_m = std::sqrt(bias);
  error.sd_m = std::sqrt(variance);
  error.turn_rad = std::sqrt(turns);
  return error;
}

double ForceTraceError(const RunRecord& run, const RunRecord& truth) {
  const auto at = [](const RunRecord& record, std::size_t k) -> Vec3 {
    return k < record.force_n.size() ? record.force_n[k] : Vec3::Zero();
  };
  double squares = 0, in_contact = 0;
  for (std::size_t k = 0; k < std::max(run.force_n.size(), truth.force_n.size()); ++k) {
    const Vec3 a = at(run, k);
    const Vec3 b = at(truth, k);
    if (a.isZero(0) && b.isZero(0)) continue;
    squares += (a - b).squaredNorm();
    ++in_contact;
  }
  return in_contact > 0 ? std::sqrt(squares / in_contact) : 0;
}

}  // namespace rikiseki::lab
