// SPDX-License-Identifier: MIT
// The thread that reads the scene again: what comes of a changed file, of a broken one, of a request.
#include "world_server/scene_reload.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <functional>
#include <thread>

#include "tests/common/temporary_folder.h"

namespace rikiseki::world {
namespace {

std::string Ball(const std::string& name, double x, double mass_kg = 1) {
  return "<model name=\"" + name + "\"><pose>" + std::to_string(x) +
         " 0 1 0 0 0</pose><link name=\"l\">\n<inertial><mass>" + std::to_string(mass_kg) +
         "</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>\n"
         "<collision name=\"c\"><geometry><sphere><radius>0.1</radius></sphere></geometry>"
         "</collision></link></model>\n";
}

std::string World(const std::string& content) {
  return "<sdf version=\"1.9\">\n<world name=\"w\"><gravity>0 0 0</gravity>\n" + content +
         "</world></sdf>\n";
}

// A step that runs what was loaded, and the reload beside it.
class Running {
 public:
  // `meanwhile` is called when the scene is loaded and does not run yet.
  explicit Running(
      const std::string& path, bool watch = true, const std::function<void()>& meanwhile = [] {})
      : settings_(SettingsFor(path, watch)) {
    ReadyScene ready = LoadScene(settings_);
    meanwhile();
    step_ =
        std::make_unique<WorldStep>(settings_, ready.loaded.scene, std::move(ready.dynamics), 0);
    reload_ = std::make_unique<SceneReload>(settings_, std::move(ready.watch));
  }

  std::optional<ReloadReport> WaitForReport(double seconds = 20) {
    for (int i = 0; i < seconds * 100; ++i) {
      if (auto report = reload_->Poll(*step_)) return report;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return std::nullopt;
  }

  WorldStep& step() { return *step_; }
  SceneReload& reload() { return *reload_; }

 private:
  static Settings SettingsFor(const std::string& path, bool watch) {
    Settings settings;
    settings.scene.file = path;
    settings.scene.watch = watch;
    return settings;
  }

  Settings settings_;
  std::unique_ptr<WorldStep> step_;
  std::unique_ptr<SceneReload> reload_;
};

}  // namespace

TEST_CASE("a changed file changes the running scene, a broken one is named and leaves it") {
  const TemporaryFolder folder;
  const std::string path = folder.Write("scene.sdf", World(Ball("a", 0)));
  Running world(path);
  folder.Rename("scene.sdf", World(Ball("a", 0) + Ball("b", 1)));
  auto report = world.WaitForReport();
  REQUIRE(report);
  CHECK(report->replaced);
  CHECK(report->refused.empty());
  REQUIRE(world.step().Bodies().size() == 2);
  CHECK(world.step().Bodies()[0].generation == 1);

  folder.Write("scene.sdf", World(Ball("a", 0) + Ball("b", 1, -2)));
  report = world.WaitForReport();
  REQUIRE(report);
  CHECK_FALSE(report->replaced);
  CAPTURE(report->refused);
  CHECK(report->refused.find(path + ":") != std::string::npos);
  CHECK(world.step().Bodies().size() == 2);

  folder.Write("scene.sdf", World(Ball("b", 1)));
  report = world.WaitForReport();
  REQUIRE(report);
  CHECK(report->replaced);
  REQUIRE(world.step().Bodies().size() == 1);
  CHECK(world.step().Bodies()[0].body == 1);
  CHECK(world.step().Bodies()[0].generation == 1);

  // The same text written anew is no news.
  folder.Rename("scene.sdf", World(Ball("b", 1)));
  CHECK_FALSE(world.WaitForReport(1));
  CHECK(world.step().health().resets == 2);
}

TEST_CASE("a file that changes while the server starts is noticed") {
  const TemporaryFolder folder;
  const std::string path = folder.Write("scene.sdf", World(Ball("a", 0)));
  Running world(path, true,
                [&] { folder.Rename("scene.sdf", World(Ball("a", 0) + Ball("b", 1))); });
  const auto report = world.WaitForReport();
  REQUIRE(report);
  CHECK(world.step().Bodies().size() == 2);
}

TEST_CASE("an included model is watched too, and what is asked for starts everything anew") {
  const TemporaryFolder folder;
  folder.Write("ball/model.config",
               "<model><name>ball</name><version>1</version><sdf "
               "version=\"1.9\">model.sdf</sdf></model>");
  const auto model = [](double mass_kg) {
    return "<sdf version=\"1.9\">" + Ball("ball", 0, mass_kg) + "</sdf>";
  };
  folder.Write("ball/model.sdf", model(1));
  const std::string path =
      folder.Write("scene.sdf", World("<include><uri>model://ball</uri></include>" + Ball("a", 3)));
  Running world(path);
  folder.Rename("ball/model.sdf", model(2));
  auto report = world.WaitForReport();
  REQUIRE(report);
  CHECK(report->replaced);
  const auto mass_2 = [](const protocol::Body& body) { return body.mass == 2; };
  CHECK(std::count_if(world.step().Bodies().begin(), world.step().Bodies().end(), mass_2) == 1);

  world.reload().Restart(path);
  report = world.WaitForReport();
  REQUIRE(report);
  CHECK(report->replaced);
  CHECK(world.step().health().resets == 2);
  for (const protocol::Body& body : world.step().Bodies()) CHECK(body.generation >= 2);
}

TEST_CASE("a scene that is not watched is read again only when it is asked for") {
  const TemporaryFolder folder;
  const std::string path = folder.Write("scene.sdf", World(Ball("a", 0)));
  Running world(path, /*watch=*/false);
  folder.Rename("scene.sdf", World(Ball("b", 0)));
  CHECK_FALSE(world.WaitForReport(1));
  world.reload().Restart(path);
  const auto report = world.WaitForReport();
  REQUIRE(report);
  CHECK(report->replaced);
  CHECK(world.step().Bodies()[0].body == 1);
}

}  // namespace rikiseki::world
