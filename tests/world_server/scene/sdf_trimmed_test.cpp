// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_trimmed.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <vector>

#include "tests/common/temporary_folder.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

sdf::ParserConfig ConfigFor(const fs::path& path) {
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  config.AddURIPath("model://", path.parent_path());
  return config;
}

// What libsdformat prints stays out of the test's report.
class Silence {
 public:
  Silence() : before_(std::cerr.rdbuf(text_.rdbuf())) {}
  ~Silence() { std::cerr.rdbuf(before_); }

 private:
  std::ostringstream text_;
  std::streambuf* before_;
};

std::string World(const std::string& content) {
  return "<sdf version=\"1.9\"><world name=\"w\">" + content + "</world></sdf>\n";
}

std::string Link(const std::string& content) {
  return World("<model name=\"m\"><link name=\"l\">" + content + "</link></model>");
}

}  // namespace

TEST_CASE("trimmed or not, every scene is read alike to the last value") {
  std::vector<fs::path> scenes;
  for (const char* folder : {"/config/scenes", "/tests/data/worlds"}) {
    for (const auto& entry : fs::directory_iterator(RIKISEKI_SOURCE_DIR + std::string(folder))) {
      const std::string kind = entry.path().extension();
      // A thousand links say no more than one, and take seconds.
      if ((kind == ".sdf" || kind == ".world") && entry.path().stem() != "thousand") {
        scenes.push_back(entry.path());
      }
    }
  }
  REQUIRE(scenes.size() >= 10);
  std::size_t read = 0;
  for (const fs::path& scene : scenes) {
    CAPTURE(scene);
    const Silence silence;
    sdf::Root trimmed, whole;
    const bool is_loaded = LoadTrimmed(scene, ConfigFor(scene), trimmed);
    const sdf::Errors errors = whole.Load(scene, ConfigFor(scene));
    if (!is_loaded) {
      CHECK_FALSE(errors.empty());
      continue;
    }
    ++read;
    CHECK(errors.empty());
    CHECK(trimmed.Element()->ToString("") == whole.Element()->ToString(""));
  }
  CHECK(read >= 10);
}

TEST_CASE("what is in the file is known, and what is wrong with it is left to the full reading") {
  const TemporaryFolder folder;
  const Silence silence;
  const auto loads = [&](const std::string& text) {
    const fs::path path = folder.Write("scene.sdf", text);
    sdf::Root root;
    const bool is_loaded = LoadTrimmed(path, ConfigFor(path), root);
    CHECK(is_loaded == (root.WorldCount() == 1));
    return is_loaded;
  };
  CHECK(loads(Link("")));
  CHECK(
      loads(Link("<sensor name=\"s\" type=\"camera\"><camera><image><width>8</width></image>"
                 "</camera></sensor>")));
  CHECK_FALSE(loads(Link("<senso/>")));
  CHECK_FALSE(loads(Link("<inertial><mass>heavy</mass></inertial>")));
  CHECK_FALSE(loads(Link("<pose>0 0 0 0 0 0")));
  CHECK_FALSE(loads("none"));
  sdf::Root root;
  CHECK_FALSE(LoadTrimmed("/nowhere/at/all.sdf", ConfigFor("/nowhere/at/all.sdf"), root));
}

}  // namespace rikiseki::world
