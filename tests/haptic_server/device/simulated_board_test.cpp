// SPDX-License-Identifier: MIT
// The physics behind the simulated board, of the grip that eight strings hold. That of the point that
// four strings pull at is in spidar_test.cpp.
#include "haptic_server/device/simulated_board.h"

#include <catch2/catch.hpp>

#include "tests/haptic_server/device/g6x3.h"

namespace rikiseki::haptic {
namespace {

Settings InARestingHand() {
  Settings settings;
  settings.spidar = G6X3Settings();
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm.setZero();
  return settings;
}

// Pulls at the grip for two seconds with what displays `wrench` where it really is.
Pose Settled(SimulatedBoard& board, const Wrench& wrench) {
  const SpidarPose kinematics(G6X3Motors(), G6X3Attachments());
  EncoderCounts counts{};
  for (std::int64_t k = 0; k <= 2000; ++k) {
    board.ReadCounts(k * 1'000'000, counts);
    const GripStrings strings = kinematics.StringsAt(board.grip());
    board.WriteTensions(AllocateWrench(strings, wrench, kG6X3Bounds, 1).tension);
  }
  return board.grip();
}

TEST_CASE("a torque turns the grip against the fingers' torsion spring, a force moves it") {
  const Settings settings = InARestingHand();
  for (int axis = 0; axis < 3; ++axis) {
    CAPTURE(axis);
    SimulatedBoard turned(settings.spidar, MakeHand(settings));
    const Pose of_torque = Settled(turned, {Vec3::Zero(), 0.02 * Vec3::Unit(axis)});
    // 0.02 N m against 0.5 N m/rad; what is displayed is wanted to 1e-6.
    const Quat expected(Eigen::AngleAxisd(0.04, Vec3::Unit(axis)));
    CHECK(of_torque.orientation.angularDistance(expected) < 1e-6);
    CHECK(of_torque.position.norm() < 1e-8);

    SimulatedBoard moved(settings.spidar, MakeHand(settings));
    const Pose of_force = Settled(moved, {2 * Vec3::Unit(axis), Vec3::Zero()});
    const Vec3 way = 2 * Vec3::Unit(axis) / settings.hand.stiffness_n_per_m;
    CHECK((of_force.position - way).norm() < 1e-6);
    CHECK(of_force.orientation.angularDistance(Quat::Identity()) < 1e-6);
  }
}

TEST_CASE("the encoders of eight strings read where the grip is and how it is turned") {
  const Settings settings = InARestingHand();
  const SimulatedBoard board(settings.spidar, MakeHand(settings));
  const SpidarPose kinematics(G6X3Motors(), G6X3Attachments());
  const EightStrings home = kinematics.Lengths(Pose());
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const Pose pose = RandomPose(random, 0.03, 0.5);
    const EncoderCounts counts = board.CountsAt(pose);
    const EightStrings lengths = kinematics.Lengths(pose);
    for (std::size_t s = 0; s < kGripStrings; ++s) {
      const double counted = static_cast<double>(counts[s]) * kG6X3CountLength;
      REQUIRE(std::abs(counted - (lengths[s] - home[s])) <= 0.5001 * kG6X3CountLength);
    }
  }
}

TEST_CASE("a board of other strings than can be driven is refused") {
  Settings settings = InARestingHand();
  settings.spidar.attachments_mm.pop_back();
  REQUIRE_THROWS_AS(SimulatedBoard(settings.spidar, MakeHand(settings)), std::invalid_argument);
  settings.spidar.motors_m.pop_back();
  REQUIRE_THROWS_AS(SimulatedBoard(settings.spidar, MakeHand(settings)), std::invalid_argument);
  settings.spidar.motors_m.clear();
  settings.spidar.attachments_mm.clear();
  REQUIRE_THROWS_AS(SimulatedBoard(settings.spidar, MakeHand(settings)), std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
