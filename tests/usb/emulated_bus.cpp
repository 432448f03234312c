// SPDX-License-Identifier: MIT
#include "tests/usb/emulated_bus.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace rikiseki::test {
namespace {

std::string NewSocketPath() {
  static std::atomic<int> next{0};
  const std::string name =
      "rikiseki-usb-" + std::to_string(getpid()) + "-" + std::to_string(next++);
  return std::filesystem::temp_directory_path() / name;
}

std::vector<std::string> EmulatorCommand(const std::string& device_file,
                                         const std::string& socket_path,
                                         const std::vector<std::string>& more) {
  std::vector<std::string> command = {"/usr/bin/umockdev-wrapper",
                                      Program("usb_emulator"),
                                      "--config",
                                      SourceFile("config/haptic_server.ini"),
                                      "--control",
                                      socket_path,
                                      "--tick-us",
                                      std::to_string(1'000'000 / kUsbRateHz)};
  for (const std::string& setting : UsbSettingsOf(device_file)) {
    command.insert(command.end(), {"--set", setting});
  }
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

}  // namespace

std::vector<std::string> UsbSettingsOf(const std::string& device_file) {
  return {"device.file=" + SourceFile("config/devices/" + device_file),
          "loop.rate_hz=" + std::to_string(kUsbRateHz), "usb.reply_within_us=3500",
          "safety.slew_limit_n_per_s=5000"};
}

EmulatedBus::EmulatedBus(const std::string& device_file, const std::vector<std::string>& more)
    : device_file_(device_file),
      socket_path_(NewSocketPath()),
      process_(EmulatorCommand(device_file, socket_path_, more)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket_path_.c_str(), sizeof address.sun_path - 1);
  for (int attempt = 0; attempt < 500 && process_.IsRunning(); ++attempt) {
    connection_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(connection_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) return;
    close(connection_);
    connection_ = -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  throw std::runtime_error("usb_emulator does not start: " + process_.Stderr());
}

EmulatedBus::~EmulatedBus() {
  const std::string quit = "quit\n";
  if (send(connection_, quit.data(), quit.size(), MSG_NOSIGNAL) > 0) process_.Wait(5);
  close(connection_);
  std::filesystem::remove(socket_path_);
}

std::string EmulatedBus::Tell(const std::string& command) {
  const std::string line = command + "\n";
  std::string answer;
  char c = 0;
  if (send(connection_, line.data(), line.size(), MSG_NOSIGNAL) > 0) {
    while (read(connection_, &c, 1) == 1 && c != '\n') answer += c;
  }
  if (c != '\n' || answer == "what?") {
    throw std::runtime_error("usb_emulator, " + command + ": " + process_.Stderr());
  }
  return answer;
}

EmulatedBus::Status EmulatedBus::status() {
  std::istringstream words(Tell("status"));
  Status status;
  words >> status.readings >> status.commands >> status.nonsense >> status.motors_at_zero >>
      status.longest_pull_ticks;
  return status;
}

std::vector<std::string> EmulatedBus::OnBus(const std::vector<std::string>& command) {
  std::vector<std::string> wrapped = {"/usr/bin/env", "UMOCKDEV_DIR=" + Tell("root"),
                                      "/usr/bin/umockdev-wrapper"};
  wrapped.insert(wrapped.end(), command.begin(), command.end());
  return wrapped;
}

std::vector<std::string> EmulatedBus::HapticCommand(const std::string& instance,
                                                    const std::vector<std::string>& more) {
  std::vector<std::string> command = {Program("haptic_server"),
                                      "--config",
                                      SourceFile("config/haptic_server.ini"),
                                      "--device",
                                      "usb",
                                      "--instance",
                                      instance};
  for (const std::string& setting : UsbSettingsOf(device_file_)) {
    command.insert(command.end(), {"--set", setting});
  }
  command.insert(command.end(), more.begin(), more.end());
  return OnBus(command);
}

}  // namespace rikiseki::test
