// SPDX-License-Identifier: MIT
#include "haptic_server/settings.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace rikiseki::haptic {
namespace {

const std::string kShipped = RIKISEKI_SOURCE_DIR "/config/haptic_server.ini";
const std::string kShippedDevice = RIKISEKI_SOURCE_DIR "/config/devices/simulated.ini";
const std::string kShippedGrip = RIKISEKI_SOURCE_DIR "/config/devices/spidar_g6x3r_simple.ini";
const std::string kShippedBoard = RIKISEKI_SOURCE_DIR "/config/devices/spidar4_simple.ini";

// A folder of its own for each test, with the shipped files to damage.
class Folder {
 public:
  Folder() {
    std::string pattern = std::filesystem::temp_directory_path() / "rikiseki_settings_XXXXXX";
    REQUIRE(mkdtemp(pattern.data()) != nullptr);
    path_ = pattern;
    std::filesystem::create_directory(path_ / "devices");
    std::filesystem::copy(kShipped, Daemon());
    std::filesystem::copy(kShippedDevice, Device());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string Daemon() const { return path_ / "haptic_server.ini"; }
  std::string Device() const { return path_ / "devices/simulated.ini"; }

  // Puts `line` in the place of the one that gives `key`; returns its number.
  static int Replace(const std::string& file, const std::string& key, const std::string& line) {
    std::ifstream in(file);
    std::ostringstream out;
    std::string old;
    int found = 0;
    for (int number = 1; std::getline(in, old); ++number) {
      const bool is_it = old.starts_with(key + " =");
      if (is_it) found = number;
      out << (is_it ? line : old) << "\n";
    }
    REQUIRE(found > 0);
    std::ofstream(file) << out.str();
    return found;
  }

 private:
  std::filesystem::path path_;
};

std::string Refusal(const std::string& path, const std::vector<std::string>& set = {}) {
  try {
    LoadSettings(path, set);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

std::set<std::string> KeysOf(const std::string& path) {
  std::ifstream file(path);
  std::set<std::string> keys;
  std::string section;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (line[0] == '[') {
      section = line.substr(1, line.find(']') - 1);
    } else {
      keys.insert(section + "." + line.substr(0, line.find(' ')));
    }
  }
  return keys;
}

TEST_CASE("the shipped files load and give every key, no more and no less") {
  std::string description;
  const Settings settings = LoadSettings(kShipped, {}, &description);
  std::set<std::string> known;
  std::istringstream lines(description);
  for (std::string line; std::getline(lines, line);) known.insert(line.substr(0, line.find(' ')));
  std::set<std::string> shipped = KeysOf(kShipped);
  shipped.merge(KeysOf(kShippedDevice));
  shipped.merge(KeysOf(kShippedBoard));
  shipped.merge(KeysOf(kShippedGrip));
  REQUIRE(shipped == known);

  // What the files say is what the code has as default.
  const Settings defaults;
  REQUIRE(settings.loop.rate_hz == defaults.loop.rate_hz);
  REQUIRE(settings.period_ns() == 1'000'000);
  REQUIRE(settings.loop.fault_after_misses == defaults.loop.fault_after_misses);
  REQUIRE(settings.render.stiffness_n_per_m == defaults.render.stiffness_n_per_m);
  REQUIRE(settings.render.adhesion == defaults.render.adhesion);
  REQUIRE(settings.safety.force_cap_n == defaults.safety.force_cap_n);
  REQUIRE(settings.safety.lost_floor_ms == defaults.safety.lost_floor_ms);
  REQUIRE(settings.hand.home_mm == defaults.hand.home_mm);
  REQUIRE(settings.spidar.count_length_m == defaults.spidar.count_length_m);
  REQUIRE(settings.spidar.tension_max_n == defaults.spidar.tension_max_n);
  REQUIRE(settings.spidar.motors_m.size() == 4);
  REQUIRE(settings.spidar.motors_m[3] == Vec3(0.265, -0.265, 0.265));
}

TEST_CASE("every key changes the settings") {
  std::string description;
  LoadSettings(kShipped, {}, &description);
  const std::vector<std::string> changes = {
      "loop.rate_hz=2000",
      "loop.fifo_priority=70",
      "loop.cpu=1",
      "loop.realtime=enforce",
      "loop.fault_after_misses=5",
      "loop.longest_world_period_ms=150",
      "render.stiffness_n_per_m=1500",
      "render.damping_ns_per_m=3",
      "render.adhesion=true",
      "render.display=hold",
      "render.finger_radius_mm=5",
      "render.friction_stiffness_n_per_m=500",
      "safety.force_cap_n=5",
      "safety.slew_limit_n_per_s=4000",
      "safety.speed_limit_m_per_s=2",
      "safety.light_damping_ns_per_m=2",
      "safety.passivity_controller=on",
      "safety.soft_start_ms=100",
      "safety.fade_ms=60",
      "safety.late_periods=2",
      "safety.lost_periods=6",
      "safety.lost_floor_ms=300",
      "mapping.origin_mm=10 0 -5",
      "mapping.rotation_deg=0 0 90",
      "mapping.motion_scale=2",
      "mapping.force_scale=0.5",
      "hand.script=rest",
      "hand.mass_kg=1",
      "hand.damping_ns_per_m=10",
      "hand.stiffness_n_per_m=400",
      "hand.home_mm=-40 1 2",
      "hand.stroke_mm=100 0 0",
      "hand.reach_ms=200",
      "hand.hold_ms=50",
      "hand.return_ms=200",
      "hand.rest_ms=400",
      "hand.rest_jitter_ms=10",
      "hand.seed=2",
      "spidar.count_length_m=1e-5",
      "spidar.tension_min_n=0.3",
      "spidar.tension_max_n=10",
      "spidar.velocity_cutoff_hz=50",
      "spidar.moving_mass_kg=0.05",
      "spidar.friction_damping_ns_per_m=0.1",
      "usb.board=sh4",
      "usb.switch_id=3",
      "usb.serial=17",
      "usb.channels=4 5 6 7",
      "usb.count_directions=1 -1 1 -1",
      "usb.digit_per_volt=416",
      "usb.volt_per_newton=0.3 0.31 0.32 0.33",
      "usb.phase_mask=165",
      "usb.enable_bit=2",
      "usb.reply_within_us=300",
      "spidar.motors_m=-0.3 0.3 0.3, 0.3 0.3 -0.3, -0.3 -0.3 -0.3, 0.3 -0.3 0.3"};
  for (const std::string& change : changes) {
    std::string changed;
    REQUIRE_NOTHROW(LoadSettings(kShipped, {change}, &changed));
    CAPTURE(change);
    REQUIRE(changed != description);
  }
  const Settings settings = LoadSettings(kShipped, changes);
  REQUIRE(settings.period_ns() == 500'000);
  REQUIRE(settings.loop.realtime == RealtimePolicy::kEnforce);
  REQUIRE(settings.render.display == DisplayRule::kHold);
  REQUIRE(settings.render.adhesion);
  REQUIRE(settings.hand.home_mm == Vec3(-40, 1, 2));
  REQUIRE(settings.spidar.motors_m[0] == Vec3(-0.3, 0.3, 0.3));
}

TEST_CASE("refusals name file, line, key and what would be right") {
  const Folder folder;
  const std::string daemon = folder.Daemon();
  const auto refused = [&](const std::string& key, const std::string& line) {
    const int number = Folder::Replace(daemon, key, line);
    const std::string text = Refusal(daemon);
    CAPTURE(text);
    REQUIRE(text.starts_with(daemon + ":" + std::to_string(number) + ": "));
    return text;
  };
  SECTION("an unknown key") {
    const std::string text = refused("rate_hz", "rate_khz = 1");
    REQUIRE(text.find("loop.rate_khz") != std::string::npos);
    REQUIRE(text.find("did you mean loop.rate_hz?") != std::string::npos);
  }
  SECTION("a value that is no number") {
    REQUIRE(refused("force_cap_n", "force_cap_n = much").find("a number from 0.1 to 100") !=
            std::string::npos);
  }
  SECTION("a value out of range") {
    REQUIRE(refused("rate_hz", "rate_hz = 50").find("a number from 100 to 8000") !=
            std::string::npos);
  }
  SECTION("a value with its unit") {
    REQUIRE(refused("fade_ms", "fade_ms = 80 ms").find("the unit is part of the key's name") !=
            std::string::npos);
  }
  SECTION("something that is not finite") {
    REQUIRE(refused("finger_radius_mm", "finger_radius_mm = inf").find("a number from") !=
            std::string::npos);
  }
  SECTION("an unknown word") {
    REQUIRE(refused("display", "display = guess").find("interpolate | hold | extrapolate") !=
            std::string::npos);
  }
  SECTION("a key given twice") {
    const std::string text = refused("fifo_priority", "rate_hz = 1000");
    REQUIRE(text.find("given before, in line") != std::string::npos);
  }
  SECTION("a force that takes too long to go") {
    const int number = Folder::Replace(daemon, "slew_limit_n_per_s", "slew_limit_n_per_s = 400");
    const std::string text = Refusal(daemon);
    CAPTURE(text);
    REQUIRE(number > 0);
    REQUIRE(text.find(daemon + ":") == 0);
    REQUIRE(text.find("safety.fade_ms = 80") != std::string::npos);
    REQUIRE(text.find("100 ms") != std::string::npos);
  }
  SECTION("late after lost") {
    REQUIRE(refused("lost_periods", "lost_periods = 2").find("safety.late_periods") !=
            std::string::npos);
  }
}

TEST_CASE("refusals of the device file name that file") {
  const Folder folder;
  const std::string device = folder.Device();
  const auto refused = [&](const std::string& key, const std::string& line) {
    const int number = Folder::Replace(device, key, line);
    const std::string text = Refusal(folder.Daemon());
    CAPTURE(text);
    REQUIRE(text.starts_with(device + ":" + std::to_string(number) + ": spidar." + key));
    return text;
  };
  SECTION("three motors") {
    REQUIRE(refused("motors_m", "motors_m = 0 0 1, 0 1 0, 1 0 0").find("exactly 4") !=
            std::string::npos);
  }
  SECTION("motors in a plane") {
    REQUIRE(refused("motors_m", "motors_m = 0 0 0, 0 1 0, 1 0 0, 1 1 0").find("in one plane") !=
            std::string::npos);
  }
  SECTION("bounds the wrong way round") {
    REQUIRE(refused("tension_max_n", "tension_max_n = 0.4").find("spidar.tension_min_n") !=
            std::string::npos);
  }
}

TEST_CASE("of eight strings every key counts too, and what cannot hold a grip is refused") {
  const std::string file = "device.file=" + kShippedGrip;
  const Settings settings = LoadSettings(kShipped, {file});
  REQUIRE(settings.spidar.motors_m.size() == 8);
  REQUIRE(settings.spidar.attachments_mm.size() == 8);
  REQUIRE(settings.spidar.attachments_mm[2] == Vec3(0, -22.5, 0));
  REQUIRE(settings.spidar.rest_tension_n == 1);
  REQUIRE(LoadSettings(kShipped, {file, "spidar.rest_tension_n=2"}).spidar.rest_tension_n == 2);

  const auto refused = [&](const std::string& change, const std::string& why) {
    const std::string text = Refusal(kShipped, {file, change});
    CAPTURE(change, text);
    // Where the key stands that would have to change.
    CHECK((text.starts_with("--set " + change) || text.starts_with(kShippedGrip + ":")));
    CHECK(text.find(why) != std::string::npos);
  };
  refused("spidar.rest_tension_n=0.2", "between spidar.tension_min_n and spidar.tension_max_n");
  refused("spidar.rest_tension_n=21", "between spidar.tension_min_n and spidar.tension_max_n");
  refused("spidar.tension_max_n=0.2", "it must exceed spidar.tension_min_n");
  refused("spidar.attachments_mm=0 0 1, 0 1 0", "8 places are expected, one for each motor");
  refused("spidar.attachments_mm=0 0 0, 0 0 0, 0 0 0, 0 0 0, 0 0 0, 0 0 0, 0 0 0, 0 0 0",
          "do not fix the grip in all six directions");
  refused("spidar.motors_m=-1 1 1, 1 1 -1, -1 -1 -1, 1 -1 1", "leave it out, or give 8 motors");
  refused("spidar.motors_m=-1 1 1, 1 1 -1, -1 -1 -1, 1 -1 1, 1 1 1", "exactly 4 motors, or 8");
  // Strings that all turn the grip the same way about y: the table of the finger grip, as published
  // (Springhead, SpidarG6X3F), does.
  const std::string text =
      Refusal(kShipped,
              {file,
               "spidar.motors_m=-0.06 -0.073 -0.06, 0.06 -0.073 -0.06, 0.06 -0.073 0.06, -0.06 "
               "-0.073 0.06, -0.06 0.073 -0.06, 0.06 0.073 -0.06, 0.06 0.073 0.06, -0.06 0.073 "
               "0.06",
               "spidar.attachments_mm=-16 0 0, 0 0 -16, 16 0 0, 0 0 16, -16 0 0, 0 0 -16, 16 0 0, "
               "0 0 16"});
  CAPTURE(text);
  CHECK(text.starts_with("--set spidar.attachments_mm"));
  CHECK(text.find("cannot hold the grip still in the middle") != std::string::npos);

  for (const char* of_a_grip : {"spidar.attachments_mm=0 0 1", "spidar.rest_tension_n=1"}) {
    CHECK(Refusal(kShipped, {of_a_grip}).find("meet in one point") != std::string::npos);
  }
}

TEST_CASE("a missing device file, or none named, is refused") {
  const Folder folder;
  const int number = Folder::Replace(folder.Daemon(), "file", "file = devices/nowhere.ini");
  REQUIRE(Refusal(folder.Daemon()).find("devices/nowhere.ini: the configuration cannot be read") !=
          std::string::npos);
  REQUIRE(number > 0);
  Folder::Replace(folder.Daemon(), "file", "# no file");
  REQUIRE(Refusal(folder.Daemon()).find("device.file") != std::string::npos);
  REQUIRE(Refusal("/nowhere/haptic_server.ini").find("/nowhere/haptic_server.ini") == 0);
}

TEST_CASE("overrides are checked as files are, in both schemas") {
  REQUIRE(Refusal(kShipped, {"loop.rate_hz=1e9"}).starts_with("--set loop.rate_hz=1e9: "));
  REQUIRE(Refusal(kShipped, {"spidar.tension_min_n=-1"})
              .starts_with("--set spidar.tension_min_n=-1: "));
  REQUIRE(
      Refusal(kShipped, {"spidar.tention_min_n=1"}).find("did you mean spidar.tension_min_n?") !=
      std::string::npos);
  REQUIRE(Refusal(kShipped, {"safety.fade_ms=99"}).starts_with("--set safety.fade_ms=99: "));
}

TEST_CASE("settings from code are checked too") {
  REQUIRE_NOTHROW(CheckSettings(Settings{}));
  const auto refused = [](const std::function<void(Settings&)>& damage) {
    Settings settings;
    damage(settings);
    REQUIRE_THROWS_AS(CheckSettings(settings), std::invalid_argument);
  };
  refused([](Settings& s) { s.loop.rate_hz = 0; });
  refused([](Settings& s) { s.loop.rate_hz = 1e12; });
  refused([](Settings& s) { s.render.stiffness_n_per_m = std::nan(""); });
  refused([](Settings& s) { s.safety.force_cap_n = INFINITY; });
  refused([](Settings& s) { s.safety.fade_ms = 99; });
  refused([](Settings& s) { s.safety.lost_periods = 2; });
}

}  // namespace
}  // namespace rikiseki::haptic
