// SPDX-License-Identifier: MIT
// The same scene and the same calls give the same bits: in one process, and in two.
#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "common/sha256.h"
#include "tests/world_server/scenes.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::world {
namespace {

// A heap that falls, sleeps, and is pushed apart: groups join and part, sleepers wake.
std::string HashOfRun() {
  Scene scene;
  scene.bodies.push_back(test::Floor(0.4));
  for (int i = 0; i < 24; ++i) {
    scene.bodies.push_back(
        test::Cube(0.03, 0.05, 0.4,
                   {0.04 * (i % 4) + 0.002 * (i % 3), 0.045 * (i / 4 % 2), 0.02 + 0.05 * (i / 8)}));
    if (i % 5 == 0) scene.bodies.back().colliders[0].shape = Sphere{0.015};
  }
  BulletWorld world(scene, 1e-3);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> any(-1, 1);
  std::string bytes;
  for (int frame = 0; frame < 80; ++frame) {
    std::vector<PlacedImpulse> pushes;
    if (frame > 40 && frame < 60) {
      for (int i = 0; i < 50; ++i) {
        pushes.push_back({.body = 1 + random() % 24,
                          .impulse = 2e-3 * Vec3(any(random), any(random), any(random))});
      }
    }
    std::vector<Stretch> period;
    for (const PlacedImpulse& push : pushes) {
      period.push_back({.length_s = 1e-3, .pushes = {&push, 1}});
    }
    if (period.empty()) period.push_back({.length_s = 0.05});
    world.Play(period);
    for (std::size_t body = 0; body < world.body_count(); ++body) {
      const BodyState state = world.State(body);
      std::array<double, 13> numbers;
      const auto& q = state.pose.orientation.coeffs();
      std::copy_n(state.pose.position.data(), 3, numbers.begin());
      std::copy_n(q.data(), 4, numbers.begin() + 3);
      std::copy_n(state.velocity.data(), 3, numbers.begin() + 7);
      std::copy_n(state.angular_velocity.data(), 3, numbers.begin() + 10);
      bytes.append(reinterpret_cast<const char*>(numbers.data()), sizeof(numbers));
    }
  }
  std::string text;
  for (const std::uint8_t byte :
       Sha256({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()})) {
    std::array<char, 3> digits;
    std::snprintf(digits.data(), digits.size(), "%02x", byte);
    text += digits.data();
  }
  return text;
}

// Of another process: at other addresses.
std::string HashOfOther() {
  FILE* pipe = popen(RIKISEKI_BIN_DIR "/world_server_test '[determinism-hash]'", "r");
  REQUIRE(pipe != nullptr);
  std::string output;
  std::array<char, 256> line;
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) output += line.data();
  CHECK(pclose(pipe) == 0);
  const std::size_t place = output.find("hash ");
  REQUIRE(place != std::string::npos);
  return output.substr(place + 5, 64);
}

}  // namespace

TEST_CASE("the hash of a run, for another process", "[.][determinism-hash]") {
  std::printf("hash %s\n", HashOfRun().c_str());
}

TEST_CASE("the same bits twice in one process, and in another") {
  const std::string hash = HashOfRun();
  // Memory in use between the two runs, so that the second lies elsewhere.
  const auto elsewhere = std::make_unique<std::array<char, 100000>>();
  CHECK(HashOfRun() == hash);
  CHECK(HashOfOther() == hash);
  CHECK(elsewhere->size() == 100000);
}

}  // namespace rikiseki::world
