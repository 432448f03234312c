// SPDX-License-Identifier: MIT
// Reads the scene again beside the running loop - when it is asked to, and when one of the files that
// the scene was read from has changed - and puts it in the running one's place between two ticks.
// Reading takes many ticks, and so does letting the engine find what carries what in a large scene: both
// happen in a thread of its own, which does nothing else.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "world_server/file_watch.h"
#include "world_server/scene/sdf_loader.h"
#include "world_server/settings.h"
#include "world_server/step.h"

namespace rikiseki::world {

/// A scene and the dynamics that will run it.
struct ReadyScene {
  LoadedScene loaded;
  std::unique_ptr<DynamicsWorld> dynamics;
  FileWatch watch;  // of the files that it was read from
};

/// What the settings name. Throws ConfigError, or std::invalid_argument where the engine refuses. `watch` is
/// what the caller watches already: a change of these, and of the scene's own file, while they are read is
/// told by the watch that comes back.
ReadyScene LoadScene(const Settings& settings, FileWatch watch = {});

/// What became of reading the scene again.
struct ReloadReport {
  bool replaced = false;  // another scene runs now
  std::string refused;    // why the running one stays; else empty
  std::vector<std::string> warnings;
};

class SceneReload {
 public:
  /// `watch`: of the running scene; its files are looked at if the settings say so.
  SceneReload(const Settings& settings, FileWatch watch);
  ~SceneReload();
  SceneReload(const SceneReload&) = delete;
  SceneReload& operator=(const SceneReload&) = delete;

  /// Reads this scene, and everything that moves starts anew. A second request while one is under way
  /// starts another after it.
  void Restart(const std::string& scene_file);

  /// Puts what was read since the last call in the place of the running scene; nothing if nothing
  /// was. Files that were changed and say the same as before change nothing and are no news.
  std::optional<ReloadReport> Poll(WorldStep& step);

 private:
  // What was read, or why it was refused.
  struct Result {
    std::optional<Successor> successor;
    std::vector<std::string> warnings;
    std::string refused;
  };

  void Work();
  Result Read(Replacement how);
  bool IsNews(Result& result, std::unique_lock<std::mutex>& lock);

  Settings settings_;  // of the thread alone
  FileWatch watch_;    // likewise

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;                   // under the mutex, as what follows
  std::optional<std::string> restart_;  // the scene that was asked for
  bool wants_moment_ = false;           // of the running scene
  std::optional<Moment> moment_;        // as wanted
  std::optional<Result> result_;        // not yet taken
  std::thread thread_;
};

}  // namespace rikiseki::world
