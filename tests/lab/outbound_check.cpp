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

void OutboundCheck::Look(const CoupledRun& run, bool world_ticked) {
  tick_ = run.haptic_tick().tick;
  Check("haptic.tick", run.haptic_tick());
  Check("haptic.health", run.haptic_health());
  if (!world_ticked) return;
  Check("world.frame", run.world_frame());
  Check("world.health", run.world().health());
  CheckBodies(run.world().Bodies());
}

template <typename Message>
void OutboundCheck::Check(const char* name, const Message& message) {
  const protocol::Encoded encoded = protocol::Encode(message, words_);
  Message read;
  Complain(name, protocol::Decode(words_, encoded, read));
}

void OutboundCheck::CheckBodies(const std::vector<protocol::Body>& bodies) {
  const protocol::Encoded encoded = protocol::Encode(std::span(bodies), words_);
  std::vector<protocol::Body> read(kMostBodies);
  std::uint32_t count = 0;
  Complain("world.bodies", protocol::Decode(words_, encoded, std::span(read), count));
}

void OutboundCheck::Complain(const char* name, protocol::DecodeStatus status) {
  if (status == protocol::DecodeStatus::kOk || !complaint_.empty()) return;
  complaint_ =
      std::string(name) + " of tick " + std::to_string(tick_) + ": " + protocol::Describe(status);
}

}  // namespace rikiseki::lab
