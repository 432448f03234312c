// SPDX-License-Identifier: MIT
// What a test sees of a running pair: an observer of both segments that reads every haptic tick and holds
// it against the promises of the safety stage.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "protocol/attach.h"
#include "protocol/impulse_units.h"
#include "protocol/messages.h"

namespace rikiseki::test {

/// Attaches as an observer, waiting up to `seconds` for the owner. Fails the test if there is none.
std::unique_ptr<protocol::PeerView> Observe(const std::string& instance, protocol::Role role,
                                            double seconds = 10);

/// Polls until `condition` holds, at most `seconds`; whether it came to hold.
bool Eventually(const std::function<bool()>& condition, double seconds = 10);

/// What the watch keeps of one tick.
struct WatchedTick {
  std::uint64_t tick = 0;
  std::uint64_t start_ns = 0;
  std::uint64_t world_frame = 0;
  double force = 0;  // N
  double force_x = 0;
  double finger_x = 0;  // m
  protocol::ForceReason reason{};
  protocol::ImpulseUnits displayed{};  // growth of all channels since the watch began
};

/// Reads every tick of one haptic epoch on a thread of its own.
class TickWatch {
 public:
  /// `slew_limit` [N/s] and the cap in the messages are what it judges by.
  TickWatch(const std::string& instance, double slew_limit_n_per_s);
  ~TickWatch();

  WatchedTick Latest() const;
  std::vector<WatchedTick> All() const;
  std::uint64_t lost() const { return lost_; }
  bool finite() const { return finite_; }
  double worst_over_cap() const { return worst_over_cap_; }    // N above the cap, <= 0 is good
  double worst_over_slew() const { return worst_over_slew_; }  // N above the step allowed per tick
  double largest_work() const {
    return largest_work_;
  }  // J, the most that the hand ever had done; no tick lost

 private:
  void Run();

  std::unique_ptr<protocol::PeerView> view_;
  double slew_limit_;
  mutable std::mutex mutex_;
  std::vector<WatchedTick> ticks_;
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<bool> finite_{true};
  std::atomic<double> worst_over_cap_{-1e9};
  std::atomic<double> worst_over_slew_{-1e9};
  std::atomic<double> largest_work_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// The newest health of either side; waits for the first.
protocol::HapticHealth ReadHapticHealth(const protocol::PeerView& view);
protocol::WorldHealth ReadWorldHealth(const protocol::PeerView& view);
protocol::WorldFrame ReadWorldFrame(const protocol::PeerView& view);
/// The first body that can move.
protocol::Body ReadMovingBody(const protocol::PeerView& view);

/// How often the machine kept a loop of the pair from its deadline: late by more than a tick at 1 kHz, or
/// by more than a tenth of a period of the world.
std::uint64_t Disturbances(const protocol::PeerView& haptic, const protocol::PeerView& world);

double Norm(const protocol::Vector& v);
/// Length of an impulse, N s.
double Norm(const protocol::ImpulseUnits& units);

/// The promises that hold at every tick, whatever happens to the world.
void CheckSafe(const TickWatch& watch);

/// What the finger presses against.
enum class Pushed {
  kMovable,
  kFixed,  // the ground may have it all (SPEC.md 7.2-10), and the books of bodies stay empty
};

/// Waits until nothing is under way and checks that the haptic side's books balance to the unit, and
/// that something stands in them.
protocol::Books SettledBooks(const protocol::PeerView& haptic, Pushed pushed = Pushed::kMovable);

}  // namespace rikiseki::test
