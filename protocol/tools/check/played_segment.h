// SPDX-License-Identifier: MIT
// A segment that the kit owns and may spoil: made like protocol/owner.h makes one, but every word can
// be written at any time, and it can end in every way that a process can.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/codec.h"
#include "protocol/owner.h"
#include "protocol/ring.h"
#include "protocol/shared_object.h"

namespace rikiseki::protocol::check {

/// Holds the role lock of an instance for its life, so that no real side of that role runs beside the
/// kit. Throws SegmentError.
class RoleHolder {
 public:
  RoleHolder(const std::string& instance, Role role, const std::string& runtime_directory);
  /// A time of CLOCK_MONOTONIC, later than every one before.
  std::uint64_t NextEpoch();

 private:
  SegmentOwner keeper_;
  std::uint64_t last_epoch_;
};

struct SegmentScript {
  std::string instance;
  Role role = Role::kWorld;
  std::vector<StreamSpec> streams;
  std::uint64_t epoch = 0;
  SegmentState state = SegmentState::kReady;
  std::function<void(SegmentHeader&)> alter;  // what is wrong with the header, before `state`
};

class PlayedSegment {
 public:
  explicit PlayedSegment(const SegmentScript& script);
  /// Dies, if it did not end yet, and takes the name away.
  ~PlayedSegment();
  PlayedSegment(const PlayedSegment&) = delete;
  PlayedSegment& operator=(const PlayedSegment&) = delete;

  std::uint64_t epoch() const { return epoch_; }
  Ring RingOf(StreamType type) const;
  void Heartbeat(std::uint64_t tick, std::uint64_t now_ns);
  void SetState(SegmentState state);
  /// The header's `rejected`.
  void CountRejected(std::uint64_t total);

  /// state = closed, and the name is gone.
  void Close();
  /// As SIGKILL would: the owner lock is free, the name and every word stay.
  void Die();
  bool ended() const { return ended_; }

 private:
  std::string name_;
  std::uint64_t epoch_;
  std::vector<StreamEntry> entries_;  // as laid out, whatever the header says
  std::unique_ptr<SharedObject> object_;
  SegmentHeader* header_ = nullptr;
  ObjectId id_;
  bool ended_ = false;
};

/// Publishes as SPEC.md 4.2 says, but lets the shape word lie and the numbers be set.
class RawWriter {
 public:
  RawWriter() = default;
  explicit RawWriter(const Ring& ring) : ring_(ring) {}

  void Publish(std::span<const std::uint64_t> payload, Encoded shape, std::uint64_t stamp_ns);
  /// Writes the next message but for its last `missing` stores: 1 leaves the counter where it was, 2
  /// the sequence odd as well, more leave payload words out. The number counts as not published.
  void PublishPartly(std::span<const std::uint64_t> payload, Encoded shape, std::size_t missing);
  /// Stores the counter, whatever it was; the next message is the one after.
  void SetPublished(std::uint64_t number);

  const Ring& ring() const { return ring_; }
  std::uint64_t published() const { return published_; }

 private:
  Ring ring_;
  std::uint64_t published_ = 0;
};

/// Byte offset of a field within its record, by the names of layout.golden.txt ("world.frame",
/// "plane_count"). Throws std::out_of_range for a field that is not there.
std::size_t FieldOffset(std::string_view record, std::string_view field);
/// Bytes of a record.
std::size_t RecordBytes(std::string_view record);

/// Overwrites one u32, u64 or f64 at a byte offset of a payload.
template <typename T>
void Poke(std::span<std::uint64_t> words, std::size_t offset, T value);

}  // namespace rikiseki::protocol::check
