#include "world_server/scene_reload.h"

#include <chrono>
#include <utility>

#include "world_server/physics/deformable_world.h"

namespace rikiseki::world {
namespace {

// Between two looks at the files: a change is seen after one or two of them.
constexpr std::chrono::milliseconds kLook(250);

}  // namespace

ReadyScene LoadScene(const Settings& settings) {
  ReadyScene ready;
  ready.loaded = LoadSdf(settings.scene.file);
  ready.dynamics = MakeDynamics(ready.loaded.scene, settings.physics.substep_ms * 1e-3);
  return ready;
}

SceneReload::SceneReload(const Settings& settings, std::vector<std::string> files)
    : settings_(settings) {
  watch_.Watch(files);
  thread_ = std::thread([this] { Work(); });
}

SceneReload::~SceneReload() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void SceneReload::Restart(const std::string& scene_file) {
  {
    const std::lock_guard lock(mutex_);
    restart_ = scene_file;
  }
  wake_.notify_one();
}

void SceneReload::Work() {
  const auto asked = [this] { return stop_ || restart_; };
  std::unique_lock lock(mutex_);
  while (true) {
    if (settings_.scene.watch) {
      wake_.wait_for(lock, kLook, asked);
    } else {
      wake_.wait(lock, asked);
    }
    if (stop_) return;
    const std::optional<std::string> restart = std::exchange(restart_, std::nullopt);
    lock.unlock();
    std::optional<Result> result;
    if (restart) {
      settings_.scene.file = *restart;
      watch_.Accept();
      result = Read(Replacement::kRestart);
    } else if (watch_.Look()) {
      result = Read(Replacement::kChange);
    }
    lock.lock();
    if (!result) continue;
    // Of a restart that nobody took yet, the wish stays.
    if (result_ && result_->how == Replacement::kRestart) result->how = Replacement::kRestart;
    result_ = std::move(result);
  }
}

SceneReload::Result SceneReload::Read(Replacement how) {
  Result result{.how = how, .ready = {}, .refused = {}};
  try {
    result.ready = LoadScene(settings_);
    watch_.Watch(result.ready->loaded.files);
  } catch (const std::exception& error) {
    result.refused = error.what();
  }
  return result;
}

std::optional<ReloadReport> SceneReload::Poll(WorldStep& step) {
  std::optional<Result> result;
  {
    const std::lock_guard lock(mutex_);
    std::swap(result, result_);
  }
  if (!result) return std::nullopt;
  ReloadReport report;
  report.refused = std::move(result->refused);
  if (!result->ready) return report;
  ReadyScene& ready = *result->ready;
  if (result->how == Replacement::kChange && ready.loaded.scene == step.scene()) {
    return std::nullopt;
  }
  report.warnings = std::move(ready.loaded.warnings);
  step.Replace(std::move(ready.loaded.scene), std::move(ready.dynamics), result->how);
  report.replaced = true;
  return report;
}

}  // namespace rikiseki::world
