// The guided procedures as a person runs them, on the simulated device: what is found is said, and saved
// where it belongs.
#include <signal.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "common/config_edit.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;

constexpr double kPatienceS = 180;

std::string Text(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

// With a device file of its own, and haptic_server's words on stderr, where Child keeps them.
class Procedure {
 public:
  explicit Procedure(const std::string& option, const std::vector<std::string>& more = {})
      : file_(std::filesystem::temp_directory_path() /
              ("rikiseki-guided" + option + "-" + std::to_string(getpid()) + ".ini")) {
    std::filesystem::copy_file(SourceFile("config/devices/simulated.ini"), file_,
                               std::filesystem::copy_options::overwrite_existing);
    std::vector<std::string> command = {"/bin/sh",
                                        "-c",
                                        "exec \"$@\" 1>&2",
                                        "sh",
                                        Program("haptic_server"),
                                        "--config",
                                        SourceFile("config/haptic_server.ini"),
                                        "--device",
                                        "simulated",
                                        "--set",
                                        "device.file=" + file_.string(),
                                        option};
    command.insert(command.end(), more.begin(), more.end());
    child_.emplace(command);
  }
  ~Procedure() { std::filesystem::remove(file_); }

  Child& child() { return *child_; }
  std::string Words() const { return child_->Stderr(); }
  std::string File() const { return Text(file_); }

 private:
  std::filesystem::path file_;
  std::optional<Child> child_;
};

// What `key = ` is followed by.
std::string Value(const std::string& file, const std::string& key) {
  std::istringstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(key + " = ")) return line.substr(key.size() + 3);
  }
  FAIL("no " << key << " in " << file);
  return "";
}

}  // namespace

TEST_CASE("calibration, identification and Z-width on the simulated device") {
  const std::string before = Text(SourceFile("config/devices/simulated.ini"));
  Procedure calibrate("--calibrate");
  // A device that differs from what its file says.
  Procedure identify("--identify", {"--set", "spidar.moving_mass_kg=0.05", "--set",
                                    "spidar.friction_damping_ns_per_m=0.4"});
  Procedure z_width("--z-width", {"--set", "render.damping_ns_per_m=0.3"});

  CHECK(identify.child().Wait(kPatienceS) == 0);
  INFO(identify.Words());
  CHECK_THAT(identify.Words(),
             Contains("let go of it") && Contains("moving mass") && Contains("Saved in"));
  const std::string identified = identify.File();
  // As much as in virtual time: the simulated grip moves by the time that really passes.
  CHECK(std::stod(Value(identified, "moving_mass_kg")) == Approx(0.05).epsilon(0.05));
  CHECK(std::stod(Value(identified, "friction_damping_ns_per_m")) == Approx(0.4).epsilon(0.1));
  // Four values are others, and nothing else.
  std::vector<std::pair<std::string, std::string>> values;
  for (const std::string key :
       {"moving_mass_kg", "friction_damping_ns_per_m", "friction_n", "latency_us"}) {
    values.emplace_back(std::string("spidar.").append(key), Value(identified, key));
  }
  CHECK(WithValues(before, values) == identified);

  CHECK(calibrate.child().Wait(kPatienceS) == 0);
  INFO(calibrate.Words());
  CHECK_THAT(calibrate.Words(), Contains("Hold the grip in the middle") &&
                                    Contains("contradicted each other") && Contains("Saved in"));
  CHECK(calibrate.File() != before);
  CHECK_THAT(calibrate.File(), Contains("\nmotors_m = -0.26") && Contains("# String length per"));

  CHECK(z_width.child().Wait(kPatienceS) == 0);
  INFO(z_width.Words());
  CHECK_THAT(z_width.Words(), Contains("Theory, without dry friction: the device alone (30 g"));
  CHECK(z_width.File() == before);
}

TEST_CASE("a guided procedure that is interrupted saves nothing, and one at a time is asked for") {
  const std::string before = Text(SourceFile("config/devices/simulated.ini"));
  Procedure stopped("--identify");
  REQUIRE(Eventually([&] { return !stopped.Words().empty(); }, 20));
  stopped.child().Signal(SIGUSR1);
  CHECK(stopped.child().Wait() == 1);
  CHECK_THAT(stopped.Words(), Contains("interrupted"));
  CHECK(stopped.File() == before);
  Procedure ended("--calibrate");
  REQUIRE(Eventually([&] { return !ended.Words().empty(); }, 20));
  ended.child().Signal(SIGTERM);
  CHECK(ended.child().Wait() == 0);
  CHECK(ended.File() == before);
  Procedure both("--identify", {"--z-width"});
  CHECK(both.child().Wait() == 64);
  CHECK_THAT(both.Words(), Contains("one at a time"));
}
