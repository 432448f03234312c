// SPDX-License-Identifier: MIT
#include "tests/lab/stir_run.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <sstream>

#include "common/clock.h"
#include "haptic_server/device/hand.h"
#include "protocol/codec.h"
#include "protocol/impulse_units.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/ideal_device.h"
#include "world_server/physics/deformable_world.h"

namespace rikiseki::lab {
namespace {

constexpr haptic::Impedance kHand{0.93, 15.2, 500};  // of config/haptic_server.ini, with its device
const Vec3 kCorner(-0.06, -0.05, 0);  // m, the box in which it stirs, but for its lower end
const Vec3 kOpposite(0.06, 0.05, 0.045);
const Vec3 kHome(-0.05, 0, 0.3);     // m, above everything, at the beginning and the end
constexpr double kLead = 0.5;        // s, at home: longer than the soft start
constexpr double kReach = 0.3;       // s, of a stroke
constexpr double kHold = 0.05;       // s
constexpr double kWithdrawal = 0.5;  // s
constexpr double kSettling = 0.5;    // s, without touch, for the last impulses to be acknowledged

constexpr double kForceRounding = 1e-9;  // N
constexpr double kEnergyFloor = 5e-3;    // J
constexpr double kEnergyShare = 0.02;    // of the work
constexpr double kFarthest = 1e3;        // m: nothing on a lab's table

haptic::MotorProgram::Script Script(const Stir& stir) {
  const int count = static_cast<int>(std::ceil(stir.duration_s / (kReach + kHold)));
  haptic::MotorProgram::Script script;
  script.home = kHome;
  const Vec3 corner(kCorner.x(), kCorner.y(), stir.low_m);
  script.strokes = haptic::StirringStrokes(corner, kOpposite, kReach, kHold, stir.seed, count);
  const Vec3 up(script.strokes.back().to.x(), script.strokes.back().to.y(), kHome.z());
  script.strokes.push_back({up, kWithdrawal});
  return script;
}

// FNV-1a over words instead of bytes.
class Hash {
 public:
  void Add(std::uint64_t word) { value_ = (value_ ^ word) * 0x100000001b3; }
  template <typename Numbers>
  void AddAll(const Numbers& numbers) {
    for (const double x : numbers) Add(std::bit_cast<std::uint64_t>(x));
  }
  void Add(const protocol::HapticTick& tick) {
    std::array<std::uint64_t, protocol::kHapticTickBytes / 8> words{};
    const protocol::Encoded encoded = protocol::Encode(tick, words);
    for (std::size_t i = 0; i < encoded.used_bytes / 8; ++i) Add(words[i]);
  }
  void Add(const protocol::Body& body) {
    AddAll(body.position);
    AddAll(body.orientation);
    AddAll(body.velocity);
    AddAll(body.angular_velocity);
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325;
};

// Kinetic and potential, of all that moves [J].
double EnergyOf(const world::Scene& scene, const std::vector<protocol::Body>& bodies) {
  double sum = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const world::SceneBody& body = scene.bodies[i];
    if (body.fixed) continue;
    const Vec3 velocity = ToVec3(bodies[i].velocity);
    const Vec3 spin_B =
        ToQuat(bodies[i].orientation).conjugate() * ToVec3(bodies[i].angular_velocity);
    sum += body.mass_kg / 2 * velocity.squaredNorm() + spin_B.dot(body.inertia * spin_B) / 2;
    if (body.falls) sum -= body.mass_kg * scene.gravity.dot(ToVec3(bodies[i].position));
  }
  return sum;
}

double Length(const protocol::ImpulseUnits& units) {
  return ToVec3(protocol::InSi(units)).norm();
}

// What is held against every tick.
class Watch {
 public:
  Watch(const world::Scene& scene, const haptic::Settings& settings, const CoupledRun& run)
      : scene_(scene),
        cap_(settings.safety.force_cap_n),
        step_(settings.safety.slew_limit_n_per_s * Seconds(settings.period_ns())),
        start_j_(EnergyOf(scene, run.world().Bodies())),
        start_(run.world().Bodies()) {}

  void Tick(const CoupledRun& run, bool world_ticked) {
    const protocol::Pointer& pointer = run.haptic_tick().pointers[0];
    const Vec3 position = ToVec3(pointer.position);
    const Vec3 force = ToVec3(pointer.force);
    // The force that was held until now, on the way that the finger went under it.
    if (known_) result_.work_j -= force_.dot(position - position_);
    result_.finite = result_.finite && force.allFinite() && position.allFinite();
    result_.force_peak_n = std::max(result_.force_peak_n, force.norm());
    result_.over_cap_n = std::max(result_.over_cap_n, force.norm() - cap_);
    result_.over_slew_n = std::max(result_.over_slew_n, (force - force_).norm() - step_);
    position_ = position;
    force_ = force;
    known_ = true;
    hash_.Add(run.haptic_tick());
    if (world_ticked) WorldTick(run);
  }

  StirResult Finish(const CoupledRun& run) {
    const protocol::HapticHealth& health = run.haptic_health();
    const protocol::Books& books = health.books;
    const protocol::ImpulseUnits settled = protocol::Plus(books.applied, books.discarded);
    result_.unaccounted_ns = Length(protocol::Minus(books.displayed, settled));
    result_.displayed_ns = Length(books.displayed);
    result_.discarded_ns = Length(books.discarded);
    result_.largest_jump_m = health.reconciliation.largest_jump;
    result_.flagged = health.energy.flagged;
    result_.hash = hash_.value();
    return result_;
  }

 private:
  void WorldTick(const CoupledRun& run) {
    const std::vector<protocol::Body>& bodies = run.world().Bodies();
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Vec3 way = ToVec3(bodies[i].position) - ToVec3(start_[i].position);
      result_.finite = result_.finite && way.allFinite() &&
                       ToVec3(bodies[i].velocity).allFinite() &&
                       ToVec3(bodies[i].angular_velocity).allFinite();
      result_.farthest_m = std::max(result_.farthest_m, way.norm());
      hash_.Add(bodies[i]);
    }
    const double energy_j = EnergyOf(scene_, bodies) - start_j_;
    // What rendering gave away, a held force that lags, went to the hand or into the bodies.
    const double given_j = result_.work_j + std::max(0.0, run.haptic_health().energy.injected);
    result_.energy_peak_j = std::max(result_.energy_peak_j, energy_j);
    result_.energy_excess_j = std::max(result_.energy_excess_j, energy_j - given_j);
    result_.world_us.push_back(1e6 * run.effort().world_s);
  }

  const world::Scene& scene_;
  double cap_;
  double step_;  // N, per tick
  double start_j_;
  std::vector<protocol::Body> start_;
  bool known_ = false;
  Vec3 position_ = Vec3::Zero();
  Vec3 force_ = Vec3::Zero();
  Hash hash_;
  StirResult result_;
};

}  // namespace

std::string Broken(const StirResult& got) {
  std::ostringstream words;
  if (!got.finite) words << "not finite; ";
  if (got.over_cap_n > kForceRounding) words << got.over_cap_n << " N above the cap; ";
  if (got.over_slew_n > kForceRounding) words << got.over_slew_n << " N beyond the slew limit; ";
  if (got.unaccounted_ns != 0) words << got.unaccounted_ns << " N s in no book; ";
  if (!(got.energy_excess_j <= kEnergyFloor + kEnergyShare * std::abs(got.work_j))) {
    words << got.energy_excess_j << " J from nowhere, at a work of " << got.work_j << " J; ";
  }
  if (!(got.farthest_m <= kFarthest)) words << "a body " << got.farthest_m << " m away; ";
  return words.str();
}

StirResult SimulateStir(const Stir& stir) {
  haptic::Settings haptic_settings;
  haptic_settings.safety.passivity_controller = stir.passivity_controller;
  world::Settings world_settings;
  world_settings.loop.rate_hz = stir.world_rate_hz;
  world_settings.coupling.coupling = stir.coupling;
  const auto ticks = [&](double time_s) {
    return std::llround(time_s * 1e9 / static_cast<double>(haptic_settings.period_ns()));
  };
  const long long lead = ticks(kLead);
  const haptic::MotorProgram::Script script = Script(stir);
  double script_s = kSettling;
  for (const haptic::Stroke& stroke : script.strokes) script_s += stroke.duration_s;
  IdealDevice device(haptic::Hand(haptic::MotorProgram(script), kHand),
                     CoupledRun::StartNs(haptic_settings) + lead * haptic_settings.period_ns());
  CoupledRun run(haptic_settings, device, world_settings, stir.scene,
                 world::MakeDynamics(stir.scene, world_settings.physics.substep_ms * 1e-3),
                 /*phase_ticks=*/0);
  Watch watch(stir.scene, haptic_settings, run);
  for (long long k = 0; k < lead + ticks(script_s); ++k) {
    const bool world_ticked = run.Tick();
    watch.Tick(run, world_ticked);
  }
  return watch.Finish(run);
}

}  // namespace rikiseki::lab
