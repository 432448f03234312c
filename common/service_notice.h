// SPDX-License-Identifier: MIT
// What a daemon tells the service manager that started it: ready, reloading, alive, in words. Through
// libsystemd's sd_notify; where nobody listens ($NOTIFY_SOCKET is not set) nothing happens.
#pragma once

#include <cstdint>
#include <string>

namespace rikiseki {

class ServiceNotice {
 public:
  /// Reads $WATCHDOG_USEC. Not for the real-time thread, as nothing here is.
  ServiceNotice();

  void Ready();
  void Reloading();  // until the next Ready
  void Stopping();

  /// What `systemctl status` shows. Sent when it differs from what was sent last, once a second at most.
  void Status(const std::string& sentence, std::int64_t now_ns);

  /// Feeds the watchdog if `progress` of the loop - ticks performed - differs from what it was when last
  /// fed. Call it as often as you like, from a thread that runs though the loop may not.
  void Progress(std::uint64_t progress, std::int64_t now_ns);

 private:
  std::string status_;
  std::int64_t status_ns_ = 0;
  std::int64_t feed_every_ns_ = 0;  // 0: nobody asked for a watchdog
  std::uint64_t progress_ = 0;
  std::int64_t fed_ns_ = 0;
};

}  // namespace rikiseki
