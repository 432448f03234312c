// SPDX-License-Identifier: MIT
#include "tests/lab/cube_push.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "tests/lab/prescribed_device.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kSettling = 0.5;          // s, of the world alone, before anything else
constexpr double kForceFrom = 0.2;         // s: mean and SD of the force begin here
constexpr double kUnlimited = 1e9;         // for limits that must not act: N, N/s, m/s, mm
constexpr double kRunawayDistance = 1000;  // m: nothing on a lab's floor, but a loop that diverged

// The written experiment knows no limits: they are set so wide that they never act.
haptic::Settings HapticSettings(const CubePush& push, const PushLoops& loops,
                                double world_period_s) {
  haptic::Settings settings;
  settings.loop.rate_hz = 1 / loops.haptic_period_s;
  settings.loop.longest_world_period_ms =
      std::max(settings.loop.longest_world_period_ms,
               1e3 * (world_period_s + loops.latency_ticks * loops.haptic_period_s));
  settings.render.stiffness_n_per_m = push.stiffness_n_per_m;
  settings.render.damping_ns_per_m = push.damping_ns_per_m;
  settings.render.display = loops.coupling ? loops.display : haptic::DisplayRule::kHold;
  settings.render.position_rule = loops.position_rule;
  settings.render.finger_radius_mm = kFingerRadius * 1e3;
  settings.safety.force_cap_n = kUnlimited;
  settings.safety.slew_limit_n_per_s = kUnlimited * 1e6;  // the whole cap in a microsecond
  settings.safety.speed_limit_m_per_s = kUnlimited;
  settings.safety.soft_start_ms = 0;
  return settings;
}

world::Settings WorldSettings(const PushLoops& loops, double world_period_s) {
  world::Settings settings;
  settings.loop.rate_hz = 1 / world_period_s;
  settings.coupling.coupling = loops.coupling.value_or(protocol::Coupling::kImpulse);
  settings.coupling.force_cap_n = kUnlimited;
  settings.features.radius_mm = kUnlimited;
  settings.physics.substep_ms = loops.substep_s * 1e3;
  return settings;
}

class ForceStatistics {
 public:
  void Add(double force_n, double t_s) {
    peak_ = std::max(peak_, force_n);
    if (t_s <= kForceFrom) return;
    // Welford: a constant force has an SD of exactly 0.
    ++count_;
    const double before = force_n - mean_;
    mean_ += before / count_;
    squares_ += before * (force_n - mean_);
  }
  double mean() const { return mean_; }
  double sd() const { return count_ > 0 ? std::sqrt(squares_ / count_) : 0; }
  double peak() const { return peak_; }

 private:
  double count_ = 0;
  double mean_ = 0;
  double squares_ = 0;
  double peak_ = 0;
};

double Yaw(const protocol::Body& body) {
  const Mat3 axes = ToQuat(body.orientation).toRotationMatrix();
  return std::atan2(axes(1, 0), axes(0, 0));
}

}  // namespace

PreparedRun PrepareCubePush(const CubePush& push, const PushLoops& loops) {
  const double world_period_s = loops.coupling ? loops.world_period_s : loops.haptic_period_s;
  const haptic::Settings haptic_settings = HapticSettings(push, loops, world_period_s);
  const world::Settings world_settings = WorldSettings(loops, world_period_s);
  const world::Scene scene = PushScene(push);
  auto dynamics = std::make_unique<world::BulletWorld>(scene, loops.substep_s);
  dynamics->ApplyAndStep({}, kSettling);
  const Vec3 start = dynamics->State(0).pose.position;

  // The loops have run for a while when the finger starts: for a whole world period, so that every
  // world tick of the script consumes one, and until frames arrive.
  const auto lead_ticks =
      std::llround(std::ceil(world_period_s / loops.haptic_period_s - 1e-9)) + loops.latency_ticks;
  PreparedRun prepared{
      .device = std::make_unique<PrescribedDevice>(
          [push, start](double t_s) { return FingerPosition(push, start, t_s); },
          CoupledRun::StartNs(haptic_settings) + lead_ticks * haptic_settings.period_ns()),
      .loops = nullptr,
      .duration_s = Duration(push)};
  prepared.loops =
      std::make_unique<CoupledRun>(haptic_settings, *prepared.device, world_settings, scene,
                                   std::move(dynamics), loops.phase_ticks, loops.latency_ticks);
  for (long long k = 0; k < lead_ticks; ++k) prepared.loops->Tick();
  return prepared;
}

PushResult SimulateCubePush(const CubePush& push, const PushLoops& loops) {
  const PreparedRun prepared = PrepareCubePush(push, loops);
  CoupledRun& run = *prepared.loops;
  const double start_x = run.world().Bodies()[0].position[0];
  ForceStatistics force;
  const long long ticks = std::llround(prepared.duration_s / loops.haptic_period_s);
  const auto tick = [&](long long k) {
    const bool world_ticked = run.Tick();
    if (k < ticks) {
      force.Add(ToVec3(run.haptic_tick().pointers[0].force).norm(),
                static_cast<double>(k) * loops.haptic_period_s);
    }
    return world_ticked;
  };
  // Until the world has ticked on every impulse of the script.
  for (long long k = 0; !(tick(k) && k >= ticks); ++k) {
  }

  const protocol::Body& cube = run.world().Bodies()[0];
  PushResult result{.displacement_m = cube.position[0] - start_x,
                    .yaw_rad = Yaw(cube),
                    .force_mean_n = force.mean(),
                    .force_sd_n = force.sd(),
                    .force_peak_n = force.peak(),
                    .largest_jump_m = run.haptic_health().reconciliation.largest_jump};
  result.diverged = !(std::abs(result.displacement_m) < kRunawayDistance) ||
                    !std::isfinite(result.force_mean_n) || !std::isfinite(result.yaw_rad);
  return result;
}

PushStatistics SimulateCubePushes(const CubePush& push, PushLoops loops, int phases) {
  const double ticks_per_period = std::round(loops.world_period_s / loops.haptic_period_s);
  const int runs = loops.coupling ? phases : 1;
  PushStatistics sum;
  sum.displacement_min_m = std::numeric_limits<double>::infinity();
  sum.displacement_max_m = -sum.displacement_min_m;
  double squares = 0;
  for (int i = 0; i < runs; ++i) {
    loops.phase_ticks = static_cast<int>(std::lround(i * ticks_per_period / runs));
    const PushResult result = SimulateCubePush(push, loops);
    const double before = result.displacement_m - sum.displacement_mean_m;
    sum.displacement_mean_m += before / (i + 1);
    squares += before * (result.displacement_m - sum.displacement_mean_m);
    sum.displacement_min_m = std::min(sum.displacement_min_m, result.displacement_m);
    sum.displacement_max_m = std::max(sum.displacement_max_m, result.displacement_m);
    sum.force_mean_n += (result.force_mean_n - sum.force_mean_n) / (i + 1);
    sum.force_sd_n = std::max(sum.force_sd_n, result.force_sd_n);
    sum.force_peak_n = std::max(sum.force_peak_n, result.force_peak_n);
    sum.jump_max_m = std::max(sum.jump_max_m, result.largest_jump_m);
    sum.yaw_rad += (result.yaw_rad - sum.yaw_rad) / (i + 1);
    sum.diverged = sum.diverged || result.diverged;
  }
  sum.displacement_sd_m = std::sqrt(squares / runs);
  return sum;
}

}  // namespace rikiseki::lab
