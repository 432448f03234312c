// SPDX-License-Identifier: MIT
// The reading end of somebody else's segment: opens it read-only, checks every word that it will
// rely on, keeps private copies of them, and never looks at the originals again. SPEC.md 5.3 and
// section 9.
//
// Everything here may block, allocate and make system calls, except the functions marked RT.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/owner.h"
#include "protocol/ring.h"
#include "protocol/segment.h"
#include "protocol/shared_object.h"
#include "protocol/stream.h"

namespace rikiseki::protocol {

enum class AttachStatus : std::uint32_t {
  kAttached,
  kAbsent,        // no object of that name
  kNotReady,      // its owner is still filling it: try again
  kOwnerGone,     // closed, superseded, or its owner died
  kForbidden,     // may not be read, or belongs to somebody who may not own it
  kIncompatible,  // malformed or of another version: do not try again before the object changes
};

/// A stream that the reader cannot do without.
struct StreamRequirement {
  StreamType type;
  std::uint16_t min_version = 1;
  std::uint64_t min_history_ns = 0;  // slot_count * period_ns; 0 = any
};

struct AttachRequest {
  std::string instance = "0";
  Role role = Role::kHaptic;  // whose segment
  std::vector<StreamRequirement> required;
  /// Who may own the object; empty: DefaultOwners().
  std::vector<uid_t> owners;
};

/// This process's user, root, and the users haptics-device and haptics-world where they exist.
std::vector<uid_t> DefaultOwners();

/// An attached segment. All its numbers are private copies, checked.
class PeerView {
 public:
  ~PeerView();
  PeerView(const PeerView&) = delete;
  PeerView& operator=(const PeerView&) = delete;

  std::uint64_t epoch() const noexcept { return header_.epoch; }
  /// The header as it was when attached; only its constant part means anything.
  const SegmentHeader& header() const noexcept { return header_; }
  const ObjectId& object() const noexcept { return object_; }
  /// Empty, or why the pages could not be locked into memory.
  const std::string& note() const noexcept { return note_; }

  /// What the owner says now. // RT:
  SegmentState State() const noexcept;
  std::uint64_t HeartbeatNs() const noexcept;
  std::uint64_t Tick() const noexcept;
  std::uint64_t FaultCode() const noexcept;
  HealthCounters Counters() const noexcept;

  /// The attacher found the owner dead or the object replaced: one relaxed load. Final. // RT:
  bool gone() const noexcept { return gone_.load(std::memory_order_relaxed); }
  /// Ready and not gone. // RT:
  bool Ready() const noexcept { return !gone() && State() == SegmentState::kReady; }

  bool Has(StreamType type) const noexcept;
  /// Nominal period of a stream; 0 = aperiodic or absent. // RT:
  std::uint64_t PeriodNs(StreamType type) const noexcept;
  /// A new reader of a stream, before its first message; one that only says kEmpty if there is no
  /// such stream. No allocation. // RT:
  StreamReader Stream(StreamType type) const noexcept;
  template <typename Message>
  MessageReader<Message> Reader() const noexcept {
    return MessageReader<Message>(Stream(StreamOf<Message>::kType),
                                  PeriodNs(StreamOf<Message>::kType));
  }

  /// Does its owner's process still live? Asks the kernel for the lock, not for a pid. System call.
  bool OwnerAlive() const noexcept;
  /// Does the name still lead to this object? System call.
  bool IsCurrent() const noexcept;
  /// For the attacher.
  void MarkGone() noexcept { gone_.store(true, std::memory_order_relaxed); }

 private:
  friend struct Attachment;
  struct Mapped;
  PeerView();
  const StreamEntry* Find(StreamType type) const noexcept;

  std::string name_;
  std::string note_;
  SegmentHeader header_{};
  ObjectId object_;
  std::atomic<bool> gone_{false};
  std::unique_ptr<Mapped> mapped_;
};

struct AttachResult {
  AttachStatus status = AttachStatus::kAbsent;
  std::string text;  // one line; names the differing field
  ObjectId object;   // what was looked at
  std::unique_ptr<PeerView> view;
};

/// Never throws for what the segment holds; std::bad_alloc and a wrong instance name (SegmentError)
/// only.
AttachResult Attach(const AttachRequest& request);

/// The version rule of SPEC.md 8.2. Empty if this library can read it, or which field differs.
std::string CompareVersion(std::uint16_t their_major, std::uint16_t their_minor,
                           std::uint64_t their_hash, std::uint16_t our_major,
                           std::uint16_t our_minor, std::uint64_t our_hash);

/// Checks the private copy of a header against the size of its object. Empty, or the field that is
/// wrong.
std::string CheckHeader(const SegmentHeader& header, std::uint64_t object_bytes, Role role);

}  // namespace rikiseki::protocol
