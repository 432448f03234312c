// SPDX-License-Identifier: MIT
#include "tests/lab/buzz_run.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string_view>

#include "haptic_server/device/make_device.h"
#include "tests/lab/coupled_run.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kHapticPeriod = 1e-3;    // s
constexpr double kAfter = 0.5;            // s, at home again
constexpr double kFriction = 0.3;         // of cube and floor
constexpr std::size_t kBeforeTouch = 50;  // ticks
constexpr std::size_t kTouchTicks = 1000;

// The device of config/devices/simulated.ini.
const std::vector<Vec3> kMotors = {{-0.265, 0.265, 0.265},
                                   {0.265, 0.265, -0.265},
                                   {-0.265, -0.265, -0.265},
                                   {0.265, -0.265, 0.265}};

haptic::Settings HapticSettings(const BuzzRun& run) {
  haptic::Settings settings;
  settings.loop.rate_hz = 1 / kHapticPeriod;
  settings.spidar.motors_m = kMotors;
  settings.hand = HandThat(run.touch);
  if (!run.coupling) settings.render.display = haptic::DisplayRule::kHold;
  return settings;
}

world::Settings WorldSettings(const BuzzRun& run) {
  world::Settings settings;
  settings.loop.rate_hz = 1 / (run.coupling ? run.world_period_s : kHapticPeriod);
  settings.coupling.coupling = run.coupling.value_or(protocol::Coupling::kImpulse);
  settings.features.finger_friction = run.touch.finger_friction;
  return settings;
}

world::Scene OnFloor(PushedShape shape, double mass_kg) {
  world::SceneBody floor;
  floor.name = "floor";
  floor.fixed = true;
  floor.pose_WB.position.z() = -kCubeHalf;
  floor.colliders.push_back({.shape = world::HalfSpace{}, .friction = kFriction});
  world::Scene scene;
  scene.name = "light";
  scene.bodies = {MakePushed(shape, mass_kg, kFriction, Vec3::Zero()), floor};
  return scene;
}

// Of the sum of squares of `signal`, what lies in the components up to kBuzzHz.
double SlowSquares(const std::vector<double>& signal) {
  const std::size_t n = signal.size();
  const auto slowest_fast =
      static_cast<std::size_t>(kBuzzHz * kHapticPeriod * static_cast<double>(n));
  double squares = 0;
  for (std::size_t k = 0; k <= slowest_fast; ++k) {
    double re = 0;
    double im = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double phase =
          2 * std::numbers::pi * static_cast<double>(k * i % n) / static_cast<double>(n);
      re += signal[i] * std::cos(phase);
      im += signal[i] * std::sin(phase);
    }
    squares += (k == 0 ? 1 : 2) * (re * re + im * im) / static_cast<double>(n);
  }
  return squares;
}

double Squares(const std::vector<double>& signal) {
  double sum = 0;
  for (const double x : signal) sum += x * x;
  return sum;
}

}  // namespace

haptic::HandSettings HandThat(const Touch& touch) {
  haptic::HandSettings hand;
  hand.home_mm = touch.home_mm;
  hand.stroke_mm = touch.stroke_mm;
  hand.reach_ms = touch.reach_ms;
  hand.hold_ms = touch.hold_ms;
  hand.rest_ms = kHandRestMs;
  return hand;
}

std::vector<double> SimulateBuzz(const BuzzRun& run) {
  const haptic::Settings haptic_settings = HapticSettings(run);
  const world::Settings world_settings = WorldSettings(run);
  const world::Scene scene = OnFloor(run.shape, run.mass_kg);
  const std::unique_ptr<haptic::Device> device = haptic::MakeDevice(haptic_settings);
  CoupledRun loops(
      haptic_settings, *device, world_settings, scene,
      std::make_unique<world::BulletWorld>(scene, world_settings.physics.substep_ms * 1e-3),
      run.phase_ticks, run.latency_ticks);
  const haptic::HandSettings& hand = haptic_settings.hand;
  const double duration_s =
      1e-3 * (hand.rest_ms + hand.reach_ms + hand.hold_ms + hand.return_ms) + kAfter;
  std::vector<double> force;
  for (long long k = 0; k < std::llround(duration_s / kHapticPeriod); ++k) {
    loops.Tick();
    force.push_back(ToVec3(loops.haptic_tick().pointers[0].force).norm());
  }
  return force;
}

std::vector<double> TouchOf(const std::vector<double>& force) {
  const auto touched =
      std::find_if(force.begin(), force.end(), [](double f) { return f > kTouched; });
  const auto index = static_cast<std::size_t>(touched - force.begin());
  const std::size_t from = index - std::min(index, kBeforeTouch);
  std::vector<double> touch(
      force.begin() + static_cast<std::ptrdiff_t>(from),
      force.begin() + static_cast<std::ptrdiff_t>(std::min(from + kTouchTicks, force.size())));
  touch.resize(kTouchTicks, 0);
  return touch;
}

double EnergyAbove(const std::vector<double>& force) {
  return std::max(0.0, Squares(force) - SlowSquares(force)) * kHapticPeriod;
}

std::vector<double> AtRest(const Touch& touch, const std::vector<double>& force) {
  const auto end =
      std::lround(1e-3 * (kHandRestMs + touch.reach_ms + touch.hold_ms) / kHapticPeriod);
  return {force.begin() + end - static_cast<std::ptrdiff_t>(kTouchTicks), force.begin() + end};
}

double RmsAbove(const std::vector<double>& force) {
  const std::size_t n = force.size();
  double mean = 0;
  for (const double f : force) mean += f / static_cast<double>(n);
  std::vector<double> windowed(n);
  double window_squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double phase = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    const double window = 0.5 - 0.5 * std::cos(phase);
    windowed[i] = window * (force[i] - mean);
    window_squares += window * window;
  }
  return std::sqrt(std::max(0.0, Squares(windowed) - SlowSquares(windowed)) / window_squares);
}

double QuietRms(const haptic::Settings& settings) {
  return 1.5 * settings.spidar.count_length_m * settings.render.stiffness_n_per_m;
}

bool IsPress(const Touch& touch) {
  return touch.name == std::string_view(kPressTouch.name);
}

BuzzComparison CompareBuzz(BuzzRun run, int phases) {
  const auto measure = [&run](const std::vector<double>& force) {
    return IsPress(run.touch) ? RmsAbove(AtRest(run.touch, force)) : EnergyAbove(TouchOf(force));
  };
  BuzzRun single = run;
  single.coupling.reset();
  single.latency_ticks = single.phase_ticks = 0;
  BuzzComparison all;
  all.single = measure(SimulateBuzz(single));
  all.quiet_rms_n = QuietRms(HapticSettings(run));
  const double ticks_per_period = std::round(run.world_period_s / kHapticPeriod);
  for (int i = 0; i < phases; ++i) {
    run.phase_ticks = static_cast<int>(std::lround(i * ticks_per_period / phases));
    const std::vector<double> force = SimulateBuzz(run);
    const double got = measure(force);
    all.mean += got / phases;
    all.worst = std::max(all.worst, got);
    all.peak_n = std::max(all.peak_n, *std::max_element(force.begin(), force.end()));
  }
  return all;
}

}  // namespace rikiseki::lab
