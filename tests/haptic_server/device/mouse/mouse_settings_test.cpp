// SPDX-License-Identifier: MIT
// Section [mouse] of the shipped device file and what of it is refused.
#include "haptic_server/device/mouse/mouse_settings.h"

#include <catch2/catch.hpp>
#include <sstream>

#include "haptic_server/settings.h"

namespace rikiseki::haptic {
namespace {

const std::string kDaemon = RIKISEKI_SOURCE_DIR "/config/haptic_server.ini";
const std::string kFile = RIKISEKI_SOURCE_DIR "/config/devices/spidar_mouse.ini";

std::string Refusal(const std::vector<std::string>& changes, const std::string& file = kFile) {
  std::vector<std::string> set = {"device.kind=mouse", "device.file=" + file};
  set.insert(set.end(), changes.begin(), changes.end());
  try {
    LoadSettings(kDaemon, set);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST_CASE("the shipped file of the SPIDAR-mouse can be run, and gives every key that counts") {
  std::string description;
  const Settings settings =
      LoadSettings(kDaemon, {"device.kind=mouse", "device.file=" + kFile}, &description);
  CHECK(settings.mouse.event.starts_with("/dev/input/by-id/"));
  CHECK(BoardOf(settings.mouse).board == UsbBoardModel::kMouse);
  std::istringstream lines(description);
  int keys = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("mouse.") && !line.starts_with("spidar.")) continue;
    CAPTURE(line);
    CHECK(line.find("from default") == std::string::npos);
    ++keys;
  }
  CHECK(keys == 14);
}

TEST_CASE("what cannot drive a SPIDAR-mouse is refused, with place, key, value and what is right") {
  const auto refused = [](const std::string& change, const std::string& why) {
    const std::string text = Refusal({change});
    CAPTURE(change, text);
    CHECK(text.find(why) != std::string::npos);
    CHECK(text.starts_with("--set " + change));
  };
  CHECK(Refusal({}) == "accepted");
  refused("mouse.reach_m=0.1", "2 numbers");
  refused("mouse.reach_m=0.1 0", "from 0.001 to 1");
  refused("mouse.force_directions=1 0.5", "1 or -1");
  refused("mouse.max_force_n=0.2", "must exceed mouse.min_force_n");
  refused("mouse.count_length_m=0", "from 1e-07");
  refused("loop.rate_hz=240", "250 or more");
  refused("spidar.motors_m=1 1 1", "spidar.motors_m");  // it has none that are counted
  refused("usb.board=simple", "usb.board");
  // In a tick of 1 ms the force can grow by 0.6 N, and less than 0.6 N is not shown.
  const std::string slow = "safety.slew_limit_n_per_s=600";
  CHECK(Refusal({slow}) == "accepted");
  const std::string text = Refusal({slow, "mouse.min_force_n=0.6"});
  CAPTURE(text);
  CHECK(text.starts_with("--set " + slow));
  CHECK(text.find("able to reach mouse.min_force_n") != std::string::npos);
}

TEST_CASE("a device file without an ordinary mouse is refused with the cure") {
  // One of a device with strings has other keys, and says so.
  const std::string text = Refusal({}, RIKISEKI_SOURCE_DIR "/config/devices/spidar4_simple.ini");
  CHECK(text.find("spidar.motors_m") != std::string::npos);
  CHECK(FindMouseConflict({})->key == "mouse.event");
  CHECK(FindMouseConflict({})->why.find("/dev/input/by-id/") != std::string::npos);
}

}  // namespace
}  // namespace rikiseki::haptic
