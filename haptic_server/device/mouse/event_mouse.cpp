// SPDX-License-Identifier: MIT
#include "haptic_server/device/mouse/event_mouse.h"

#include <fcntl.h>
#include <linux/input.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kPollNs = 20'000'000;
constexpr int kPollsPerLook = 12;  // a quarter of a second
constexpr std::size_t kStackBytes = 256 * 1024;
constexpr std::size_t kEventsAtOnce = 64;
constexpr int kMostReads = 8;  // of one tick

constexpr char kNoMouse[] = "SPIDAR-mouse: no ordinary mouse";
constexpr char kForbidden[] = "SPIDAR-mouse: mouse forbidden";
constexpr char kNotAMouse[] = "SPIDAR-mouse: not a mouse";

// A pipe does not tell what it carries, an event device does.
bool IsMouse(int descriptor) {
  struct stat node {};
  if (fstat(descriptor, &node) != 0 || S_ISFIFO(node.st_mode)) return S_ISFIFO(node.st_mode);
  std::array<std::uint8_t, REL_CNT / 8 + 1> axes{};
  if (ioctl(descriptor, EVIOCGBIT(EV_REL, axes.size()), axes.data()) < 0) return false;
  const auto has = [&](int axis) { return (axes[axis / 8] >> (axis % 8) & 1) != 0; };
  return has(REL_X) && has(REL_Y);
}

}  // namespace

EventMouse::EventMouse(std::string path) : path_(std::move(path)) {
  Look();
  thread_.emplace(RealtimeRequest{.stack_bytes = kStackBytes}, [this] { Supervise(); });
}

EventMouse::~EventMouse() {
  stop_ = true;
  thread_->Join();
  for (const int descriptor : {held_, offered_.load(), returned_.load()}) {
    if (descriptor != kNone) close(descriptor);
  }
}

void EventMouse::Supervise() {
  for (int poll = 1; !stop_; ++poll) {
    SleepUntil(MonotonicNow() + kPollNs);
    if (const int back = returned_.exchange(kNone, std::memory_order_acquire); back != kNone) {
      close(back);
      is_away_ = false;
    }
    if (!is_away_ && poll % kPollsPerLook == 0) Look();
  }
}

// SYNC: offered_
void EventMouse::Look() {
  const int descriptor = open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) {
    const bool is_forbidden = errno == EACCES || errno == EPERM;
    Say(is_forbidden ? kForbidden : kNoMouse,
        "mouse.event = " + path_ + " cannot be opened: " + std::strerror(errno) +
            (is_forbidden
                 ? "; whoever runs haptic_server must be a member of the node's group "
                   "(input), or a udev rule must give it to the group haptics"
                 : "; plug the mouse in, or choose one of /dev/input/by-id/*-event-mouse"));
    return;
  }
  if (!IsMouse(descriptor)) {
    close(descriptor);
    Say(kNotAMouse, "mouse.event = " + path_ +
                        " is no event device with relative axes x and y: choose one of "
                        "/dev/input/by-id/*-event-mouse");
    return;
  }
  is_away_ = true;
  Say("", "");
  offered_.store(descriptor, std::memory_order_release);
}

void EventMouse::Say(const char* trouble, const std::string& complaint) {
  const std::lock_guard lock(mutex_);
  trouble_.store(trouble, std::memory_order_relaxed);
  complaint_ = complaint;
}

std::string EventMouse::Complaint() const {
  const std::lock_guard lock(mutex_);
  return complaint_;
}

// SYNC: offered_, returned_
std::optional<MouseWay> EventMouse::Read() noexcept {
  if (held_ == kNone) held_ = offered_.exchange(kNone, std::memory_order_acquire);
  if (held_ == kNone) return std::nullopt;
  std::array<input_event, kEventsAtOnce> events;
  for (int i = 0; i < kMostReads; ++i) {
    const ssize_t bytes = read(held_, events.data(), sizeof events);
    if (bytes <= 0) {
      if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) return way_;
      trouble_.store(kNoMouse, std::memory_order_relaxed);
      returned_.store(std::exchange(held_, kNone), std::memory_order_release);
      return std::nullopt;
    }
    const std::size_t count = static_cast<std::size_t>(bytes) / sizeof(input_event);
    for (std::size_t k = 0; k < count; ++k) {
      const input_event& event = events[k];
      if (event.type != EV_REL) continue;
      if (event.code == REL_X) way_.x += event.value;
      if (event.code == REL_Y) way_.y -= event.value;  // the kernel's y comes towards the hand
    }
  }
  return way_;
}

}  // namespace rikiseki::haptic
