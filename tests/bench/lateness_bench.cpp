// SPDX-License-Identifier: MIT
// How late the haptic loop wakes up, against a bare loop that only sleeps until its deadlines: pairs of
// runs in turn, so that what else the machine does meets both. The loop should add nothing of its own, and
// take no page fault once it runs.
//
//   lateness_bench [PAIRS [SECONDS]]     (7 pairs of 10 s; a run has at least 2 s)
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/clock.h"
#include "common/histogram.h"
#include "common/realtime.h"
#include "haptic_server/device/make_device.h"
#include "haptic_server/loop.h"
#include "protocol/attach.h"

namespace rikiseki::haptic {
namespace {

constexpr double kStartSeconds = 1;

struct Result {
  HistogramCounts lateness{};
  std::uint64_t missed = 0;
  std::uint64_t start_faults = 0;  // page faults of the loop's thread in its first second
  std::uint64_t later_faults = 0;  // and in all others
  std::string policy;
};

// `look` is called beside it after the first second.
template <typename Body, typename Look>
std::string OnRealtimeThread(const Settings& settings, double seconds, Body body, Look look) {
  std::atomic<bool> stop{false};
  const std::int64_t start_ns = MonotonicNow();
  RealtimeThread thread({.fifo_priority = settings.loop.fifo_priority, .cpu = settings.loop.cpu},
                        [&] { body(stop); });
  SleepUntil(start_ns + static_cast<std::int64_t>(kStartSeconds * 1e9));
  look();
  SleepUntil(start_ns + static_cast<std::int64_t>(seconds * 1e9));
  stop = true;
  thread.Join();
  return PolicyName(thread.obtained().policy, thread.obtained().priority);
}

Result Bare(const Settings& settings, double seconds) {
  Result result;
  const auto body = [&](const std::atomic<bool>& stop) {
    PeriodicSchedule schedule(MonotonicNow(), settings.period_ns());
    while (!stop) {
      SleepUntil(schedule.deadline_ns());
      const std::int64_t now_ns = MonotonicNow();
      ++result.lateness[HistogramBucket(now_ns - schedule.deadline_ns())];
      result.missed += static_cast<std::uint64_t>(schedule.Advance(now_ns));
    }
  };
  result.policy = OnRealtimeThread(settings, seconds, body, [] {});
  return result;
}

std::uint64_t FaultsOf(const protocol::HapticHealth& health) {
  return health.minor_faults + health.major_faults;
}

// As the loop published them last.
std::uint64_t FaultsNow(const std::string& instance) {
  const protocol::AttachResult result = protocol::Attach(
      {.instance = instance, .role = protocol::Role::kHaptic, .required = {}, .owners = {}});
  protocol::HapticHealth health;
  if (result.view != nullptr) {
    result.view->Reader<protocol::HapticHealth>().ReadLatest(health);
  }
  return FaultsOf(health);
}

Result Haptic(const Settings& settings, double seconds) {
  const std::string instance = "lateness-bench-" + std::to_string(getpid());
  const auto period_ns = static_cast<std::uint64_t>(settings.period_ns());
  const auto device = MakeDevice(settings);
  protocol::SegmentOwner owner({.instance = instance,
                                .role = protocol::Role::kHaptic,
                                .streams = protocol::HapticStreams(period_ns, 1024, 10 * period_ns),
                                .build = "bench",
                                .runtime_directory = ""});
  protocol::PeerLink link(
      {.peer = {
           .instance = instance, .role = protocol::Role::kWorld, .required = {}, .owners = {}}});
  HapticStep step(settings, *device, owner.epoch());
  OperatorPanel panel;
  HapticLoop loop(settings, step, owner, link, panel);
  Result result;
  result.policy = OnRealtimeThread(
      settings, seconds, [&](const std::atomic<bool>& stop) { loop.Run(stop); },
      [&] { result.start_faults = FaultsNow(instance); });
  result.lateness = loop.health().lateness;
  result.missed = loop.health().missed;
  result.later_faults = FaultsOf(loop.health()) - result.start_faults;
  return result;
}

double Microseconds(const HistogramCounts& lateness, double fraction) {
  return static_cast<double>(HistogramQuantile(lateness, fraction)) * 1e-3;
}

int Run(int pairs, double seconds) {
  Settings settings =
      LoadSettings(std::string(RIKISEKI_SOURCE_DIR) + "/config/haptic_server.ini", {});
  const std::string refusal = LockMemory();
  if (!refusal.empty()) std::printf("memory not locked: %s\n", refusal.c_str());
  std::printf("pair  loop    policy           p50 us   p99 us p99.9 us   max us  missed\n");
  std::vector<double> ratios;
  std::uint64_t start_faults = 0;
  std::uint64_t later_faults = 0;
  for (int pair = 1; pair <= pairs; ++pair) {
    // Whoever goes first changes from pair to pair.
    Result bare;
    Result haptic;
    if (pair % 2 == 1) bare = Bare(settings, seconds);
    haptic = Haptic(settings, seconds);
    if (pair % 2 == 0) bare = Bare(settings, seconds);
    for (const auto& [name, result] : {std::pair("bare", &bare), std::pair("haptic", &haptic)}) {
      std::printf("%4d  %-6s  %-14s %8.0f %8.0f %8.0f %8.0f %7lu\n", pair, name,
                  result->policy.c_str(), Microseconds(result->lateness, 0.5),
                  Microseconds(result->lateness, 0.99), Microseconds(result->lateness, 0.999),
                  Microseconds(result->lateness, 1), result->missed);
    }
    std::fflush(stdout);
    start_faults += haptic.start_faults;
    later_faults += haptic.later_faults;
    ratios.push_back(Microseconds(haptic.lateness, 0.99) / Microseconds(bare.lateness, 0.99));
  }
  std::sort(ratios.begin(), ratios.end());
  std::printf("ratio of p99, haptic / bare: median %.2f, from %.2f to %.2f\n",
              ratios[ratios.size() / 2], ratios.front(), ratios.back());
  std::printf("page faults of the haptic loop: %lu in the first seconds, %lu in all others\n",
              start_faults, later_faults);
  return 0;
}

}  // namespace
}  // namespace rikiseki::haptic

int main(int argc, char** argv) {
  return rikiseki::haptic::Run(std::max(1, argc > 1 ? std::atoi(argv[1]) : 7),
                               std::max(2.0, argc > 2 ? std::atof(argv[2]) : 10));
}
