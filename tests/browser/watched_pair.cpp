// SPDX-License-Identifier: MIT
#include "tests/browser/watched_pair.h"

#include <cmath>
#include <stdexcept>
#include <thread>

#include "tests/browser/raw_client.h"

namespace rikiseki::test {
namespace {

using Clock = std::chrono::steady_clock;

}  // namespace

WatchedPair::WatchedPair(std::vector<std::string> world_set, const std::string& scene)
    : world_set_(std::move(world_set)), scene_(scene), port_(FreePort()) {}

void WatchedPair::StartAll() {
  StartWorld();
  StartHaptic();
  StartViewer();
}

void WatchedPair::StartHaptic() {
  haptic.emplace(std::vector<std::string>{Program("haptic_server"), "--config",
                                          SourceFile("config/haptic_server.ini"), "--instance",
                                          instance_});
}

void WatchedPair::StartWorld() {
  std::vector<std::string> command{Program("world_server"), "--config",
                                   SourceFile("config/world_server.ini"), "--instance", instance_};
  if (!scene_.empty()) command.insert(command.end(), {"--scene", SourceFile(scene_)});
  for (const std::string& setting : world_set_) command.insert(command.end(), {"--set", setting});
  world.emplace(command);
}

void WatchedPair::StartViewer() {
  viewer.emplace(std::vector<std::string>{Program("world_viewer"), "--instance", instance_,
                                          "--port", std::to_string(port_)});
  if (!WaitForPort(port_)) throw std::runtime_error("no viewer: " + viewer->Stderr());
}

nlohmann::json Picture(Chromium& page) {
  return page.Evaluate("window.rikiseki ? rikiseki.picture() : null");
}

nlohmann::json AwaitPicture(Chromium& page, const std::function<bool(const nlohmann::json&)>& holds,
                            double seconds) {
  const auto limit = Clock::now() + std::chrono::duration<double>(seconds);
  nlohmann::json picture;
  do {
    picture = Picture(page);
    if (!picture.is_null() && holds(picture)) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  } while (Clock::now() < limit);
  return picture;
}

double Length(const nlohmann::json& vector) {
  return std::hypot(vector.at(0).get<double>(), vector.at(1).get<double>(),
                    vector.at(2).get<double>());
}

}  // namespace rikiseki::test
