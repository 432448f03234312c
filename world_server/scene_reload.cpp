// SPDX-License-Identifier: MIT
#include "world_server/scene_reload.h"

#include <chrono>
#include <utility>

#include "world_server/physics/deformable_world.h"

namespace rikiseki::world {
namespace {

// Between two looks at the files: a change is seen after one or two of them.
constexpr std::chrono::milliseconds kLook(250);

}  // namespace

ReadyScene LoadScene(const Settings& settings, FileWatch watch) {
  ReadyScene ready;
  ready.watch = std::move(watch);
  ready.watch.Add(settings.scene.file);
  ready.loaded = LoadSdf(settings.scene.file);
  ready.watch.Watch(ready.loaded.files);
  ready.dynamics = MakeDynamics(ready.loaded.scene, settings.physics.substep_ms * 1e-3);
  return ready;
}

SceneReload::SceneReload(const Settings& settings, FileWatch watch)
    : settings_(settings), watch_(std::move(watch)) {
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
    if (result && IsNews(*result, lock)) result_ = std::move(result);
  }
}

// Prepares what was read for the running scene's place, as soon as the loop tells how that stands.
bool SceneReload::IsNews(Result& result, std::unique_lock<std::mutex>& lock) {
  if (!result.successor) return true;
  wants_moment_ = true;
  wake_.wait(lock, [this] { return stop_ || moment_; });
  if (stop_) return false;
  const Moment moment = *std::exchange(moment_, std::nullopt);
  lock.unlock();
  Successor& successor = *result.successor;
  const bool is_news = successor.how == Replacement::kRestart || !(successor.scene == moment.scene);
  if (is_news) Prepare(moment, settings_.physics.substep_ms * 1e-3, successor);
  lock.lock();
  return is_news;
}

SceneReload::Result SceneReload::Read(Replacement how) {
  Result result;
  try {
    ReadyScene ready = LoadScene(settings_, watch_);
    watch_ = std::move(ready.watch);
    result.successor = Successor{
        .scene = std::move(ready.loaded.scene), .dynamics = std::move(ready.dynamics), .how = how};
    result.warnings = std::move(ready.loaded.warnings);
  } catch (const std::exception& error) {
    result.refused = error.what();
  }
  return result;
}

std::optional<ReloadReport> SceneReload::Poll(WorldStep& step) {
  std::optional<Result> result;
  bool wants_moment = false;
  {
    const std::lock_guard lock(mutex_);
    std::swap(result, result_);
    wants_moment = std::exchange(wants_moment_, false);
  }
  std::optional<ReloadReport> report;
  if (result) {
    report = ReloadReport{.refused = std::move(result->refused),
                          .warnings = std::move(result->warnings)};
    report->replaced = result->successor.has_value();
    if (result->successor) step.Replace(std::move(*result->successor));
  }
  // After the replacement, of which what is being read must know.
  if (wants_moment) {
    Moment moment = step.Now();
    {
      const std::lock_guard lock(mutex_);
      moment_ = std::move(moment);
    }
    wake_.notify_one();
  }
  return report;
}

}  // namespace rikiseki::world
