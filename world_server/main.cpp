// SPDX-License-Identifier: MIT
// world_server: runs a dynamic rigid-body world at 10-60 Hz for a haptic server beside it.
#include <spdlog/spdlog.h>

#include <csignal>
#include <cstdio>
#include <utility>

#include "common/clock.h"
#include "common/daemon.h"
#include "common/live_settings.h"
#include "common/logging.h"
#include "common/service_notice.h"
#include "common/version.h"
#include "protocol/words.h"
#include "world_server/loop.h"
#include "world_server/scene/needs.h"
#include "world_server/scene/scene_message.h"
#include "world_server/scene_reload.h"

namespace {

using namespace rikiseki;         // NOLINT(google-build-using-namespace)
using namespace rikiseki::world;  // NOLINT(google-build-using-namespace)

// Room in world.bodies for scenes that grow when they are reloaded.
constexpr std::uint32_t kBodyRoom = 256;

SceneUse UseOf(const Settings& settings) {
  return {.coupling = settings.coupling.coupling,
          .finger_friction = settings.features.finger_friction};
}

// Tells observers of every scene that runs, once.
class SceneAnnouncer {
 public:
  SceneAnnouncer(const protocol::SegmentOwner& owner, const SceneUse& use, std::uint32_t body_room)
      : writer_(owner.Stream(protocol::StreamType::kWorldScene)),
        use_(use),
        body_room_(body_room) {}

  void Publish(const WorldStep& step) {
    const Scene& scene = step.scene();
    const protocol::WorldScene message = DescribeScene(scene, step.Bodies(), ++revision_, use_);
    spdlog::info("needs: {}", InWords(message.needs));
    spdlog::info("left out: {}", InWords(message.left_out));
    if (scene.bodies.size() > body_room_) {
      spdlog::warn(
          "scene {} has grown to {} bodies, and world.bodies has room for {}: observers see none "
          "of them move until world_server is restarted",
          scene.name, scene.bodies.size(), body_room_);
    }
    if (!writer_.Publish(message, static_cast<std::uint64_t>(MonotonicNow()))) {
      spdlog::warn(
          "scene {} has grown beyond the room in world.scene: observers see the old shapes "
          "until world_server is restarted",
          scene.name);
    }
  }

 private:
  protocol::SceneWriter writer_;
  SceneUse use_;
  std::uint32_t body_room_;
  std::uint64_t revision_ = 0;
};

// Says what became of reading the scene again.
void Tell(const ReloadReport& report, const WorldStep& step, SceneAnnouncer& announcer) {
  for (const std::string& warning : report.warnings) spdlog::warn("{}", warning);
  if (!report.replaced) {
    spdlog::error("the scene stays as it was: {}", report.refused);
    return;
  }
  spdlog::info("scene {} loaded anew: {} bodies", step.scene().name, step.scene().bodies.size());
  announcer.Publish(step);
}

// For `systemctl status`.
std::string InOneLine(const Settings& settings, const WorldStep& step, const WorldLoop& loop) {
  return fmt::format("{:g} Hz, scene {} with {} bodies; haptic side {}", settings.loop.rate_hz,
                     step.scene().name, step.scene().bodies.size(),
                     protocol::Key(loop.peer_state()));
}

// SIGHUP: the settings and the scene are read again. A wrong file is refused whole.
class Reload {
 public:
  Reload(std::string path, std::vector<std::string> set, const LoopSettings& loop,
         ConfigValues running, SceneReload& scene)
      : path_(std::move(path)),
        set_(std::move(set)),
        loop_(loop),
        live_(LiveKeys(), std::move(running)),
        scene_(scene) {}

  void Again(WorldStep& step, WorldLoop& loop) {
    ConfigValues read;
    Settings settings;
    try {
      settings = LoadSettings(path_, set_, nullptr, &read);
    } catch (const ConfigError& error) {
      spdlog::error("the settings stay as they were: {}", error.what());
      return;
    }
    settings.loop = loop_;
    step.Tune(settings);
    loop.Tune(settings);
    live_.Adopt(read);
    scene_.Restart(settings.scene.file);
  }

 private:
  std::string path_;
  std::vector<std::string> set_;
  LoopSettings loop_;  // as the loop runs
  LiveSettings live_;
  SceneReload& scene_;
};

void RunUntilStopped(const Settings& settings, WorldStep& step, WorldLoop& loop,
                     protocol::PeerLink& link, SceneAnnouncer& announcer, SceneReload& scene,
                     Reload& reload) {
  ServiceNotice notice;
  notice.Ready();
  std::uint64_t ticks = 0;
  PeriodicSchedule schedule(MonotonicNow(), settings.period_ns());
  std::int64_t missed = 0;
  while (true) {
    SleepUntil(schedule.deadline_ns());
    const std::int64_t now_ns = MonotonicNow();
    switch (WaitForSignal(0)) {
      case SIGINT:
      case SIGTERM:
        notice.Stopping();
        return;
      case SIGHUP:
        notice.Reloading();
        reload.Again(step, loop);
        notice.Ready();
        break;
      default:
        break;
    }
    if (const auto report = scene.Poll(step)) Tell(*report, step, announcer);
    loop.Tick(now_ns, schedule.deadline_ns(), missed);
    for (const std::string& line : link.PollNews()) spdlog::info("haptic side: {}", line);
    notice.Progress(++ticks, now_ns);
    notice.Status(InOneLine(settings, step, loop), now_ns);
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
  ConfigValues values;
  const Settings settings = LoadSettings(options.config, overrides, &description, &values);
  StartLogging("world_server");
  ReadyScene ready = LoadScene(settings);
  for (const std::string& warning : ready.loaded.warnings) spdlog::warn("{}", warning);
  const Scene& scene = ready.loaded.scene;
  if (options.check) {
    std::fputs(description.c_str(), stdout);
    const SceneNeeds needs = WorkOutNeeds(scene, UseOf(settings));
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
  SceneAnnouncer announcer(owner, UseOf(settings), body_room);
  announcer.Publish(step);
  SceneReload scene_reload(settings, std::move(ready.watch));
  Reload reload(options.config, overrides, settings.loop, values, scene_reload);
  RunUntilStopped(settings, step, loop, link, announcer, scene_reload, reload);
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
