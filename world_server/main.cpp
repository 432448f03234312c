// world_server: runs a dynamic rigid-body world at 10-60 Hz for a haptic server beside it.
#include <spdlog/spdlog.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <future>

#include "common/clock.h"
#include "common/daemon.h"
#include "common/logging.h"
#include "common/version.h"
#include "world_server/loop.h"
#include "world_server/physics/deformable_world.h"
#include "world_server/scene/needs.h"
#include "world_server/scene/scene_message.h"
#include "world_server/scene/sdf_loader.h"

namespace {

using namespace rikiseki;         // NOLINT(google-build-using-namespace)
using namespace rikiseki::world;  // NOLINT(google-build-using-namespace)

// Room in world.bodies for scenes that grow when they are reloaded.
constexpr std::uint32_t kBodyRoom = 256;

struct ReadyScene {
  LoadedScene loaded;
  std::unique_ptr<DynamicsWorld> dynamics;
};

ReadyScene Load(const Settings& settings) {
  ReadyScene ready;
  ready.loaded = LoadSdf(settings.scene.file);
  for (const std::string& warning : ready.loaded.warnings) spdlog::warn("{}", warning);
  ready.dynamics = MakeDynamics(ready.loaded.scene, settings.physics.substep_ms * 1e-3);
  return ready;
}

// Tells observers of every scene that runs, once.
class SceneAnnouncer {
 public:
  explicit SceneAnnouncer(const protocol::SegmentOwner& owner)
      : writer_(owner.Stream(protocol::StreamType::kWorldScene)) {}

  void Publish(const Scene& scene, const WorldStep& step) {
    const protocol::WorldScene message = DescribeScene(scene, step.Bodies(), ++revision_);
    if (!writer_.Publish(message, static_cast<std::uint64_t>(MonotonicNow()))) {
      spdlog::warn(
          "scene {} has grown beyond the room in world.scene: observers see the old shapes "
          "until world_server is restarted",
          scene.name);
    }
  }

 private:
  protocol::SceneWriter writer_;
  std::uint64_t revision_ = 0;
};

// Reads the scene again beside the running loop: parsing takes many world ticks.
class SceneReload {
 public:
  SceneReload(const Settings& settings, SceneAnnouncer& announcer)
      : settings_(settings), announcer_(announcer) {}

  /// A second request while one is under way starts another after it.
  void Request() { ++requests_; }

  /// Starts what was requested, and puts what is ready in the place of the running scene. If the file is
  /// refused, the running scene stays.
  void Poll(WorldStep& step) {
    if (loading_.valid() &&
        loading_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
      try {
        ReadyScene ready = loading_.get();
        spdlog::info("scene {} loaded anew: {} bodies", ready.loaded.scene.name,
                     ready.loaded.scene.bodies.size());
        step.Replace(ready.loaded.scene, std::move(ready.dynamics));
        announcer_.Publish(ready.loaded.scene, step);
      } catch (const std::exception& error) {
        spdlog::error("the scene stays as it was: {}", error.what());
      }
    }
    if (requests_ > 0 && !loading_.valid()) {
      requests_ = 0;
      loading_ = std::async(std::launch::async, [this] { return Load(settings_); });
    }
  }

 private:
  const Settings& settings_;
  SceneAnnouncer& announcer_;
  int requests_ = 0;
  std::future<ReadyScene> loading_;
};

void RunUntilStopped(const Settings& settings, WorldStep& step, WorldLoop& loop,
                     protocol::PeerLink& link, SceneAnnouncer& announcer) {
  SceneReload reload(settings, announcer);
  PeriodicSchedule schedule(MonotonicNow(), settings.period_ns());
  std::int64_t missed = 0;
  while (true) {
    SleepUntil(schedule.deadline_ns());
    const std::int64_t now_ns = MonotonicNow();
    switch (WaitForSignal(0)) {
      case SIGINT:
      case SIGTERM:
        return;
      case SIGHUP:
        reload.Request();
        break;
      default:
        break;
    }
    reload.Poll(step);
    loop.Tick(now_ns, schedule.deadline_ns(), missed);
    for (const std::string& line : link.PollNews()) spdlog::info("haptic side: {}", line);
    missed = schedule.Advance(MonotonicNow());
  }
}

int Run(int argc, char** argv) {
  const DaemonOptions options =
      ParseDaemonOptions(argc, argv, "world_server", "the world daemon of Rikiseki",
                         {{"scene", "FILE", "an SDFormat world; wins over scene.file"}});
  std::vector<std::string> overrides = options.set;
  if (!options.extra[0].empty()) overrides.push_back("scene.file=" + options.extra[0]);
  std::string description;
  const Settings settings = LoadSettings(options.config, overrides, &description);
  StartLogging("world_server");
  ReadyScene ready = Load(settings);
  const Scene& scene = ready.loaded.scene;
  if (options.check) {
    std::fputs(description.c_str(), stdout);
    const SceneNeeds needs = WorkOutNeeds(scene);
    std::printf("scene %s: %zu bodies\nneeds: %s\nleft out: %s\n", scene.name.c_str(),
                scene.bodies.size(), InWords(needs.needs).c_str(), InWords(needs.left_out).c_str());
    return kExitOk;
  }
  BlockSignals();
  const auto period_ns = static_cast<std::uint64_t>(settings.period_ns());
  std::uint32_t colliders = 0;
  for (const SceneBody& body : scene.bodies) {
    colliders += static_cast<std::uint32_t>(body.colliders.size());
  }
  const auto body_room = std::max(kBodyRoom, static_cast<std::uint32_t>(scene.bodies.size()));
  protocol::SegmentOwner owner(
      {.instance = options.instance,
       .role = protocol::Role::kWorld,
       .streams = protocol::WorldStreams(period_ns, body_room, period_ns, colliders),
       .build = kBuild,
       .runtime_directory = ""});
  for (const std::string& note : owner.notes()) spdlog::info("{}", note);
  protocol::PeerLink link({.peer = {.instance = options.instance,
                                    .role = protocol::Role::kHaptic,
                                    .required = {{.type = protocol::StreamType::kHapticTick}},
                                    .owners = {}}});
  WorldStep step(settings, scene, std::move(ready.dynamics), owner.epoch());
  WorldLoop loop(settings, step, owner, link);
  spdlog::info("{} at {} Hz, scene {} with {} bodies, build {}", owner.name(),
               settings.loop.rate_hz, scene.name, scene.bodies.size(), kBuild);
  SceneAnnouncer announcer(owner);
  announcer.Publish(scene, step);
  RunUntilStopped(settings, step, loop, link, announcer);
  spdlog::info("stopped");
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  return RunProgram("world_server", [&] {
    try {
      return Run(argc, argv);
    } catch (const protocol::SegmentError& error) {
      throw StartError(error.exit_code(), error.what());
    }
  });
}
