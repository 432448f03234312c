// SPDX-License-Identifier: MIT
#include "world_server/settings.h"

#include <catch2/catch.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "tests/common/tuning_page.h"

namespace rikiseki::world {
namespace {

const std::string kShipped = std::string(RIKISEKI_SOURCE_DIR) + "/config/world_server.ini";

std::string Refusal(const std::vector<std::string>& set) {
  try {
    LoadSettings(kShipped, set);
  } catch (const ConfigError& error) {
    CHECK(error.exit_code() == kExitConfig);
    return error.what();
  }
  return "accepted";
}

std::set<std::string> KeysOf(const std::string& text, bool sections) {
  std::set<std::string> keys;
  std::istringstream lines(text);
  std::string section;
  for (std::string line; std::getline(lines, line);) {
    if (sections && line.starts_with("[")) section = line.substr(1, line.find(']') - 1) + ".";
    const auto equals = line.find(" = ");
    if (equals != std::string::npos && !line.starts_with(" ") && !line.starts_with("#")) {
      keys.insert(section + line.substr(0, equals));
    }
  }
  return keys;
}

}  // namespace

TEST_CASE("the page on tuning has every key of the world, and says which are live") {
  ConfigValues values;
  LoadSettings(kShipped, {}, nullptr, &values);
  REQUIRE_FALSE(values.empty());
  for (const auto& [key, value] : values) CheckTuningPage(key, LiveKeys());
}

TEST_CASE("the shipped file documents every key, with the defaults of the code") {
  std::string description;
  const Settings shipped = LoadSettings(kShipped, {}, &description);
  std::ifstream file(kShipped);
  std::stringstream text;
  text << file.rdbuf();
  CHECK(KeysOf(text.str(), true) == KeysOf(description, false));
  CHECK(KeysOf(text.str(), true).size() == 10);

  const Settings defaults;
  CHECK(shipped.loop.rate_hz == defaults.loop.rate_hz);
  CHECK(shipped.physics.substep_ms == defaults.physics.substep_ms);
  CHECK(shipped.coupling.coupling == defaults.coupling.coupling);
  CHECK(shipped.coupling.replay == defaults.coupling.replay);
  CHECK(shipped.coupling.force_cap_n == defaults.coupling.force_cap_n);
  CHECK(shipped.coupling.gap_ms == defaults.coupling.gap_ms);
  CHECK(shipped.features.radius_mm == defaults.features.radius_mm);
  CHECK(shipped.features.finger_friction == defaults.features.finger_friction);
  CHECK(std::filesystem::exists(shipped.scene.file));
}

TEST_CASE("every key reaches its setting") {
  const Settings settings = LoadSettings(
      kShipped,
      {"loop.rate_hz=50", "scene.file=/a/b.sdf", "scene.watch=false", "physics.substep_ms=2",
       "coupling.coupling=position", "coupling.replay=lump", "coupling.force_cap_n=7",
       "coupling.gap_ms=250", "features.radius_mm=33", "features.finger_friction=0.5"});
  CHECK(settings.period_ns() == 20'000'000);
  CHECK(settings.scene.file == "/a/b.sdf");
  CHECK_FALSE(settings.scene.watch);
  CHECK(settings.physics.substep_ms == 2);
  CHECK(settings.coupling.coupling == protocol::Coupling::kPosition);
  CHECK(settings.coupling.replay == ReplayRule::kLump);
  CHECK(settings.coupling.force_cap_n == 7);
  CHECK(settings.gap_s() == 0.25);
  CHECK(settings.features.radius_mm == 33);
  CHECK(settings.features.finger_friction == 0.5);
}

TEST_CASE("the gap follows the rate where it is not given") {
  Settings settings;
  CHECK(settings.gap_s() == Approx(0.15));  // three periods of 50 ms
  settings.loop.rate_hz = 60;
  CHECK(settings.gap_s() == 0.1);
  settings.loop.rate_hz = 3;
  CHECK(settings.period_ns() == 333'333'333);
}

TEST_CASE("refusals name place, key, value and cure in one line") {
  CHECK(Refusal({"loop.rate_hz=0"}) ==
        "--set loop.rate_hz=0: loop.rate_hz = 0: a number from 1 to 1000 is expected (the unit is "
        "part of the key's name)");
  CHECK(Refusal({"coupling.coupling=magic"}).find("one of position | impulse | local") !=
        std::string::npos);
  CHECK(Refusal({"coupling.force_cap=3"}).find("did you mean coupling.force_cap_n?") !=
        std::string::npos);
  for (const char* bad : {"loop.rate_hz=nan", "physics.substep_ms=0", "coupling.gap_ms=-1",
                          "features.radius_mm=inf", "scene.file="}) {
    CHECK(Refusal({bad}) != "accepted");
  }

  const std::string path = std::filesystem::temp_directory_path() / "rikiseki_settings_test.ini";
  std::ofstream(path) << "[loop]\nrate_hz = 20\n";
  try {
    LoadSettings(path, {});
    FAIL("a scene is needed");
  } catch (const ConfigError& error) {
    CHECK(std::string(error.what()) ==
          "default: scene.file = : the path of an SDFormat world is expected");
  }
  std::remove(path.c_str());
}

}  // namespace rikiseki::world
