// SPDX-License-Identifier: MIT
// A usb_emulator of a test, and the commands that run daemons on its bus.
#pragma once

#include <string>
#include <vector>

#include "tests/process/child.h"

namespace rikiseki::test {

/// 250 Hz: slow enough for an emulated bus, of which each ioctl is a message between processes, on a
/// machine that others use as well.
inline constexpr int kUsbRateHz = 250;

class EmulatedBus {
 public:
  /// Nothing is plugged in yet. `device_file` of config/devices; `more` arguments of usb_emulator.
  /// Throws std::runtime_error.
  explicit EmulatedBus(const std::string& device_file, const std::vector<std::string>& more = {});
  ~EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;

  /// Sends a command and waits until it is done.
  std::string Tell(const std::string& command);

  struct Status {
    long readings = 0;
    long commands = 0;
    long nonsense = 0;
    int motors_at_zero = 0;
    int longest_pull_ticks = 0;  // without a command
  };
  Status status();

  /// A command line whose program runs on this bus.
  std::vector<std::string> OnBus(const std::vector<std::string>& command);

  /// haptic_server on this bus, with the board of the device file.
  std::vector<std::string> HapticCommand(const std::string& instance,
                                         const std::vector<std::string>& more = {});

 private:
  std::string device_file_;
  std::string socket_path_;
  Child process_;
  int connection_ = -1;
};

/// The settings of both: of the emulator, and of haptic_server with whatever device.
std::vector<std::string> UsbSettingsOf(const std::string& device_file);

}  // namespace rikiseki::test
