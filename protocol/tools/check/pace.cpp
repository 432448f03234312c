// SPDX-License-Identifier: MIT
#include "protocol/tools/check/pace.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "protocol/owner.h"

namespace rikiseki::protocol::check {
namespace {

constexpr std::int64_t kLookNs = 100'000'000;

const char* Side(Role role) {
  return role == Role::kHaptic ? "haptic side" : "world";
}

std::int64_t LimitNs(double seconds) {
  return MonotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
}

}  // namespace

std::unique_ptr<PeerView> WaitForPeer(const std::string& instance, Role role, double patience_s) {
  const AttachRequest request{.instance = instance, .role = role, .required = {}, .owners = {}};
  const std::int64_t limit = LimitNs(patience_s);
  for (;;) {
    AttachResult result = Attach(request);
    if (result.status == AttachStatus::kAttached) return std::move(result.view);
    if (MonotonicNow() > limit) {
      throw SegmentError(1, std::string("no ") + Side(role) + " to judge: " + result.text);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

std::int64_t Pace::Step(const PeerView& peer, Role role) {
  const std::int64_t now = MonotonicNow();
  if (last_step_ns_ != 0) Note(now - last_step_ns_);
  last_step_ns_ = now;
  if (now - last_look_ns_ > kLookNs) {
    last_look_ns_ = now;
    if (!peer.OwnerAlive() || peer.State() == SegmentState::kClosed) {
      throw SegmentError(1, std::string("the ") + Side(role) + " ended while it was judged");
    }
  }
  return now;
}

bool Pace::Until(const std::function<void()>& step, const std::function<bool()>& done,
                 double seconds) {
  const std::int64_t limit = LimitNs(seconds);
  last_step_ns_ = 0;
  while (!done()) {
    if (MonotonicNow() > limit) return false;
    step();
  }
  return true;
}

void Pace::Note(std::int64_t pause_ns) {
  longest_pause_ns_ = std::max(longest_pause_ns_, pause_ns);
}

}  // namespace rikiseki::protocol::check
