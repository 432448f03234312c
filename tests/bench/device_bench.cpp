// SPDX-License-Identifier: MIT
// What a tick's arithmetic between encoder counts and tensions costs: lengths -> position -> tensions
// of four strings, lengths -> pose -> tensions of eight; and packets -> counts, tensions -> packets of
// the two boards on the USB, without the bus. Per tick, p50 and p99 over a grip that moves
// at 0.5 m/s under forces of which the strings cannot show the largest; the clock's own cost taken
// off:
//
//   device_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=5
//
// Aims: 1 us p50 with four strings, 6 us with eight.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "haptic_server/device/spidar_kinematics.h"
#include "haptic_server/device/spidar_pose.h"
#include "haptic_server/device/tension.h"
#include "haptic_server/device/usb/usb_board.h"
#include "haptic_server/device/wrench_tension.h"
#include "tests/bench/tick_clock.h"
#include "tests/haptic_server/device/g6x3.h"
#include "tests/usb/canned_port.h"

namespace rikiseki::haptic {
namespace {

constexpr std::size_t kTicks = 20'000;
constexpr double kTickSeconds = 1e-3;
constexpr double kCountLength = 2.92406e-5;  // m
constexpr double kRest = 1;                  // N

double Rounded(double length, double count_length) {
  return std::round(length / count_length) * count_length;
}

// Times `tick(k)` for every k and reports.
template <typename Tick>
void TimeTicks(benchmark::State& state, const Tick& tick) {
  std::vector<double> durations;
  durations.reserve(kTicks);
  std::size_t k = 0;
  for (auto _ : state) {
    const auto start = Clock::now();
    tick(k);
    const double took_s = std::chrono::duration<double>(Clock::now() - start).count();
    state.SetIterationTime(took_s);
    durations.push_back(1e6 * took_s);
    k = (k + 1) % kTicks;
  }
  const double clock = ClockCost();
  state.counters["p50_us"] = Quantile(durations, 0.5) - clock;
  state.counters["p99_us"] = Quantile(durations, 0.99) - clock;
}

// A way about the centre at 0.5 m/s.
Vec3 GripAt(std::size_t k, double radius_m) {
  const double angle = 0.5 * kTickSeconds * static_cast<double>(k) / radius_m;
  return radius_m * Vec3(std::cos(angle), std::sin(angle), 0.5 * std::sin(0.37 * angle));
}

void FourStringTick(benchmark::State& state) {
  const double h = 0.265;
  const SpidarKinematics kinematics(
      {Vec3(-h, h, h), Vec3(h, h, -h), Vec3(-h, -h, -h), Vec3(h, -h, h)});
  std::mt19937_64 random(1);
  std::vector<PerString> lengths;
  std::vector<Vec3> forces;
  for (std::size_t k = 0; k < kTicks; ++k) {
    lengths.push_back(kinematics.Lengths(GripAt(k, 0.1)));
    for (double& length : lengths.back()) length = Rounded(length, kCountLength);
    forces.push_back(RandomInBall(random, static_cast<double>(state.range(0))));
  }
  TimeTicks(state, [&](std::size_t k) {
    const Vec3 position = kinematics.Solve(lengths[k]).position;
    std::array<Vec3, kTensionStrings> directions;
    for (std::size_t i = 0; i < kTensionStrings; ++i) {
      directions[i] = (kinematics.motor(i) - position).stableNormalized();
    }
    benchmark::DoNotOptimize(AllocateTensions(directions, forces[k], {0.5, 20}));
  });
}

void EightStringTick(benchmark::State& state) {
  const SpidarPose kinematics(G6X3Motors(), G6X3Attachments());
  std::mt19937_64 random(2);
  std::vector<EightStrings> lengths;
  std::vector<Wrench> wrenches;
  for (std::size_t k = 0; k < kTicks; ++k) {
    const Vec3 position = GripAt(k, 0.015);
    const Pose pose{position, Quat(Eigen::AngleAxisd(20 * position.x(), Vec3::UnitZ()))};
    lengths.push_back(kinematics.Lengths(pose));
    for (double& length : lengths.back()) length = Rounded(length, kG6X3CountLength);
    const auto size = static_cast<double>(state.range(0));
    wrenches.push_back({RandomInBall(random, size), RandomInBall(random, 0.01 * size)});
  }
  Pose pose;
  TimeTicks(state, [&](std::size_t k) {
    pose = kinematics.Solve(lengths[k], pose).pose;
    benchmark::DoNotOptimize(
        AllocateWrench(kinematics.StringsAt(pose), wrenches[k], kG6X3Bounds, kRest));
  });
}

void UsbBoardTick(benchmark::State& state) {
  UsbSettings usb;
  usb.board = state.range(0) == 203 ? UsbBoardModel::kSimple : UsbBoardModel::kSh4;
  UsbBoard board(usb, 0.5, std::make_unique<test::CannedPort>(usb.board));
  EncoderCounts counts{};
  TimeTicks(state, [&](std::size_t k) {
    benchmark::DoNotOptimize(board.ReadCounts(static_cast<std::int64_t>(k), counts));
    const double pull = 1 + 1e-4 * static_cast<double>(k);
    benchmark::DoNotOptimize(board.WriteTensions({pull, 2, 3, pull}));
  });
}

// The number is the product id of the board.
BENCHMARK(UsbBoardTick)
    ->Arg(203)
    ->Arg(205)
    ->UseManualTime()
    ->Iterations(kTicks)
    ->Unit(benchmark::kMicrosecond);
// The number is the largest force [N]; beside it, of the eight, a hundredth of it in N m.
BENCHMARK(FourStringTick)
    ->Arg(5)
    ->Arg(50)
    ->UseManualTime()
    ->Iterations(kTicks)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(EightStringTick)
    ->Arg(5)
    ->Arg(50)
    ->UseManualTime()
    ->Iterations(kTicks)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rikiseki::haptic

BENCHMARK_MAIN();
