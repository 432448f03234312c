// SPDX-License-Identifier: MIT
#include "haptic_server/selftest.h"

#include <sched.h>
#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "common/histogram.h"
#include "common/realtime.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kMicrosecond = 1000;  // ns

std::string Microseconds(std::int64_t ns) {
  return std::to_string(ns / kMicrosecond) + " us";
}

bool KernelIsRealtime() {
  utsname name{};
  return uname(&name) == 0 && std::string(name.version).find("PREEMPT_RT") != std::string::npos;
}

std::string Governor() {
  std::ifstream file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  std::string governor;
  file >> governor;
  return governor;  // empty: this machine has none
}

// A bar for each power of two that something fell into.
std::string Bars(const protocol::Histogram& lateness) {
  constexpr std::size_t kPerOctave = 8;
  const auto total = static_cast<double>(HistogramTotal(lateness));
  std::ostringstream text;
  for (std::size_t first = 0; first < lateness.size();) {
    const std::size_t end = first == 0 ? 1 : std::min(first + kPerOctave, lateness.size());
    std::uint64_t count = 0;
    for (std::size_t i = first; i < end; ++i) count += lateness[i];
    if (count > 0) {
      const double share = static_cast<double>(count) / total;
      text << "  from " << Microseconds(HistogramLowerEdge(first)) << ": " << count << " "
           << std::string(static_cast<std::size_t>(std::ceil(50 * share)), '#') << "\n";
    }
    first = end;
  }
  return text.str();
}

}  // namespace

Hold Judge(const protocol::HapticHealth& health, double seconds) {
  const std::int64_t p99_9 = HistogramQuantile(health.lateness, 0.999);
  const std::int64_t worst = HistogramQuantile(health.lateness, 1);
  if (health.ticks == 0) return Hold::kNot;
  if (p99_9 < 50 * kMicrosecond && worst < 200 * kMicrosecond && health.missed == 0) {
    return Hold::kWell;
  }
  const double allowed = std::max(1.0, seconds / 60);
  const bool enough = p99_9 < 200 * kMicrosecond && static_cast<double>(health.missed) <= allowed &&
                      health.worst_missed_in_a_row < 3;
  return enough ? Hold::kEnough : Hold::kNot;
}

std::string SelftestReport(const protocol::HapticHealth& health, double seconds,
                           const std::vector<std::string>& refusals) {
  std::ostringstream text;
  const Hold hold = Judge(health, seconds);
  switch (hold) {
    case Hold::kWell:
      text << "This PC holds the loop well.\n";
      break;
    case Hold::kEnough:
      text << "This PC holds the loop, with rare delays that a hand may feel.\n";
      break;
    case Hold::kNot:
      text << "This PC does not hold the loop: forces will be late, and contacts may buzz.\n";
      break;
  }
  text << health.ticks << " ticks in " << seconds << " s, " << health.missed
       << " deadlines missed, at most " << health.worst_missed_in_a_row << " in a row; "
       << PolicyName(static_cast<int>(health.scheduling.policy),
                     static_cast<int>(health.scheduling.priority))
       << ", memory " << (health.scheduling.memory_locked != 0 ? "locked" : "not locked") << "\n"
       << "woken late by: p50 " << Microseconds(HistogramQuantile(health.lateness, 0.5)) << ", p99 "
       << Microseconds(HistogramQuantile(health.lateness, 0.99)) << ", p99.9 "
       << Microseconds(HistogramQuantile(health.lateness, 0.999)) << ", at most "
       << Microseconds(HistogramQuantile(health.lateness, 1)) << "\n"
       << Bars(health.lateness);
  for (const std::string& refusal : refusals) {
    if (!refusal.empty()) {
      text << "To change: " << refusal
           << ": be in the group haptics, or see config/README.md for the service.\n";
    }
  }
  if (hold == Hold::kWell) return text.str();
  if (!KernelIsRealtime()) {
    text << "To change: this kernel is not PREEMPT_RT (Debian: linux-image-rt-amd64).\n";
  }
  if (const std::string governor = Governor(); !governor.empty() && governor != "performance") {
    text << "To change: the processor's governor is " << governor << ".\n";
  }
  text << "scripts/tune_host shows what else disturbs, and changes it.\n";
  return text.str();
}

}  // namespace rikiseki::haptic
