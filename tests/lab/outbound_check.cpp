// SPDX-License-Identifier: MIT
#include "tests/lab/outbound_check.h"

#include <algorithm>

namespace rikiseki::lab {
namespace {

constexpr std::uint32_t kMostBodies = 16;

}  // namespace

OutboundCheck::OutboundCheck()
    : words_(std::max({protocol::kHapticTickBytes, protocol::kHapticHealthBytes,
                       protocol::kWorldFrameBytes, protocol::kWorldHealthBytes,
                       protocol::WorldBodiesBytes(kMostBodies)}) /
             sizeof(std::uint64_t)) {}

void OutboundCheck::Look(const protocol::HapticTick& tick, const protocol::HapticHealth& health) {
  Check("haptic.tick", tick.tick, tick);
  Check("haptic.health", tick.tick, health);
}

void OutboundCheck::Look(const protocol::WorldFrame& frame, const protocol::WorldHealth& health,
                         const std::vector<protocol::Body>& bodies) {
  Check("world.frame", frame.frame, frame);
  Check("world.health", frame.frame, health);
  const protocol::Encoded encoded = protocol::Encode(std::span(bodies), words_);
  std::vector<protocol::Body> read(kMostBodies);
  std::uint32_t count = 0;
  Complain("world.bodies", frame.frame, protocol::Decode(words_, encoded, std::span(read), count));
}

template <typename Message>
void OutboundCheck::Check(const char* name, std::uint64_t number, const Message& message) {
  const protocol::Encoded encoded = protocol::Encode(message, words_);
  Message read;
  Complain(name, number, protocol::Decode(words_, encoded, read));
}

void OutboundCheck::Complain(const char* name, std::uint64_t number,
                             protocol::DecodeStatus status) {
  if (status == protocol::DecodeStatus::kOk || !complaint_.empty()) return;
  complaint_ = std::string(name) + " " + std::to_string(number) + ": " + protocol::Describe(status);
}

}  // namespace rikiseki::lab
