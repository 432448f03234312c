// SPDX-License-Identifier: MIT
// What can be told of a live segment by looking at it: header, directory, ring, liveness. Read-only,
// of either role.
#pragma once

#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/tools/check/case.h"

namespace rikiseki::protocol::check {

/// A segment mapped a second time, raw, so that its words can be looked at one by one.
class RawView {
 public:
  /// Throws std::system_error.
  RawView(const std::string& instance, Role role);
  const std::string& name() const { return name_; }
  const SegmentHeader& header() const { return *header_; }
  std::uint64_t bytes() const { return bytes_; }
  Ring RingOf(const StreamEntry& entry) const;

 private:
  std::string name_;
  std::unique_ptr<SharedObject> object_;
  SegmentHeader* header_ = nullptr;
  std::uint64_t bytes_ = 0;
};

// Each returns normally or throws an Outcome.
void CheckReserved(const RawView& view);
void CheckEpoch(const RawView& view);
void CheckPermissions(const std::string& instance, Role role);
/// `main` is the stream of every tick or frame. Looks for `seconds`.
void CheckHeartbeat(const RawView& view, StreamType main, double seconds);
void CheckPublication(const RawView& view, StreamType main, double seconds);

/// Every check on the segment of one role, its state as it is.
std::vector<Result> Inspect(const std::string& instance, Role role);

}  // namespace rikiseki::protocol::check
