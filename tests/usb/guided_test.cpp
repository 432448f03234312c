// SPDX-License-Identifier: MIT
// The guided procedures at an emulated board: they find what is behind it, and leave the motors at zero.
#include <catch2/catch.hpp>
#include <sstream>

#include "common/geometry.h"
#include "tests/process/guided_process.h"
#include "tests/usb/emulated_bus.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;

constexpr double kPatienceS = 180;
constexpr char kModel[] = "spidar4_simple.ini";

GuidedProcess Start(EmulatedBus& bus, const std::string& option) {
  return {kModel, option, [&bus](const std::vector<std::string>& arguments) {
            return bus.HapticCommand("guided", arguments);
          }};
}

void MotorsAreLeftAtZero(EmulatedBus& bus) {
  const EmulatedBus::Status status = bus.status();
  CHECK(status.motors_at_zero == 1);
  CHECK(status.longest_pull_ticks < 20);
  CHECK(status.nonsense == 0);
}

// The number that stands in `text` behind `words`.
double NumberBehind(const std::string& text, const std::string& words) {
  const std::size_t at = text.find(words);
  REQUIRE(at != std::string::npos);
  return std::stod(text.substr(at + words.size()));
}

std::vector<Vec3> MotorsOf(const std::string& text) {
  std::istringstream words(ValueOf(text, "motors_m"));
  std::vector<Vec3> motors;
  Vec3 motor;
  for (char comma = 0; words >> motor.x() >> motor.y() >> motor.z(); words >> comma) {
    motors.push_back(motor);
  }
  return motors;
}

// What of a frame no turn changes: how far the motors are from the middle and from each other.
std::vector<double> DistancesIn(const std::vector<Vec3>& motors) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < motors.size(); ++i) {
    distances.push_back(motors[i].norm());
    for (std::size_t k = 0; k < i; ++k) distances.push_back((motors[i] - motors[k]).norm());
  }
  return distances;
}

double LargestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

}  // namespace

TEST_CASE("calibration at an emulated board finds where its motors are, and saves it") {
  // The frame behind the board differs from the one of the device file by up to 9 mm.
  const std::string truth =
      "-0.257 0.262 0.267, 0.260 0.266 -0.258, -0.262 -0.257 -0.273, 0.266 -0.272 0.268";
  // The hand stays in the middle for longer than a second, whatever the rate, and then goes about the space.
  EmulatedBus bus(kModel,
                  {"--middle-ticks", std::to_string(kUsbRateHz * 7 / 5), "--set",
                   "spidar.motors_m=" + truth, "--set", "hand.script=stir", "--set",
                   "hand.home_mm=-130 -130 -130", "--set", "hand.stroke_mm=260 260 260", "--set",
                   "hand.reach_ms=600", "--set", "hand.hold_ms=0", "--set", "hand.rest_ms=0"});
  bus.Tell("plug");
  GuidedProcess calibrate = Start(bus, "--calibrate");
  const int status = calibrate.child().Wait(kPatienceS);
  INFO(calibrate.Words());
  REQUIRE(status == 0);
  MotorsAreLeftAtZero(bus);
  CHECK_THAT(calibrate.Words(), Contains("Hold the grip in the middle") &&
                                    Contains("Lead the grip slowly") && Contains("Saved in"));
  const std::vector<double> right = DistancesIn(MotorsOf("motors_m = " + truth));
  const double before = LargestDifference(DistancesIn(MotorsOf(calibrate.before())), right);
  const double after = LargestDifference(DistancesIn(MotorsOf(calibrate.File())), right);
  CAPTURE(before, after);
  CHECK(before > 5e-3);
  // Three standard deviations of the worst direction, of about 0.1 mm; as in virtual time.
  CHECK(after < 0.4e-3);
  // What is left is rounding to counts of 29.24 um, 8.44 um as a root mean square; that of 400 places less the
  // 9 unknowns is known to 1 / sqrt(2 * 391) = 3.6 %, five of which are allowed.
  CHECK(NumberBehind(calibrate.Words(), "now by ") == Approx(8.44).epsilon(0.18));
}

TEST_CASE("identification at an emulated board") {
  EmulatedBus bus(kModel, {"--set", "hand.script=rest", "--set", "hand.home_mm=0 0 0", "--set",
                           "hand.mass_kg=0.02", "--set", "hand.damping_ns_per_m=0.3", "--set",
                           "hand.stiffness_n_per_m=0"});
  bus.Tell("plug");
  GuidedProcess identify = Start(bus, "--identify");
  const int status = identify.child().Wait(kPatienceS);
  INFO(identify.Words());
  MotorsAreLeftAtZero(bus);
  // The emulated grip moves on by ticks, and the daemon measures by the clock: where ticks come late, what
  // moves does not look like one mass any more, and nothing may be saved.
  if (status == 0) {
    CHECK(std::stod(ValueOf(identify.File(), "moving_mass_kg")) == Approx(0.05).epsilon(0.15));
  } else {
    WARN("ticks came too late on this machine: " << identify.Words());
    CHECK(status == 1);
    CHECK_THAT(identify.Words(), Contains("too little") || Contains("interrupted"));
    CHECK(identify.File() == identify.before());
  }
}
