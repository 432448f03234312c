// What one haptic tick in contact computes: feature track, contact solve, surface force, safety,
// ledger, local bodies and the message, without a device's input and output. Per tick, p50 and p99:
//
//   haptic_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=5
//
// The three numbers of a name are planes, local bodies, and whether the finger rubs.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "haptic_server/step.h"
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

void HapticTickInContact(benchmark::State& state) {
  const auto planes = static_cast<std::uint32_t>(state.range(0));
  const auto bodies = static_cast<std::uint32_t>(state.range(1));
  const bool rubs = state.range(2) != 0;
  protocol::WorldFrame frame;
  frame.period_ns = kTicksPerFrame * kPeriodNs;
  frame.plane_count = planes;
  for (std::uint32_t i = 0; i < planes; ++i) frame.planes[i] = MakePlane(i, bodies, rubs);
  frame.local_body_count = bodies;
  frame.local_substep_ns = kPeriodNs;
  for (std::uint32_t i = 0; i < bodies; ++i) frame.local_bodies[i] = MakeCube(i);

  TestDevice device;
  device.next.position = Vec3(kDepth - kRadius, 0, 0);
  HapticStep step(Settings{}, device, /*own_epoch=*/1);
  protocol::HapticTick message;
  WorldInput world{.epoch = 1, .ready = true};
  std::int64_t now_ns = 1'000'000'000;
  std::vector<double> durations;
  for (auto _ : state) {
    const bool due = message.tick % kTicksPerFrame == 0;
    if (due) {
      ++frame.frame;
      frame.acked_epoch = message.tick > 0 ? 1 : 0;
      frame.acked_tick = message.tick;
    }
    world.heartbeat_ns = now_ns;
    world.frame = due ? &frame : nullptr;
    const auto start = std::chrono::steady_clock::now();
    step.Tick({.start_ns = now_ns, .previous_duration_ns = kPeriodNs}, world, message);
    const auto end = std::chrono::steady_clock::now();
    const double took_s = std::chrono::duration<double>(end - start).count();
    state.SetIterationTime(took_s);
    if (durations.size() < 1'000'000) durations.push_back(took_s * 1e6);
    now_ns += kPeriodNs;
  }
  std::sort(durations.begin(), durations.end());
  const auto quantile = [&](double q) {
    return durations[static_cast<std::size_t>(q * static_cast<double>(durations.size() - 1))];
  };
  state.counters["p50_us"] = quantile(0.5);
  state.counters["p99_us"] = quantile(0.99);
  state.counters["force_n"] = ToVec3(message.pointers[0].force).norm();
}

BENCHMARK(HapticTickInContact)
    ->ArgsProduct({{1, 8, 32}, {0, 1, 4}, {0, 1}})
    ->UseManualTime()
    ->Iterations(20000)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rikiseki::haptic

BENCHMARK_MAIN();
