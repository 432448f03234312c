// SPDX-License-Identifier: MIT
// The simulated hand stirs in the scenes of the gallery between the real daemons: what is promised of
// every tick holds, nothing flies, and the books balance to the unit.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::PeerState;
using protocol::Role;

namespace fs = std::filesystem;

constexpr double kSlewLimit = 5000;  // N/s
constexpr double kGravity = 9.81;    // m/s^2, of every scene
// J, and of the work of the hand, as in the lab: what the engine mends of bodies pressed into each other.
constexpr double kEnergyFloor = 5e-3;
constexpr double kEnergyShare = 0.02;

// Something that is pushed in contact with others, a mesh that cannot move, and a wall alone.
std::vector<std::string> Scenes(bool full) {
  const fs::path folder = SourceFile("config/scenes");
  if (!full) return {folder / "three_cubes.sdf", folder / "terrain.sdf", folder / "stiff_wall.sdf"};
  std::vector<std::string> scenes;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".sdf") scenes.push_back(entry.path());
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

}  // namespace

TEST_CASE("a hand stirs in the scenes of the gallery") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const double seconds = full ? 10 : 2.5;
  const std::string scene = GENERATE_COPY(from_range(Scenes(full)));
  CAPTURE(scene);
  const Instance instance;
  Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
               "--scene", scene, "--instance", instance});
  const auto world_view = Observe(instance, Role::kWorld, 30);
  Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                "--instance", instance, "--set", "hand.script=stir", "--set",
                "hand.home_mm=-60 -50 45", "--set", "hand.stroke_mm=120 100 -75", "--set",
                "safety.slew_limit_n_per_s=5000"});
  const auto haptic_view = Observe(instance, Role::kHaptic);
  REQUIRE(
      Eventually([&] { return ReadHapticHealth(*haptic_view).peer_state == PeerState::kLive; }));
  protocol::Books books;
  {
    TickWatch watch(instance, kSlewLimit);
    protocol::BodiesReader bodies(world_view->Stream(protocol::StreamType::kWorldBodies));
    double largest_j = 0;  // kinetic and potential, above that of the first message
    std::optional<double> start_j;
    bool finite = true;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      if (bodies.ReadLatest() != protocol::ReadStatus::kFresh) continue;
      double energy_j = 0;
      for (const protocol::Body& body : bodies.bodies()) {
        finite = finite && std::isfinite(Norm(body.position)) && std::isfinite(Norm(body.velocity));
        energy_j += body.mass / 2 * Norm(body.velocity) * Norm(body.velocity) +
                    body.mass * kGravity * body.position[2];
      }
      if (!start_j) start_j = energy_j;
      largest_j = std::max(largest_j, energy_j - *start_j);
    }
    CHECK(finite);
    CheckSafe(watch);
    const protocol::HapticHealth health = ReadHapticHealth(*haptic_view);
    // The hand gave it, or the held force that lags.
    const double given_j = watch.largest_work() + std::max(0.0, health.energy.injected);
    if (watch.lost() == 0) CHECK(largest_j <= kEnergyFloor + (1 + kEnergyShare) * given_j);
    WARN(fs::path(scene).stem().string()
         << ": peak force " << health.largest_force << " N, bodies got up to " << largest_j
         << " J of " << given_j << " J, flagged " << health.energy.flagged << ", jump "
         << 1e3 * health.reconciliation.largest_jump << " mm, world missed "
         << ReadWorldHealth(*world_view).missed);
    books = SettledBooks(*haptic_view, Pushed::kFixed);
  }
  CHECK(Norm(books.peer_lost) == 0);
  CHECK(world.IsRunning());
  CHECK(haptic.IsRunning());
}
