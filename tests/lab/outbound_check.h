// SPDX-License-Identifier: MIT
// What leaves the two processes, checked as a stranger would: every message must survive the trip
// through the wire format, whose decoder refuses what is not finite or cannot be.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/codec.h"
#include "protocol/messages.h"

namespace rikiseki::lab {

class OutboundCheck {
 public:
  OutboundCheck();

  /// What a tick of either side publishes.
  void Look(const protocol::HapticTick& tick, const protocol::HapticHealth& health);
  void Look(const protocol::WorldFrame& frame, const protocol::WorldHealth& health,
            const std::vector<protocol::Body>& bodies);

  bool sound() const { return complaint_.empty(); }
  /// The first message that was not, in words; empty = none.
  const std::string& complaint() const { return complaint_; }

 private:
  template <typename Message>
  void Check(const char* name, std::uint64_t number, const Message& message);
  void Complain(const char* name, std::uint64_t number, protocol::DecodeStatus status);

  std::vector<std::uint64_t> words_;
  std::string complaint_;
};

}  // namespace rikiseki::lab
