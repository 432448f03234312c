// SPDX-License-Identifier: MIT
// The pair pushes the block of push.sdf through emulated boards - real processes, real libusb - and it
// stops where it stops with the simulated device.
#include <signal.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <thread>

#include "tests/process/observer.h"
#include "tests/usb/emulated_bus.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::PeerState;
using protocol::Role;

constexpr double kSlewLimit = 5000;       // N/s, as set
constexpr double kAtHome = -0.045;        // m: the hand has come back
constexpr double kLongestPushS = 20;      // on a machine that others use
constexpr std::uint64_t kMostMissed = 2;  // deadlines, of the 400 or so of a push
constexpr int kEnough = 3;                // pushes, for a mean and its error

int Pushes() {
  return std::getenv("RIKISEKI_FULL") != nullptr ? 20 : 5;
}

struct Stops {
  double mean_m = 0;
  double standard_error_m = 0;
  int count = 0;
};

Stops StatisticsOf(const std::vector<double>& stops) {
  const auto n = static_cast<double>(stops.size());
  const double mean = std::accumulate(stops.begin(), stops.end(), 0.0) / n;
  double squares = 0;
  for (const double stop : stops) squares += (stop - mean) * (stop - mean);
  return {mean, std::sqrt(squares / (n - 1) / n), static_cast<int>(stops.size())};
}

// Where the block comes to rest in each push, from where it was put. `begin` has the hand push, once.
Stops Push(const std::vector<std::string>& haptic_command, const std::string& instance,
           const std::string& what, const std::function<void()>& begin) {
  Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
               "--instance", instance, "--set", "coupling.coupling=local"});
  Child haptic(haptic_command);
  const auto haptic_view = Observe(instance, Role::kHaptic);
  const auto world_view = Observe(instance, Role::kWorld);
  TickWatch watch(instance, kSlewLimit);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*haptic_view).peer_state == PeerState::kLive; },
                     20));
  std::vector<double> stops;
  const auto is_home = [&] { return watch.Latest().finger_x < kAtHome; };
  const auto rests = [&] { return Norm(ReadMovingBody(*world_view).velocity) < 1e-3; };
  int disturbed = 0;
  for (int push = 0; push < 3 * Pushes() && std::ssize(stops) < Pushes(); ++push) {
    REQUIRE(Eventually([&] { return is_home() && rests(); }, kLongestPushS));
    const std::uint32_t generation = ReadMovingBody(*world_view).generation;
    world.Signal(SIGHUP);
    REQUIRE(Eventually([&] { return ReadMovingBody(*world_view).generation != generation; }));
    // A hand that goes by its own clock may be on its way already.
    const bool is_in_time = is_home();
    const double start = ReadMovingBody(*world_view).position[0];
    const std::uint64_t missed = ReadHapticHealth(*haptic_view).missed;
    begin();
    REQUIRE(Eventually([&] { return watch.Latest().force > 1; }, kLongestPushS));
    REQUIRE(Eventually([&] { return is_home() && rests(); }, kLongestPushS));
    // A hand that moves on by ticks is slow in a push that lacks some.
    const bool is_undisturbed = ReadHapticHealth(*haptic_view).missed - missed <= kMostMissed;
    disturbed += is_undisturbed ? 0 : 1;
    if (is_in_time && is_undisturbed) {
      stops.push_back(ReadMovingBody(*world_view).position[0] - start);
    }
  }
  const protocol::HapticHealth health = ReadHapticHealth(*haptic_view);
  SettledBooks(*haptic_view);
  CheckSafe(watch);
  haptic.Signal(SIGTERM);
  CHECK(haptic.Wait() == 0);
  CHECK(haptic.Stderr().find("device:") == std::string::npos);  // nothing to complain of
  const Stops result = StatisticsOf(stops);
  const double seconds =
      1e-9 * static_cast<double>(watch.All().back().start_ns - watch.All().front().start_ns);
  std::ostringstream each;
  for (const double stop : stops) each << " " << 1e3 * stop;
  CAPTURE(each.str());
  WARN(what << ": " << stops.size() << " pushes, " << 1e3 * result.mean_m << " mm (standard error "
            << 1e3 * result.standard_error_m << "), "
            << static_cast<double>(watch.All().size()) / seconds << " ticks/s of " << kUsbRateHz
            << ", " << health.missed << " deadlines missed, " << disturbed << " pushes disturbed");
  return result;
}

}  // namespace

TEST_CASE("pushes through the emulated boards end where they do with the simulated device") {
  const Instance simulated_instance;
  std::vector<std::string> simulated = {Program("haptic_server"), "--config",
                                        SourceFile("config/haptic_server.ini"), "--instance",
                                        simulated_instance};
  for (const std::string& setting : UsbSettingsOf("spidar4_simple.ini")) {
    simulated.insert(simulated.end(), {"--set", setting});
  }
  simulated.insert(simulated.end(), {"--set", "hand.rest_ms=3000"});  // time to put the block back
  const Stops expected = Push(simulated, simulated_instance, "simulated", [] {});
  for (const char* board : {"spidar4_simple.ini", "spidar4_sh4.ini"}) {
    const Instance instance;
    EmulatedBus bus(board, {"--on-request"});
    bus.Tell("plug");
    const Stops stops =
        Push(bus.HapticCommand(instance), instance, board, [&] { bus.Tell("begin"); });
    if (expected.count < kEnough || stops.count < kEnough) {
      WARN("nearly every push lacked ticks on this machine: their ends are not compared");
    } else {
      const double allowed =
          std::max(0.02 * expected.mean_m,
                   3 * std::hypot(expected.standard_error_m, stops.standard_error_m));
      CHECK(expected.mean_m > 0.05);
      CHECK(std::abs(stops.mean_m - expected.mean_m) <= allowed);
    }
    const EmulatedBus::Status status = bus.status();
    CHECK(status.nonsense == 0);
    CHECK(status.motors_at_zero == 1);
    CHECK(status.longest_pull_ticks < 20);
  }
}
