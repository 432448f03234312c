// A guided procedure at an emulated board: it finds what is behind it, and leaves the motors at zero.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/usb/emulated_bus.h"

namespace {

using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;

constexpr double kPatienceS = 180;

struct Outcome {
  int status = -1;
  std::string words;
  std::string file;
};

// haptic_server with a device file of its own, its words on stderr, where Child keeps them.
Outcome Run(EmulatedBus& bus, const std::string& model, const std::string& option) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() /
      ("rikiseki-usb-guided" + option + "-" + std::to_string(getpid()) + ".ini");
  std::filesystem::copy_file(SourceFile("config/devices/" + model), file,
                             std::filesystem::copy_options::overwrite_existing);
  std::vector<std::string> command = {"/bin/sh", "-c", "exec \"$@\" 1>&2", "sh"};
  for (const std::string& word :
       bus.HapticCommand("guided", {"--set", "device.file=" + file.string(), option})) {
    command.push_back(word);
  }
  Outcome outcome;
  {
    Child child(command);
    outcome.status = child.Wait(kPatienceS);
    outcome.words = child.Stderr();
  }
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  outcome.file = text.str();
  std::filesystem::remove(file);
  return outcome;
}

void MotorsAreLeftAtZero(EmulatedBus& bus) {
  const EmulatedBus::Status status = bus.status();
  CHECK(status.motors_at_zero == 1);
  CHECK(status.longest_pull_ticks < 20);
  CHECK(status.nonsense == 0);
}

}  // namespace

TEST_CASE("identification at an emulated board") {
  const std::string model = "spidar4_simple.ini";
  EmulatedBus bus(model, {"--set", "hand.script=rest", "--set", "hand.home_mm=0 0 0", "--set",
                          "hand.mass_kg=0.02", "--set", "hand.damping_ns_per_m=0.3", "--set",
                          "hand.stiffness_n_per_m=0"});
  bus.Tell("plug");
  const Outcome outcome = Run(bus, model, "--identify");
  INFO(outcome.words);
  MotorsAreLeftAtZero(bus);
  // The emulated grip moves on by ticks, and the daemon measures by the clock: where ticks come late, what
  // moves does not look like one mass any more, and nothing may be saved.
  if (outcome.status == 0) {
    std::istringstream words(outcome.words.substr(outcome.words.find("moving mass") + 11));
    double grams = 0;
    words >> grams;
    CHECK(grams == Approx(50).epsilon(0.15));
    CHECK_THAT(outcome.file, Contains("\nmoving_mass_kg = 0.0"));
  } else {
    WARN("ticks came too late on this machine: " << outcome.words);
    CHECK(outcome.status == 1);
    CHECK_THAT(outcome.words, Contains("too little") || Contains("interrupted"));
    CHECK_THAT(outcome.file, Contains("\nmoving_mass_kg = 0.03\n"));
  }
}
