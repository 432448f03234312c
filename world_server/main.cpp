// world_server: runs a dynamic rigid-body world at 10-60 Hz for a haptic server beside it.
#include <spdlog/spdlog.h>

#include <csignal>
#include <cstdio>

#include "common/clock.h"
#include "common/daemon.h"
#include "common/logging.h"
#include "common/version.h"
#include "world_server/loop.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/scene/sdf_loader.h"

namespace {

using namespace rikiseki;         // NOLINT(google-build-using-namespace)
using namespace rikiseki::world;  // NOLINT(google-build-using-namespace)

// Room in world.bodies for scenes that grow when they are reloaded.
constexpr std::uint32_t kBodyRoom = 256;

std::unique_ptr<DynamicsWorld> MakeDynamics(const Scene& scene, const Settings& settings) {
  return std::make_unique<BulletWorld>(scene, settings.physics.substep_ms * 1e-3);
}

LoadedScene Load(const Settings& settings) {
  LoadedScene loaded = LoadSdf(settings.scene.file);
  for (const std::string& warning : loaded.warnings) spdlog::warn("{}", warning);
  return loaded;
}

// The file is read anew; if it is refused, the running scene stays.
void Reload(const Settings& settings, WorldStep& step) {
  try {
    const LoadedScene loaded = Load(settings);
    step.Replace(loaded.scene, MakeDynamics(loaded.scene, settings));
    spdlog::info("scene {} loaded anew: {} bodies", loaded.scene.name, loaded.scene.bodies.size());
  } catch (const std::exception& error) {
    spdlog::error("the scene stays as it was: {}", error.what());
  }
}

void RunUntilStopped(const Settings& settings, WorldStep& step, WorldLoop& loop,
                     protocol::PeerLink& link) {
  PeriodicSchedule schedule(MonotonicNow(), settings.period_ns());
  std::int64_t missed = 0;
  while (true) {
    SleepUntil(schedule.deadline_ns());
    switch (WaitForSignal(0)) {
      case SIGINT:
      case SIGTERM: return;
      case SIGHUP: Reload(settings, step); break;
      default: break;
    }
    loop.Tick(MonotonicNow(), schedule.deadline_ns(), missed);
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
  LoadedScene loaded = Load(settings);
  if (options.check) {
    std::fputs(description.c_str(), stdout);
    std::printf("scene %s: %zu bodies\n", loaded.scene.name.c_str(), loaded.scene.bodies.size());
    return kExitOk;
  }
  BlockSignals();
  const auto period_ns = static_cast<std::uint64_t>(settings.period_ns());
  const auto body_room =
      std::max(kBodyRoom, static_cast<std::uint32_t>(loaded.scene.bodies.size()));
  protocol::SegmentOwner owner({.instance = options.instance,
                                .role = protocol::Role::kWorld,
                                .streams = protocol::WorldStreams(period_ns, body_room, period_ns),
                                .build = kBuild,
                                .runtime_directory = ""});
  for (const std::string& note : owner.notes()) spdlog::info("{}", note);
  protocol::PeerLink link(
      {.peer = {.instance = options.instance,
                .role = protocol::Role::kHaptic,
                .required = {{.type = protocol::StreamType::kHapticTick}},
                .owners = {}}});
  WorldStep step(settings, loaded.scene, MakeDynamics(loaded.scene, settings), owner.epoch());
  WorldLoop loop(settings, step, owner, link);
  spdlog::info("{} at {} Hz, scene {} with {} bodies, build {}", owner.name(), settings.loop.rate_hz,
               loaded.scene.name, loaded.scene.bodies.size(), kBuild);
  RunUntilStopped(settings, step, loop, link);
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
