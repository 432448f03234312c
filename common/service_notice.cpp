// SPDX-License-Identifier: MIT
#include "common/service_notice.h"

#include <systemd/sd-daemon.h>

#include "common/clock.h"

namespace rikiseki {
namespace {

void Send(const std::string& message) {
  // A manager that does not listen is not this program's trouble.
  (void)sd_notify(0, message.c_str());
}

}  // namespace

ServiceNotice::ServiceNotice() {
  std::uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) > 0) {
    feed_every_ns_ = static_cast<std::int64_t>(period_us) * 1000 / 4;
  }
}

void ServiceNotice::Ready() {
  Send("READY=1");
}

void ServiceNotice::Reloading() {
  Send("RELOADING=1");
}

void ServiceNotice::Stopping() {
  Send("STOPPING=1");
}

void ServiceNotice::Status(const std::string& sentence, std::int64_t now_ns) {
  if (sentence == status_) return;
  if (!status_.empty() && now_ns - status_ns_ < kNanosecondsPerSecond) return;
  status_ = sentence;
  status_ns_ = now_ns;
  Send("STATUS=" + sentence);
}

void ServiceNotice::Progress(std::uint64_t progress, std::int64_t now_ns) {
  if (feed_every_ns_ == 0 || progress == progress_ || now_ns - fed_ns_ < feed_every_ns_) return;
  progress_ = progress;
  fed_ns_ = now_ns;
  Send("WATCHDOG=1");
}

}  // namespace rikiseki
