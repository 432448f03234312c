// SPDX-License-Identifier: MIT
// Coupling `local` between the real daemons: a block of 20 g, which the other couplings throw about at
// any of these world rates, is pushed, poked, pressed and slid over without buzzing - beside the same hand
// and encoder at a single rate, in virtual time. The processes run on a shared machine: margins are wide, and
// what is judged is a touch during which both loops kept their deadlines, by their own clocks. haptic_lab buzz
// has the sharp figures.
#include <signal.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "tests/common/temporary_file.h"
#include "tests/lab/buzz_run.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::PeerState;
using protocol::Role;

constexpr double kSlewLimit = 5000;                // N/s
constexpr std::uint64_t kTouchNs = 1'000'000'000;  // what lab::TouchOf looks at

// How much more than at a single rate may lie above 30 Hz. In virtual time it is nothing (lab/buzz_test:
// 10 %); here each late tick changes the touch itself. `impulse` has 10 to 20 times as much.
constexpr double kMostBuzz = 2;

// Until one touch was not disturbed.
constexpr int kMostTrials = 8;

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

std::string Text(const Vec3& v) {
  std::ostringstream text;
  text << v.x() << " " << v.y() << " " << v.z();
  return text.str();
}

class LightPair {
 public:
  LightPair(double world_rate_hz, const lab::Touch& touch)
      : scene_(kScene),
        world_({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                "--scene", scene_.path(), "--instance", instance_, "--set",
                "coupling.coupling=local", "--set", "loop.rate_hz=" + std::to_string(world_rate_hz),
                "--set", "features.finger_friction=" + std::to_string(touch.finger_friction)}),
        haptic_({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                 "--instance", instance_, "--set", "safety.slew_limit_n_per_s=5000", "--set",
                 "hand.home_mm=" + Text(touch.home_mm), "--set",
                 "hand.stroke_mm=" + Text(touch.stroke_mm), "--set",
                 "hand.reach_ms=" + std::to_string(touch.reach_ms), "--set",
                 "hand.hold_ms=" + std::to_string(touch.hold_ms), "--set",
                 "hand.rest_ms=" + std::to_string(lab::kHandRestMs)}) {}

  const std::string& instance() const { return instance_; }
  void PutBack() { world_.Signal(SIGHUP); }

 private:
  Instance instance_;
  TemporaryFile scene_;
  Child world_;
  Child haptic_;
};

// Of the ticks with these numbers, in their order; a tick that was lost or skipped shows the force that
// was held.
std::vector<double> ForcesFrom(const std::vector<WatchedTick>& ticks, std::size_t from) {
  std::vector<double> forces;
  for (std::size_t i = from; i < ticks.size(); ++i) {
    const std::uint64_t since = ticks[i].start_ns - ticks[from].start_ns;
    const std::size_t index = (since + 500'000) / 1'000'000;
    while (!forces.empty() && forces.size() < index) forces.push_back(forces.back());
    if (forces.size() == index) forces.push_back(ticks[i].force);
  }
  return forces;
}

}  // namespace

TEST_CASE("local: a pressed block of 20 g stands still under the finger") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const double rate_hz = full ? GENERATE(10.0, 20.0, 60.0) : 20.0;
  LightPair pair(rate_hz, lab::kPressTouch);
  const auto haptic = Observe(pair.instance(), Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*haptic).peer_state == PeerState::kLive; }));
  const auto world = Observe(pair.instance(), Role::kWorld);
  TickWatch watch(pair.instance(), kSlewLimit);
  const double single_n =
      lab::RmsAbove(lab::AtRest(lab::kPressTouch, lab::SimulateBuzz({.touch = lab::kPressTouch})));
  bool judged = false;
  for (int trial = 0; trial < kMostTrials && !judged; ++trial) {
    // 1.5 s within one press that began after this.
    const std::size_t from = watch.All().size();
    std::uint64_t before = 0;
    std::size_t pressed = 0;
    REQUIRE(Eventually(
        [&] {
          const std::vector<WatchedTick> all = watch.All();
          pressed = 0;
          while (pressed < all.size() - from && all[all.size() - 1 - pressed].force > 0.5) {
            ++pressed;
          }
          if (pressed < 500) before = Disturbances(*haptic, *world);
          return pressed > 1500;
        },
        20));
    judged = Disturbances(*haptic, *world) == before;
    if (!judged) continue;
    const std::vector<WatchedTick> all = watch.All();
    const double buzz_n = lab::RmsAbove(ForcesFrom(all, all.size() - 1000));
    WARN("press, world at " << rate_hz << " Hz: " << buzz_n << " N above 30 Hz, at a single rate "
                            << single_n << " N, allowed " << lab::QuietRms({}) << " N");
    CHECK(buzz_n <= lab::QuietRms({}));
    CHECK(ReadHapticHealth(*haptic).energy.unstable == 0);
  }
  if (!judged) WARN("press: no rest without late ticks, nothing judged but safety");
  CHECK(ReadHapticHealth(*haptic).reconciliation.frames > 0);
  CheckSafe(watch);
}

TEST_CASE(
    "local: a block of 20 g is pushed, poked and slid without buzzing, and the books balance") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const double rate_hz = full ? GENERATE(10.0, 20.0, 60.0) : 20.0;
  const lab::Touch touch = GENERATE(lab::kPushTouch, lab::kPokeTouch, lab::kSlideTouch);
  LightPair pair(rate_hz, touch);
  const auto haptic = Observe(pair.instance(), Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*haptic).peer_state == PeerState::kLive; }));
  const auto world = Observe(pair.instance(), Role::kWorld);
  TickWatch watch(pair.instance(), kSlewLimit);
  const double single = lab::EnergyAbove(lab::TouchOf(lab::SimulateBuzz({.touch = touch})));
  bool judged = false;
  for (int trial = 0; trial < kMostTrials && !judged; ++trial) {
    // The block is put back while the hand rests at home.
    const Vec3 home = touch.home_mm * 1e-3;
    const auto away = [&] {
      return (ToVec3(ReadHapticHealth(*haptic).target) - home).norm() > 1e-3;
    };
    REQUIRE(Eventually(away));
    REQUIRE(Eventually([&] { return !away(); }));
    pair.PutBack();
    const std::uint64_t before = Disturbances(*haptic, *world);
    const std::size_t from = watch.All().size();
    std::size_t touched = 0;
    REQUIRE(Eventually(
        [&] {
          const std::vector<WatchedTick> all = watch.All();
          const auto first =
              std::find_if(all.begin() + static_cast<std::ptrdiff_t>(from), all.end(),
                           [](const WatchedTick& tick) { return tick.force > lab::kTouched; });
          touched = static_cast<std::size_t>(first - all.begin());
          return first != all.end() && all.back().start_ns > first->start_ns + kTouchNs;
        },
        15));
    judged = Disturbances(*haptic, *world) == before;
    if (!judged) continue;
    const double buzz = lab::EnergyAbove(lab::TouchOf(ForcesFrom(watch.All(), touched - 100)));
    WARN(touch.name << ", world at " << rate_hz << " Hz: " << buzz << " N^2 s above 30 Hz, "
                    << 100 * (buzz / single - 1) << " % more than at a single rate");
    CHECK(buzz <= kMostBuzz * single);
    const protocol::HapticHealth health = ReadHapticHealth(*haptic);
    CHECK(health.energy.unstable == 0);
    CHECK(health.reconciliation.newest_jump < 0.002);
  }
  if (!judged) WARN(touch.name << ": no touch without late ticks, nothing judged but safety");
  CheckSafe(watch);
  SettledBooks(*haptic);
}
