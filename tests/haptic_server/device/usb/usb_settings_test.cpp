// SPDX-License-Identifier: MIT
// Section [usb] of the shipped device files and what of it is refused.
#include "haptic_server/device/usb/usb_settings.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "haptic_server/settings.h"

namespace rikiseki::haptic {
namespace {

const std::string kFolder = RIKISEKI_SOURCE_DIR "/config/devices/";

std::vector<std::string> UsbFile(const std::string& file, const std::string& change = "") {
  std::vector<std::string> set = {"device.kind=usb", "device.file=" + kFolder + file};
  if (!change.empty()) set.push_back(change);
  return set;
}

std::string Refusal(const std::vector<std::string>& set) {
  try {
    LoadSettings(RIKISEKI_SOURCE_DIR "/config/haptic_server.ini", set);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST_CASE("every shipped device file with a board can be run, and gives every key of [usb]") {
  int boards = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const std::string file = entry.path().filename();
    if (file == "simulated.ini" || file == "spidar_mouse.ini") continue;
    CAPTURE(file);
    std::string description;
    const Settings settings =
        LoadSettings(RIKISEKI_SOURCE_DIR "/config/haptic_server.ini", UsbFile(file), &description);
    CHECK(settings.usb.board ==
          (file.find("sh4") != std::string::npos ? UsbBoardModel::kSh4 : UsbBoardModel::kSimple));
    std::istringstream lines(description);
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("usb.")) CHECK(line.find("from default") == std::string::npos);
    }
    ++boards;
  }
  CHECK(boards == 12);
}

TEST_CASE("a device file without a board is refused with the cure") {
  const std::string text = Refusal({"device.kind=usb"});
  CHECK(text.find("usb.board = none") != std::string::npos);
  CHECK(text.find("devices/spidar4_simple.ini") != std::string::npos);
}

TEST_CASE("what cannot drive the strings is refused, with place, key, value and what is right") {
  const auto refused = [](const std::string& change, const std::string& why,
                          const std::string& file = "spidar4_simple.ini") {
    const std::string text = Refusal(UsbFile(file, change));
    CAPTURE(change, text);
    CHECK(text.find(why) != std::string::npos);
    CHECK((text.starts_with("--set " + change) || text.starts_with(kFolder + file + ":")));
  };
  refused("usb.channels=0 1 2", "4 numbers, one for each string");
  refused("usb.channels=0 1 2 2", "two strings cannot be on one channel");
  refused("usb.channels=0 1 2 3.5", "from 0 to 7");
  refused("usb.channels=0 1 2 8", "each from 0 to 7");
  refused("usb.count_directions=1 1 1 0", "1 or -1");
  refused("usb.count_directions=1 1 1", "4 numbers");
  refused("usb.digit_per_volt=415 415", "one number, or 4 numbers");
  refused("usb.volt_per_newton=1 1 1", "one number, or 4 numbers");
  refused("usb.volt_per_newton=0", "from 0.001 to 100");
  refused("usb.digit_per_volt=415 415 415 700", "asks string 4 for more than the 4095 digits");
  refused("spidar.tension_max_n=28", "more than the 4095 digits");
  refused("usb.enable_bit=4", "rotary switch");
  refused("usb.enable_bit=8", "0 to 3");
  refused("usb.reply_within_us=1000", "shorter than a period");
  refused("usb.switch_id=16", "from -1 to 15");
  refused("usb.board=h8", "none | simple | sh4");
  refused("usb.phase_mask=256", "from 0 to 255");
  refused("usb.channels=0 1 2 3", "8 numbers, one for each string", "spidar_g6x3r_sh4.ini");
  refused("usb.channels=0 1 2 3 4 5 6 6", "two strings cannot be on one channel",
          "spidar_g6x2_simple.ini");
  refused("usb.digit_per_volt=415 415 415 415", "one number, or 8 numbers",
          "spidar_g6x3l_simple.ini");
  CHECK(Refusal(UsbFile("spidar4_sh4.ini", "usb.enable_bit=8")) == "accepted");
  CHECK(Refusal(UsbFile("spidar4_simple.ini", "usb.digit_per_volt=418 414.3 414.5 415.8")) ==
        "accepted");
}

TEST_CASE("a device file with a board serves the simulated device as well") {
  CHECK(Refusal({"device.file=" + kFolder + "spidar_big4_sh4.ini"}) == "accepted");
  CHECK(Refusal({"device.file=" + kFolder + "spidar_g6x3r_sh4.ini"}) == "accepted");
}

}  // namespace
}  // namespace rikiseki::haptic
