// SPDX-License-Identifier: MIT
// The time of a player: how it waits for somebody to judge, when it steps, and what the host kept it
// from meanwhile.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "protocol/attach.h"

namespace rikiseki::protocol::check {

/// The segment of `role`, once it is there. Throws SegmentError after `patience_s`.
std::unique_ptr<PeerView> WaitForPeer(const std::string& instance, Role role, double patience_s);

class Pace {
 public:
  /// A step begins now, ns; ten times a second it looks whether the peer is still there, and throws
  /// SegmentError if not.
  std::int64_t Step(const PeerView& peer, Role role);
  /// Steps until `done`; false after `seconds`. What passes between two calls is no pause.
  bool Until(const std::function<void()>& step, const std::function<bool()>& done, double seconds);

  /// A pause that somebody else saw.
  void Note(std::int64_t pause_ns);
  std::int64_t longest_pause_ns() const { return longest_pause_ns_; }
  void Calm() { longest_pause_ns_ = 0; }

 private:
  std::int64_t last_step_ns_ = 0;
  std::int64_t last_look_ns_ = 0;
  std::int64_t longest_pause_ns_ = 0;
};

}  // namespace rikiseki::protocol::check
