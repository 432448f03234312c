// SPDX-License-Identifier: MIT
// What one haptic tick in contact computes: feature track, contact solve, surface force, safety,
// ledger, local bodies and the message, without a device's input and output. Per tick, p50 and p99,
// the clock's own cost taken off:
//
//   haptic_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=5
//
// The three numbers of a name are planes, local bodies, and whether the finger rubs.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "haptic_server/step.h"
#include "tests/bench/tick_clock.h"
#include "tests/haptic_server/test_device.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr int kTicksPerFrame = 50;
constexpr double kDepth = 0.001;  // m
constexpr double kRadius = 0.01;  // m

// A plane through the origin's neighbourhood; `i` tilts it, so that several push at once.
protocol::Plane MakePlane(std::uint32_t i, std::uint32_t bodies, bool rubs) {
  const double turn = 2.4 * i;  // the golden angle: directions spread evenly
  const double tilt = i == 0 ? 0 : 0.3 + 0.02 * i;
  const Vec3 normal(-std::cos(tilt), std::sin(tilt) * std::cos(turn),
                    std::sin(tilt) * std::sin(turn));
  protocol::Plane plane;
  plane.body = bodies > 0 ? i % bodies : 0;
  plane.feature = i;
  plane.normal = ToArray(normal);
  if (bodies == 0) plane.inverse_mass = 0;
  if (rubs) {
    plane.static_friction = 0.5;
    plane.dynamic_friction = 0.4;
  }
  return plane;
}

// A 6 cm cube with its face at x = 0 on a floor.
protocol::LocalBody MakeCube(std::uint32_t body) {
  protocol::LocalBody cube;
  cube.body = body;
  cube.mass = 1;
  cube.inertia = {6e-4, 0, 0, 6e-4, 0, 6e-4};
  cube.position = {0.03, 0, 0};
  cube.acceleration = {0, 0, -9.81};
  for (const double x : {-0.03, 0.03}) {
    for (const double y : {-0.03, 0.03}) {
      protocol::ContactPlane& contact = cube.contacts[cube.contact_count++];
      contact.other_body = 100;
      contact.point = {x, y, -0.03};
      contact.normal = {0, 0, 1};
      contact.friction = 0.3;
    }
  }
  return cube;
}

// The haptic loop with a finger that rests in a frame's planes, timed tick by tick.
class Loop {
 public:
  Loop(const protocol::WorldFrame& frame, double finger_m, double radius_m)
      : frame_(frame), step_(WithRadius(radius_m), device_, /*own_epoch=*/1) {
    device_.next.position = Vec3(finger_m, 0, 0);
  }

  // The finger trembles along the surface: to and fro by `amplitude_m`.
  void Tremble(double amplitude_m) {
    const double side = device_.next.position.y() > 0 ? -1 : 1;
    device_.next.position.y() = side * amplitude_m;
    device_.next.velocity = Vec3(amplitude_m, 2 * side * amplitude_m, amplitude_m);
  }

  // Returns what the tick took [s], the clock included.
  double Tick() {
    const bool due = message_.tick % kTicksPerFrame == 0;
    if (due) {
      ++frame_.frame;
      frame_.acked_epoch = message_.tick > 0 ? 1 : 0;
      frame_.acked_tick = message_.tick;
    }
    world_.heartbeat_ns = now_ns_;
    world_.frame = due ? &frame_ : nullptr;
    const auto start = Clock::now();
    step_.Tick({.start_ns = now_ns_, .previous_duration_ns = kPeriodNs}, world_, message_);
    const auto end = Clock::now();
    now_ns_ += kPeriodNs;
    return std::chrono::duration<double>(end - start).count();
  }

  double force_n() const { return ToVec3(message_.pointers[0].force).norm(); }

 private:
  static Settings WithRadius(double radius_m) {
    Settings settings;
    settings.render.finger_radius_mm = 1e3 * radius_m;
    return settings;
  }

  protocol::WorldFrame frame_;
  TestDevice device_;
  HapticStep step_;
  protocol::HapticTick message_;
  WorldInput world_{.epoch = 1, .ready = true};
  std::int64_t now_ns_ = 1'000'000'000;
};

protocol::WorldFrame MakeFrame(std::uint32_t planes, std::uint32_t bodies, bool rubs) {
  protocol::WorldFrame frame;
  frame.period_ns = kTicksPerFrame * kPeriodNs;
  frame.plane_count = planes;
  for (std::uint32_t i = 0; i < planes; ++i) frame.planes[i] = MakePlane(i, bodies, rubs);
  frame.local_body_count = bodies;
  frame.local_substep_ns = kPeriodNs;
  for (std::uint32_t i = 0; i < bodies; ++i) frame.local_bodies[i] = MakeCube(i);
  return frame;
}

void HapticTickInContact(benchmark::State& state) {
  const auto planes = static_cast<std::uint32_t>(state.range(0));
  const auto bodies = static_cast<std::uint32_t>(state.range(1));
  Loop loop(MakeFrame(planes, bodies, state.range(2) != 0), kDepth - kRadius, kRadius);
  std::vector<double> durations;
  for (auto _ : state) {
    const double took_s = loop.Tick();
    state.SetIterationTime(took_s);
    if (durations.size() < 1'000'000) durations.push_back(took_s * 1e6);
  }
  const double clock = ClockCost();
  state.counters["p50_us"] = Quantile(durations, 0.5) - clock;
  state.counters["p99_us"] = Quantile(durations, 0.99) - clock;
  state.counters["force_n"] = loop.force_n();
}

BENCHMARK(HapticTickInContact)
    ->ArgsProduct({{1, 8, 32}, {0, 1, 4}, {0, 1}})
    ->UseManualTime()
    ->Iterations(20000)
    ->Unit(benchmark::kMicrosecond);

// A point finger that trembles by 10^-range(0) m on a rough plane that moves as slowly, tick for tick
// beside one that trembles by a micrometre. At 1e-310 the numbers themselves are denormal, at 1e-160
// their products are. It is a millimetre deep, or, with range(1) = 1, by that little too. The ratio of
// the medians has to stay below 2: numerics.md section 6.
void HapticTickOfDenormals(benchmark::State& state) {
  const double tiny = std::pow(10.0, -static_cast<double>(state.range(0)));
  const bool shallow = state.range(1) != 0;
  constexpr double kTremor = 1e-6;  // m
  protocol::WorldFrame frame = MakeFrame(1, 0, /*rubs=*/true);
  frame.planes[0].velocity = {kTremor, kTremor, kTremor};
  Loop common(frame, kDepth, /*radius_m=*/0);
  if (shallow) frame.planes[0].point = {-tiny, tiny, tiny};
  frame.planes[0].velocity = {tiny, tiny, tiny};
  Loop denormal(frame, shallow ? tiny : kDepth, /*radius_m=*/0);
  std::vector<double> usual, slow;
  for (auto _ : state) {
    common.Tremble(kTremor);
    usual.push_back(common.Tick() * 1e6);
    denormal.Tremble(tiny);
    slow.push_back(denormal.Tick() * 1e6);
    state.SetIterationTime(slow.back() * 1e-6);
  }
  const double clock = ClockCost();
  state.counters["usual_p50_us"] = Quantile(usual, 0.5) - clock;
  state.counters["p50_us"] = Quantile(slow, 0.5) - clock;
  state.counters["ratio"] = (Quantile(slow, 0.5) - clock) / (Quantile(usual, 0.5) - clock);
  state.counters["force_n"] = denormal.force_n();
}

BENCHMARK(HapticTickOfDenormals)
    ->ArgsProduct({{310, 160}, {0, 1}})
    ->UseManualTime()
    ->Iterations(20000)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rikiseki::haptic

BENCHMARK_MAIN();
