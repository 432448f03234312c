// SPDX-License-Identifier: MIT
// The scene file is edited while the real pair runs and a finger rests on a wall: what is added, moved or
// removed elsewhere, a broken file and a restart are nothing to the finger.
#include <signal.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <string>
#include <thread>

#include "tests/common/temporary_folder.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::PeerState;
using protocol::Role;

constexpr double kSlewLimit = 5000;  // N/s
// The finger rests at 2 N; two counts of the encoders, 0.06 mm, make 0.12 N at 2 kN/m.
constexpr double kStill = 0.2;  // N

std::string Cube(const std::string& name, const std::string& place) {
  return "<model name=\"" + name + "\"><pose>" + place +
         " 0 0 0</pose><link name=\"l\"><inertial><mass>0.5</mass><inertia>"
         "<ixx>3e-4</ixx><iyy>3e-4</iyy><izz>3e-4</izz></inertia></inertial>\n"
         "<collision name=\"c\"><geometry><box><size>0.06 0.06 0.06</size></box></geometry>"
         "</collision></link></model>\n";
}

// A wall with its face at x = 0, a floor, and whatever else.
std::string World(const std::string& content) {
  return "<sdf version=\"1.9\"><world name=\"edited\">\n"
         "<model name=\"wall\"><static>true</static><pose>0.05 0 0 0 0 0</pose><link name=\"l\">"
         "<collision name=\"c\"><geometry><box><size>0.1 0.4 0.4</size></box></geometry>"
         "</collision></link></model>\n"
         "<model name=\"floor\"><static>true</static><pose>0 0 -0.3 0 0 0</pose><link name=\"l\">"
         "<collision name=\"c\"><geometry><plane><normal>0 0 1</normal><size>9 9</size></plane>"
         "</geometry></collision></link></model>\n" +
         content + "</world></sdf>\n";
}

std::vector<protocol::Body> ReadBodies(const protocol::PeerView& world) {
  protocol::BodiesReader reader(world.Stream(protocol::StreamType::kWorldBodies));
  REQUIRE(Eventually([&] { return reader.ReadLatest() == protocol::ReadStatus::kFresh; }));
  return {reader.bodies().begin(), reader.bodies().end()};
}

}  // namespace

TEST_CASE("a scene is edited under a resting finger, which feels nothing of it") {
  const Instance instance;
  const TemporaryFolder folder;
  const std::string scene = folder.Write("scene.sdf", World(Cube("cube", "-0.5 0.3 -0.27")));
  Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
               "--scene", scene, "--instance", instance});
  Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                "--instance", instance, "--set", "hand.script=rest", "--set", "hand.home_mm=-5 0 0",
                "--set", "safety.slew_limit_n_per_s=5000"});
  const auto world_view = Observe(instance, Role::kWorld);
  const auto haptic_view = Observe(instance, Role::kHaptic);
  TickWatch watch(instance, kSlewLimit);
  REQUIRE(Eventually([&] { return watch.Latest().force > 1.8; }));
  std::this_thread::sleep_for(std::chrono::seconds(1));  // until the hand has come to rest
  const std::size_t from = watch.All().size();
  const std::uint64_t disturbances = Disturbances(*haptic_view, *world_view);
  const auto resets = [&] { return ReadWorldHealth(*world_view).resets; };
  const auto still = [&] {
    const std::vector<WatchedTick> all = watch.All();
    const auto [low, high] = std::minmax_element(
        all.begin() + static_cast<std::ptrdiff_t>(from), all.end(),
        [](const WatchedTick& a, const WatchedTick& b) { return a.force < b.force; });
    // A late tick moves the hand, and the force fades while a world is late: then lab_scene_change_test
    // alone tells, in virtual time.
    if (Disturbances(*haptic_view, *world_view) != disturbances) {
      WARN("late ticks, nothing judged but safety");
      return;
    }
    CHECK(high->force - low->force <= kStill);
  };
  const std::vector<protocol::Body> before = ReadBodies(*world_view);
  REQUIRE(before.size() == 3);

  // One more, which falls, and goes on falling when yet another comes.
  folder.Rename("scene.sdf", World(Cube("cube", "-0.5 0.3 -0.27") + Cube("high", "-0.5 0 9")));
  REQUIRE(Eventually([&] { return resets() == 1; }));
  folder.Rename("scene.sdf", World(Cube("new", "-0.5 -0.3 -0.27") + Cube("cube", "-0.5 0.3 -0.27") +
                                   Cube("high", "-0.5 0 9")));
  REQUIRE(Eventually([&] { return resets() == 2; }));
  const std::vector<protocol::Body> after = ReadBodies(*world_view);
  REQUIRE(after.size() == 5);
  CHECK(after[0].body == before[0].body);
  CHECK(after[0].generation == before[0].generation);
  CHECK(after[2].body == 4);  // the scene's order, its own number
  CHECK(after[3].body == before[2].body);
  CHECK(after[3].generation == before[2].generation);
  // It rests: no jump, no velocity.
  CHECK(std::abs(after[3].position[2] - before[2].position[2]) < 1e-5);
  CHECK(after[4].body == 3);
  CHECK(after[4].generation == 1);
  // Half a second of looks and settling lies between the two, at least.
  CHECK(after[4].position[2] < 9 - 0.3);
  CHECK(after[4].velocity[2] < -2);

  // A broken file is named, and changes nothing; mended, with bodies gone, it counts.
  folder.Write("scene.sdf", World("<model name=\"half\">"));
  REQUIRE(Eventually([&] { return world.Stderr().find("stays as it was") != std::string::npos; }));
  CHECK(world.Stderr().find(scene) != std::string::npos);
  CHECK(resets() == 2);
  folder.Rename("scene.sdf", World(Cube("cube", "-0.4 0.3 -0.27")));
  REQUIRE(Eventually([&] { return resets() == 3; }));
  const std::vector<protocol::Body> moved = ReadBodies(*world_view);
  REQUIRE(moved.size() == 3);
  CHECK(moved[2].body == before[2].body);
  CHECK(moved[2].generation == before[2].generation + 1);
  CHECK(std::abs(moved[2].position[0] + 0.4) < 1e-6);

  world.Signal(SIGHUP);
  REQUIRE(Eventually([&] { return resets() == 4; }));
  CHECK(ReadBodies(*world_view)[0].generation == before[0].generation);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  still();
  CheckSafe(watch);
  SettledBooks(*haptic_view, Pushed::kFixed);
  CHECK(ReadHapticHealth(*haptic_view).peer_state == PeerState::kLive);
}
