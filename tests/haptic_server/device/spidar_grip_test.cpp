// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_grip.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/make_device.h"
#include "haptic_server/device/spidar.h"
#include "tests/haptic_server/device/g6x3.h"
#include "tests/haptic_server/device/scripted_board.h"

namespace rikiseki::haptic {
namespace {

constexpr double kArm = 0.0225;  // m, of the G6X3

EncoderCounts CountsAt(const SpidarSettings& spidar, const Pose& pose) {
  const SpidarPose kinematics = GripKinematics(spidar);
  const EightStrings home = kinematics.Lengths(Pose());
  const EightStrings lengths = kinematics.Lengths(pose);
  EncoderCounts counts;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    counts[i] = std::llround((lengths[i] - home[i]) / spidar.count_length_m);
  }
  return counts;
}

// A grip in the test's hand.
struct Rig {
  explicit Rig(const SpidarSettings& used = G6X3Settings()) : spidar(used) {
    auto owned = std::make_unique<ScriptedBoard>();
    board = owned.get();
    device = std::make_unique<SpidarGrip>(used, std::move(owned));
  }

  // One reading, a millisecond after the one before.
  DeviceStatus Read(const Pose& pose) {
    board->counts = CountsAt(spidar, pose);
    return Read();
  }
  DeviceStatus Read() { return device->Read(now_ns += 1'000'000, sample); }

  // Of the tensions that the board has, in the pose that the grip really has.
  Wrench Pulled(const Pose& pose) const {
    return StringWrench(GripKinematics(spidar).StringsAt(pose), board->tension);
  }

  SpidarSettings spidar;
  ScriptedBoard* board = nullptr;
  std::unique_ptr<SpidarGrip> device;
  std::int64_t now_ns = 0;
  DeviceSample sample;
};

bool IsWithin(const EightStrings& tension, const SpidarSettings& spidar) {
  return std::all_of(tension.begin(), tension.end(), [&](double t) {
    return t >= spidar.tension_min_n && t <= spidar.tension_max_n;
  });
}

SpidarSettings Shipped(const std::string& file) {
  return LoadSettings(RIKISEKI_SOURCE_DIR "/config/haptic_server.ini",
                      {"device.file=" RIKISEKI_SOURCE_DIR "/config/devices/" + file})
      .spidar;
}

TEST_CASE("the grip is measured where it is, how it is turned, and how fast both change") {
  Rig rig;
  const Vec3 velocity(0.1, -0.05, 0.08);            // m/s
  const Vec3 turning = 6 * Vec3(0.48, 0.6, -0.64);  // rad/s
  for (int k = 0; k <= 100; ++k) {
    const double t = 1e-3 * k;
    // From a turn about another axis: rates are told in device axes, not in the grip's.
    const Pose pose{t * velocity, Eigen::AngleAxisd(6 * t, turning / 6) *
                                      Quat(Eigen::AngleAxisd(-0.4, Vec3::UnitY()))};
    REQUIRE(rig.Read(pose) == DeviceStatus::kOk);
    REQUIRE((rig.sample.position - pose.position).norm() <= kG6X3CountLength);
    REQUIRE(rig.sample.orientation.angularDistance(pose.orientation) <=
            2 * kG6X3CountLength / kArm);
    REQUIRE(rig.sample.target == rig.sample.position);
    if (k == 0) REQUIRE(rig.sample.velocity.isZero(0));
  }
  // Of errors of the pose within e, a backward difference over dt and a filter of weight w leave less
  // than 2 w e/dt; w = 1 - exp(-2 pi 100 Hz dt) = 0.467.
  REQUIRE((rig.sample.velocity - velocity).norm() <= 0.94 * kG6X3CountLength / 1e-3);
  REQUIRE((rig.sample.angular_velocity - turning).norm() <=
          0.94 * (2 * kG6X3CountLength / kArm) / 1e-3);
  REQUIRE(rig.sample.enabled);
  rig.board->enabled = false;
  rig.Read();
  REQUIRE_FALSE(rig.sample.enabled);
}

TEST_CASE("every shipped grip displays 5 N along any axis in the middle, without a torque") {
  const std::string file =
      GENERATE("spidar_g6x3r_simple.ini", "spidar_g6x3r_sh4.ini", "spidar_g6x3l_simple.ini",
               "spidar_g6x3l_sh4.ini", "spidar_g6x2_simple.ini", "spidar_g6x2_sh4.ini");
  CAPTURE(file);
  Rig rig(Shipped(file));
  REQUIRE(rig.Read(Pose()) == DeviceStatus::kOk);
  for (int i = 0; i < 6; ++i) {
    const Vec3 force = (i % 2 == 0 ? 5 : -5) * Vec3::Unit(i / 2);
    const Vec3 displayed = rig.device->Write(force);
    CHECK((displayed - force).norm() <= 0.01 * 5);
    CHECK(IsWithin(rig.board->tension, rig.spidar));
    const Wrench pulled = rig.Pulled(Pose());
    CHECK((pulled.force - displayed).norm() <= 1e-12);
    // A millionth of the wrench's size is what may be missing, counted as a force at the arm.
    CHECK(pulled.torque.norm() <= 1e-6 * (1 + 5) * kArm);
    CHECK((pulled.torque - rig.device->torque()).norm() <= 1e-15);
  }
  const Vec3 nothing = rig.device->Write(Vec3::Zero());
  CHECK(nothing.norm() < 1e-6);
  for (const double t : rig.board->tension) CHECK(t == Approx(1).epsilon(0.05));
}

TEST_CASE("whatever the pose and the force, the tensions stay within the bounds") {
  Rig rig;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> decades(-1, 4);
  int out_of_reach = 0;
  for (int i = 0; i < 2000; ++i) {
    const Pose pose = RandomPose(random, 0.03, 0.5);
    rig.Read(
        pose);  // from anywhere to anywhere: now and then too far, and then the last pose stays
    const Vec3 force = RandomInBall(random, std::pow(10, decades(random)));
    const Vec3 displayed = rig.device->Write(force);
    REQUIRE(displayed.allFinite());
    REQUIRE(rig.device->torque().allFinite());
    REQUIRE(IsWithin(rig.board->tension, rig.spidar));
    REQUIRE(displayed.norm() <= kGripStrings * 20.0);
    out_of_reach += (displayed - force).norm() > 1e-3 ? 1 : 0;
  }
  REQUIRE(out_of_reach > 500);
  REQUIRE(out_of_reach < 1800);
  const double nan = std::nan("");
  for (const Vec3& force : {Vec3(nan, 0, 0), Vec3(0, HUGE_VAL, 0), Vec3(1e308, -1e308, 1e308)}) {
    REQUIRE(rig.device->Write(force).allFinite());
    REQUIRE(IsWithin(rig.board->tension, rig.spidar));
  }
  rig.device->Release();
  for (const double t : rig.board->tension) REQUIRE(t == 0.3);
  REQUIRE(rig.device->torque().isZero(0));
}

TEST_CASE(
    "a string that slipped or hangs slack is a fault with a name, until the strings agree again") {
  Rig rig;
  for (std::size_t wrong = 0; wrong < kGripStrings; ++wrong) {
    CAPTURE(wrong);
    const std::string name = "string " + std::to_string(wrong + 1) + " seems ";
    const auto read = [&](const Pose& pose, std::int64_t excess_counts) {
      rig.board->counts = CountsAt(rig.spidar, pose);
      rig.board->counts[wrong] += excess_counts;
      return rig.Read();
    };
    // All at once, in a hand that moves at 0.3 m/s and turns at 3 rad/s.
    Pose pose;
    for (int k = 0; k <= 50; ++k) {
      pose = {Vec3(3e-4 * k, -1e-4 * k, 0), Quat(Eigen::AngleAxisd(3e-3 * k, Vec3::UnitZ()))};
      REQUIRE(read(pose, 0) == DeviceStatus::kOk);
    }
    REQUIRE(rig.device->Complaint().empty());
    REQUIRE(read(pose, 360) == DeviceStatus::kFault);  // 6.0 mm
    const std::string complaint = rig.device->Complaint();
    CAPTURE(complaint);
    REQUIRE(complaint.starts_with(name));
    // The others are right to a count, and hold a pose to a few.
    REQUIRE(std::stod(complaint.substr(name.size())) == Approx(6.0).margin(0.15));
    REQUIRE(complaint.ends_with(" mm too long: it hangs slack or has slipped off"));
    // The name stays, whatever the hand does meanwhile.
    REQUIRE(read({Vec3(-0.02, 0.01, 0), Quat::Identity()}, 400) == DeviceStatus::kFault);
    REQUIRE(rig.device->Complaint() == complaint);
    // Slowly, a count in a millisecond, in a hand at rest.
    const Pose rest{Vec3(-0.01, 0.005, 0.012), Quat(Eigen::AngleAxisd(0.1, Vec3::UnitX()))};
    REQUIRE(read(rest, 0) == DeviceStatus::kOk);
    REQUIRE(rig.device->Complaint().empty());
    std::int64_t slipped = 0;
    while (slipped > -1000 && read(rest, slipped) == DeviceStatus::kOk) --slipped;
    CAPTURE(slipped);
    // 1 mm of residual is some 2 to 8 mm of one string.
    REQUIRE(slipped < -120);
    REQUIRE(slipped > -480);
    REQUIRE(rig.device->Complaint().starts_with(name));
    REQUIRE(rig.device->Complaint().find("too short") != std::string::npos);
    REQUIRE(read(rest, 0) == DeviceStatus::kOk);
  }
}

TEST_CASE("a grip that starts with strings that disagree names the one that the others outvote") {
  Rig rig;
  rig.board->counts[5] = 400;  // 6.7 mm
  REQUIRE(rig.Read() == DeviceStatus::kFault);
  REQUIRE(rig.device->Complaint().starts_with("string 6 seems 6."));
  // At a grip of which nothing is known the strings pull no more than it takes to be balanced at 0.3 N.
  REQUIRE(rig.device->Write(Vec3::Zero()).norm() < 1e-6);
  for (const double t : rig.board->tension) REQUIRE(t < 0.35);
}

TEST_CASE("after a fault the grip is found again, wherever it went meanwhile") {
  Rig rig;
  const Pose here{Vec3(0.03, 0.02, -0.02), Quat(Eigen::AngleAxisd(0.6, Vec3(0.6, 0, 0.8)))};
  const Pose there{Vec3(-0.03, -0.02, 0.02), Quat(Eigen::AngleAxisd(-0.6, Vec3(0.6, 0, 0.8)))};
  for (int k = 0; k <= 100; ++k) {
    const Pose way{0.01 * k * here.position, Quat::Identity().slerp(0.01 * k, here.orientation)};
    REQUIRE(rig.Read(way) == DeviceStatus::kOk);
  }
  rig.board->answers = false;
  REQUIRE(rig.Read() == DeviceStatus::kFault);
  rig.board->answers = true;
  REQUIRE(rig.Read(there) == DeviceStatus::kOk);
  REQUIRE((rig.sample.position - there.position).norm() <= 2 * kG6X3CountLength);
  REQUIRE(rig.sample.velocity.isZero(0));
  REQUIRE(rig.sample.angular_velocity.isZero(0));
  for (const std::int64_t lost :
       {std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
    rig.board->counts[2] = lost;
    REQUIRE(rig.Read() == DeviceStatus::kFault);
  }
  REQUIRE(rig.Read(there) == DeviceStatus::kOk);
}

TEST_CASE("the simulated grip yields to the force, and stays upright") {
  Settings settings;
  settings.spidar = G6X3Settings();
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm = Vec3(8, -5, 10);
  const Vec3 home = settings.hand.home_mm * 1e-3;
  const auto device = MakeDevice(settings);
  DeviceSample sample;
  const Vec3 force(3, -2, 1);
  for (std::int64_t k = 0; k < 3000; ++k) {
    REQUIRE(device->Read(k * 1'000'000, sample) == DeviceStatus::kOk);
    REQUIRE((device->Write(force) - force).norm() < 1e-4);
  }
  REQUIRE((sample.target - home).norm() < 1e-15);
  // The force is allocated anew each millisecond at the measured pose, right to a count: F/k.
  REQUIRE((sample.position - home - force / settings.hand.stiffness_n_per_m).norm() < 3e-5);
  REQUIRE(sample.orientation.angularDistance(Quat::Identity()) < 3 * kG6X3CountLength / kArm);
}

TEST_CASE("four motors make a point, eight a grip, and nothing else a device") {
  SpidarSettings spidar = G6X3Settings();
  const auto made = [&] { return MakeSpidar(spidar, std::make_unique<ScriptedBoard>()); };
  REQUIRE(dynamic_cast<SpidarGrip*>(made().get()) != nullptr);
  spidar.attachments_mm.pop_back();
  REQUIRE_THROWS_AS(made(), std::invalid_argument);
  spidar.motors_m.pop_back();
  REQUIRE_THROWS_AS(made(), std::invalid_argument);
  spidar.attachments_mm.clear();
  spidar.motors_m = {Vec3(-1, 1, 1), Vec3(1, 1, -1), Vec3(-1, -1, -1), Vec3(1, -1, 1)};
  REQUIRE(dynamic_cast<Spidar*>(made().get()) != nullptr);
}

}  // namespace
}  // namespace rikiseki::haptic
