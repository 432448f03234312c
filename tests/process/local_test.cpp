// Coupling `local` between the real daemons: a block of 20 g, which the other couplings throw about at
// any of these world rates, is pushed, poked, pressed and slid without buzzing. Margins are wide: the
// processes run on a shared machine. The laboratory's `pushes` has the sharp figures.
#include <signal.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "tests/common/temporary_file.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::PeerState;
using protocol::Role;

constexpr double kSlewLimit = 5000;        // N/s
constexpr double kStiffness = 2000;        // N/m
constexpr double kCountLength = 2.924e-5;  // m of string per encoder count
constexpr double kBuzz = 30;               // Hz: above, a hand does not move, a loop does

// The cube of push.sdf, light: 6 cm, its centre at the origin, on a floor.
const char* const kScene = R"(<?xml version="1.0"?>
<sdf version="1.9"><world name="light">
<model name="floor"><static>true</static><pose>0 0 -0.03 0 0 0</pose><link name="l">
<collision name="c"><geometry><plane><normal>0 0 1</normal><size>2 2</size></plane></geometry>
<surface><friction><ode><mu>0.3</mu><mu2>0.3</mu2></ode></friction></surface></collision></link></model>
<model name="cube"><link name="l"><inertial><mass>0.02</mass><inertia>
<ixx>1.2e-5</ixx><iyy>1.2e-5</iyy><izz>1.2e-5</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
<collision name="c"><geometry><box><size>0.06 0.06 0.06</size></box></geometry>
<surface><friction><ode><mu>0.3</mu><mu2>0.3</mu2></ode></friction></surface></collision></link></model>
</world></sdf>
)";

struct Motion {
  const char* name;
  const char* home_mm;
  const char* stroke_mm;
  const char* reach_ms;
  const char* hold_ms;
};

// Root of the mean square of what is above kBuzz [N], over `force` sampled at 1 kHz: total power
// under a Hann window, less that of the slow Fourier components.
double BuzzRms(const std::vector<double>& force) {
  const std::size_t n = force.size();
  double mean = 0;
  for (const double f : force) mean += f / static_cast<double>(n);
  std::vector<double> windowed(n);
  double power = 0;
  double window_power = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double phase = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    const double window = 0.5 - 0.5 * std::cos(phase);
    windowed[i] = window * (force[i] - mean);
    power += windowed[i] * windowed[i];
    window_power += window * window;
  }
  const auto slow = static_cast<std::size_t>(kBuzz * static_cast<double>(n) * 1e-3);
  for (std::size_t k = 0; k <= slow; ++k) {
    double re = 0;
    double im = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double phase =
          2 * std::numbers::pi * static_cast<double>(k * i % n) / static_cast<double>(n);
      re += windowed[i] * std::cos(phase);
      im += windowed[i] * std::sin(phase);
    }
    power -= (k == 0 ? 1 : 2) * (re * re + im * im) / static_cast<double>(n);
  }
  return std::sqrt(std::max(0.0, power) / window_power);
}

std::vector<double> Forces(const std::vector<WatchedTick>& ticks, std::size_t count) {
  std::vector<double> forces;
  for (std::size_t i = ticks.size() - std::min(count, ticks.size()); i < ticks.size(); ++i) {
    forces.push_back(ticks[i].force);
  }
  return forces;
}

class LightPair {
 public:
  LightPair(double world_rate_hz, const Motion& motion)
      : scene_(kScene),
        world_({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                "--scene", scene_.path(), "--instance", instance_, "--set",
                "coupling.coupling=local", "--set",
                "loop.rate_hz=" + std::to_string(world_rate_hz)}),
        haptic_({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                 "--instance", instance_, "--set", "safety.slew_limit_n_per_s=5000", "--set",
                 std::string("hand.home_mm=") + motion.home_mm, "--set",
                 std::string("hand.stroke_mm=") + motion.stroke_mm, "--set",
                 std::string("hand.reach_ms=") + motion.reach_ms, "--set",
                 std::string("hand.hold_ms=") + motion.hold_ms, "--set", "hand.rest_ms=700"}) {}

  const std::string& instance() const { return instance_; }
  void PutBack() { world_.Signal(SIGHUP); }

 private:
  Instance instance_;
  TemporaryFile scene_;
  Child world_;
  Child haptic_;
};

}  // namespace

TEST_CASE("local: a pressed block of 20 g stands still under the finger") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const double rate_hz = full ? GENERATE(10.0, 20.0, 60.0) : 20.0;
  // The finger's centre is 10 mm above the top face, at z = 40 mm, where it touches.
  LightPair pair(rate_hz, {"press", "0 0 55", "0 0 -20", "300", "2500"});
  const auto haptic = Observe(pair.instance(), Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*haptic).peer_state == PeerState::kLive; }));
  TickWatch watch(pair.instance(), kSlewLimit);
  // 1.5 s within one press.
  std::size_t pressed = 0;
  REQUIRE(Eventually(
      [&] {
        const std::vector<WatchedTick> all = watch.All();
        pressed = 0;
        while (pressed < all.size() && all[all.size() - 1 - pressed].force > 0.5) ++pressed;
        return pressed > 1500;
      },
      20));
  const std::vector<double> forces = Forces(watch.All(), 1000);
  INFO("world at " << rate_hz << " Hz, " << forces.back() << " N");
  CHECK(BuzzRms(forces) <= 1.5 * kCountLength * kStiffness);
  const protocol::HapticHealth health = ReadHapticHealth(*haptic);
  CHECK(health.reconciliation.frames > 0);
  CHECK(health.energy.unstable == 0);
  CheckSafe(watch);
}

TEST_CASE(
    "local: a block of 20 g is pushed, poked and slid without buzzing, and the books balance") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const double rate_hz = full ? GENERATE(10.0, 20.0, 60.0) : 20.0;
  const Motion motion = GENERATE(Motion{"push", "-50 0 0", "60 0 0", "300", "100"},
                                 Motion{"poke", "-45 0 0", "20 0 0", "120", "20"},
                                 Motion{"slide", "-25 0 46", "50 0 -9", "500", "100"});
  LightPair pair(rate_hz, motion);
  const auto haptic = Observe(pair.instance(), Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*haptic).peer_state == PeerState::kLive; }));
  TickWatch watch(pair.instance(), kSlewLimit);
  for (int trial = 0; trial < 2; ++trial) {
    pair.PutBack();
    const std::size_t from = watch.All().size();
    REQUIRE(Eventually(
        [&] {
          const std::vector<WatchedTick> all = watch.All();
          return std::any_of(all.begin() + static_cast<std::ptrdiff_t>(from), all.end(),
                             [](const WatchedTick& tick) { return tick.force > 0.2; });
        },
        15));
    REQUIRE(Eventually([&] { return watch.Latest().force == 0; }, 15));
  }
  // A 20 g block is gone after a touch of some ten milliseconds; what rings on is a buzz.
  const std::vector<double> forces = Forces(watch.All(), 2000);
  INFO(motion.name << ", world at " << rate_hz << " Hz");
  CHECK(BuzzRms(forces) <= 0.2);  // measured: local 0.01 to 0.07, impulse 0.3 to 0.45
  const protocol::HapticHealth health = ReadHapticHealth(*haptic);
  CHECK(health.energy.unstable == 0);
  CHECK(health.reconciliation.newest_jump < 0.002);
  CheckSafe(watch);
  SettledBooks(*haptic);
}
