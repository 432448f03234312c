// What leaves the two processes, checked as a stranger would: every message must survive the trip
// through the wire format, whose decoder refuses what is not finite or cannot be.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/codec.h"
#include "tests/lab/coupled_run.h"

namespace rikiseki::lab {

class OutboundCheck {
 public:
  OutboundCheck();

  /// Looks at all messages of the last haptic tick, and of the world tick before it, if there was
  /// one.
  void Look(const CoupledRun& run, bool world_ticked);

  bool sound() const { return complaint_.empty(); }
  /// The first message that was not, in words; empty = none.
  const std::string& complaint() const { return complaint_; }

 private:
  template <typename Message>
  void Check(const char* name, const Message& message);
  void CheckBodies(const std::vector<protocol::Body>& bodies);
  void Complain(const char* name, protocol::DecodeStatus status);

  std::vector<std::uint64_t> words_;
  std::uint64_t tick_ = 0;
  std::string complaint_;
};

}  // namespace rikiseki::lab
