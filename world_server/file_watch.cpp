// SPDX-License-Identifier: MIT
#include "world_server/file_watch.h"

#include <sys/stat.h>

#include "common/clock.h"

namespace rikiseki::world {

FileWatch::Trace FileWatch::TraceOf(const std::string& file) {
  struct stat found {};
  if (stat(file.c_str(), &found) != 0) return {};
  const auto in_ns = [](const timespec& time) {
    return time.tv_sec * kNanosecondsPerSecond + time.tv_nsec;
  };
  return {static_cast<std::int64_t>(found.st_dev), static_cast<std::int64_t>(found.st_ino),
          found.st_size, in_ns(found.st_mtim), in_ns(found.st_ctim)};
}

FileWatch::Traces FileWatch::TracesNow() const {
  Traces now;
  for (const auto& [file, trace] : known_) now.emplace(file, TraceOf(file));
  return now;
}

void FileWatch::Watch(const std::vector<std::string>& files) {
  Traces watched;
  for (const std::string& file : files) {
    const auto known = known_.find(file);
    watched.emplace(file, known == known_.end() ? TraceOf(file) : known->second);
  }
  known_ = std::move(watched);
  seen_ = known_;
}

void FileWatch::Add(const std::string& file) {
  const auto [known, is_new] = known_.try_emplace(file);
  if (is_new) seen_[file] = known->second = TraceOf(file);
}

bool FileWatch::Look() {
  Traces now = TracesNow();
  const bool settled = now == seen_;
  seen_ = std::move(now);
  if (!settled || seen_ == known_) return false;
  known_ = seen_;
  return true;
}

void FileWatch::Accept() {
  known_ = seen_ = TracesNow();
}

}  // namespace rikiseki::world
