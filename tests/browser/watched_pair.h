// SPDX-License-Identifier: MIT
// A pair with its viewer, as the tests of the view start them.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/browser/chromium.h"
#include "tests/process/child.h"

namespace rikiseki::test {

/// The daemons and the viewer under one instance; those that run are ended with it.
class WatchedPair {
 public:
  /// `world_set`: settings of world_server, "section.key=value".
  explicit WatchedPair(std::vector<std::string> world_set = {}, const std::string& scene = "");

  const std::string& instance() const { return instance_; }
  int port() const { return port_; }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/"; }

  /// World, haptic side and viewer.
  void StartAll();
  void StartHaptic();
  void StartWorld();
  /// Returns when it listens.
  void StartViewer();

 private:
  Instance instance_;
  std::vector<std::string> world_set_;
  std::string scene_;
  int port_;

 public:
  std::optional<Child> haptic;
  std::optional<Child> world;
  std::optional<Child> viewer;
};

/// What the page shows, in numbers: window.rikiseki.picture() of main.js.
nlohmann::json Picture(Chromium& page);

/// Polls the page until `holds` of its picture, at most so long; the last picture. Whether it came to
/// hold is the caller's to check.
nlohmann::json AwaitPicture(Chromium& page, const std::function<bool(const nlohmann::json&)>& holds,
                            double seconds = 60);

/// Length of a vector of the page.
double Length(const nlohmann::json& vector);

}  // namespace rikiseki::test
