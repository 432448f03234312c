// SPDX-License-Identifier: MIT
// The guided procedures as a person runs them, on the simulated device: what is found is said, and saved
// where it belongs.
#include <signal.h>

#include <catch2/catch.hpp>

#include "common/config_edit.h"
#include "tests/process/guided_process.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;

constexpr double kPatienceS = 180;

GuidedProcess Start(const std::string& option, const std::vector<std::string>& more = {}) {
  return {"simulated.ini", option,
          [](const std::vector<std::string>& arguments) {
            std::vector<std::string> command = {Program("haptic_server"), "--config",
                                                SourceFile("config/haptic_server.ini"), "--device",
                                                "simulated"};
            command.insert(command.end(), arguments.begin(), arguments.end());
            return command;
          },
          more};
}

}  // namespace

TEST_CASE("calibration, identification and Z-width on the simulated device") {
  GuidedProcess calibrate = Start("--calibrate");
  // A device that differs from what its file says.
  GuidedProcess identify = Start("--identify", {"--set", "spidar.moving_mass_kg=0.05", "--set",
                                                "spidar.friction_damping_ns_per_m=0.4"});
  GuidedProcess z_width = Start("--z-width", {"--set", "render.damping_ns_per_m=0.3"});

  CHECK(identify.child().Wait(kPatienceS) == 0);
  INFO(identify.Words());
  CHECK_THAT(identify.Words(),
             Contains("let go of it") && Contains("moving mass") && Contains("Saved in"));
  const std::string identified = identify.File();
  // As much as in virtual time: the simulated grip moves by the time that really passes.
  CHECK(std::stod(ValueOf(identified, "moving_mass_kg")) == Approx(0.05).epsilon(0.05));
  CHECK(std::stod(ValueOf(identified, "friction_damping_ns_per_m")) == Approx(0.4).epsilon(0.1));
  // Four values are others, and nothing else.
  std::vector<std::pair<std::string, std::string>> values;
  for (const std::string key :
       {"moving_mass_kg", "friction_damping_ns_per_m", "friction_n", "latency_us"}) {
    values.emplace_back(std::string("spidar.").append(key), ValueOf(identified, key));
  }
  CHECK(WithValues(identify.before(), values) == identified);

  CHECK(calibrate.child().Wait(kPatienceS) == 0);
  INFO(calibrate.Words());
  CHECK_THAT(calibrate.Words(), Contains("Hold the grip in the middle") &&
                                    Contains("contradicted each other") && Contains("Saved in"));
  CHECK(calibrate.File() != calibrate.before());
  CHECK_THAT(calibrate.File(), Contains("\nmotors_m = -0.26") && Contains("# String length per"));

  CHECK(z_width.child().Wait(kPatienceS) == 0);
  INFO(z_width.Words());
  CHECK_THAT(z_width.Words(), Contains("Theory, without dry friction: the device alone (30 g"));
  CHECK(z_width.File() == z_width.before());
}

TEST_CASE("a guided procedure that is interrupted saves nothing, and one at a time is asked for") {
  GuidedProcess stopped = Start("--identify");
  REQUIRE(Eventually([&] { return !stopped.Words().empty(); }, 20));
  stopped.child().Signal(SIGUSR1);
  CHECK(stopped.child().Wait() == 1);
  CHECK_THAT(stopped.Words(), Contains("interrupted"));
  CHECK(stopped.File() == stopped.before());
  GuidedProcess ended = Start("--calibrate");
  REQUIRE(Eventually([&] { return !ended.Words().empty(); }, 20));
  ended.child().Signal(SIGTERM);
  CHECK(ended.child().Wait() == 0);
  CHECK(ended.File() == ended.before());
  GuidedProcess both = Start("--identify", {"--z-width"});
  CHECK(both.child().Wait() == 64);
  CHECK_THAT(both.Words(), Contains("one at a time"));
}
