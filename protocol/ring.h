// SPDX-License-Identifier: MIT
// A ring of messages with one writer and any number of readers, over plain 64-bit words that two
// processes map. It overwrites the oldest; every message is full state. SPEC.md section 4.
//
// Thread safety
//   One thread calls StreamWriter::Publish. A StreamReader belongs to one thread; any number of
//   readers, in any process, may read one ring. Both sides are wait-free: no lock, no system call,
//   no allocation. Readers only load (they map the pages read-only: any read-modify-write would
//   fault).
//
// Invariants
//   1. Message n = 1, 2, 3, ... lives in slot n & (slot_count - 1).
//   2. A slot's sequence is 0 = never used, 2n - 1 = message n is being written, 2n = message n is
//   whole.
//   3. `published` is the newest whole message and never decreases; its slot is not being written
//   until
//      slot_count - 1 more messages were published.
//   4. Every payload word of message n is a release store between the stores of 2n - 1 and 2n.
//   5. A writer that stops between any two stores leaves every published message readable, and the
//   one
//      it was writing invisible.
//   6. What a reader returns was whole: it met 2n before it copied (acquire), copied with acquire
//   loads
//      into private memory, and met 2n again after. A word of a later message m that slipped in
//      would have made 2m - 1 visible to that last look.
//   7. A reader trusts no length: it copies min(used, its own buffer, the writer's room) and says
//   so if
//      they do not agree.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/segment.h"

namespace rikiseki::protocol {

static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free);
static_assert(std::atomic_ref<std::uint64_t>::required_alignment == 8);

/// Where one stream's counter and slots lie. The numbers are the holder's private copies.
struct Ring {
  std::uint64_t* published = nullptr;
  std::uint64_t* slots = nullptr;
  std::uint32_t slot_stride = 0;  // bytes
  std::uint32_t slot_count = 0;   // a power of two
  std::uint32_t payload_bytes = 0;

  std::uint64_t* Slot(std::uint64_t number) const noexcept {
    return slots + (number & (slot_count - 1)) * (slot_stride / sizeof(std::uint64_t));
  }
};

/// Words of SlotHeader.
inline constexpr std::size_t kSequenceWord = 0;
inline constexpr std::size_t kStampWord = 1;
inline constexpr std::size_t kShapeWord = 2;  // used_bytes | blocks << 32
inline constexpr std::size_t kPayloadWord = sizeof(SlotHeader) / sizeof(std::uint64_t);

/// Every store of one publication, in order, through `store(word, value, memory_order)`. One text
/// for the shipped writer and for the test that stops after each store.
template <typename Store>
void PublishStores(const Ring& ring, std::uint64_t number, std::span<const std::uint64_t> payload,
                   std::uint32_t blocks, std::uint64_t stamp_ns, Store&& store) {
  std::uint64_t* slot = ring.Slot(number);
  const std::uint64_t shape = payload.size_bytes() | static_cast<std::uint64_t>(blocks) << 32;
  store(slot[kSequenceWord], 2 * number - 1, std::memory_order_relaxed);
  // SYNC: slot words. Each release store carries the mark 2n - 1 with it; a reader that acquires
  // one of these words must see the mark (or a later one) when it looks again.
  store(slot[kStampWord], stamp_ns, std::memory_order_release);
  store(slot[kShapeWord], shape, std::memory_order_release);
  for (std::size_t i = 0; i < payload.size(); ++i) {
    store(slot[kPayloadWord + i], payload[i], std::memory_order_release);
  }
  // SYNC: whole. Pairs with the reader's first look at the sequence.
  store(slot[kSequenceWord], 2 * number, std::memory_order_release);
  // SYNC: published. Pairs with the reader's load of the counter.
  store(*ring.published, number, std::memory_order_release);
}

/// What stands beside a payload.
struct Received {
  std::uint64_t number = 0;  // n
  std::uint64_t stamp_ns = 0;
  std::uint32_t used_bytes = 0;  // what the writer says; copied: min(used_bytes, the buffer)
  std::uint32_t blocks = 0;
};

/// Every load of one copy of message `number`, in order, through `load(word, memory_order)`;
/// whether the copy is whole. One text for the shipped reader and for the test that lets the writer
/// in before each load.
template <typename Load>
bool CopyLoads(const Ring& ring, std::uint64_t number, std::span<std::uint64_t> payload,
               Received& received, Load&& load) {
  std::uint64_t* slot = ring.Slot(number);
  // SYNC: whole. Everything that the writer stored before 2n is visible from here on.
  if (load(slot[kSequenceWord], std::memory_order_acquire) != 2 * number) return false;
  // SYNC: slot words. A word of a later message m makes its mark 2m - 1 visible to the last look.
  const std::uint64_t stamp_ns = load(slot[kStampWord], std::memory_order_acquire);
  const std::uint64_t shape = load(slot[kShapeWord], std::memory_order_acquire);
  const auto used_bytes = static_cast<std::uint32_t>(shape);
  const std::size_t words =
      std::min<std::size_t>(std::min(used_bytes, ring.payload_bytes) / 8, payload.size());
  for (std::size_t i = 0; i < words; ++i) {
    payload[i] = load(slot[kPayloadWord + i], std::memory_order_acquire);
  }
  if (load(slot[kSequenceWord], std::memory_order_relaxed) != 2 * number) return false;
  received = {number, stamp_ns, used_bytes, static_cast<std::uint32_t>(shape >> 32)};
  return true;
}

class StreamWriter {
 public:
  StreamWriter() = default;
  /// The ring must be zeroed and outlive the writer.
  explicit StreamWriter(const Ring& ring) noexcept : ring_(ring) {}

  std::uint32_t payload_bytes() const noexcept { return ring_.payload_bytes; }
  /// The number of the newest published message; 0 = none.
  std::uint64_t published() const noexcept { return published_; }

  /// Publishes the next message. False, and nothing happens, if the payload does not fit. // RT:
  bool Publish(std::span<const std::uint64_t> payload, std::uint32_t blocks,
               std::uint64_t stamp_ns) noexcept;

 private:
  Ring ring_;
  std::uint64_t published_ = 0;
};

enum class ReadStatus : std::uint32_t {
  kFresh,      // a message not returned before
  kSame,       // ReadLatest: the newest is the one returned last
  kEmpty,      // nothing (more) was published
  kContended,  // overwritten while being copied, three times: keep the previous value
  kBackwards,  // the counter went back, or cannot be: the writer breaks the protocol
  kRejected,   // the message is nonsense (its lengths, or what it says): keep the previous value
};

class StreamReader {
 public:
  StreamReader() = default;
  /// The ring must outlive the reader. Starts before the first message.
  explicit StreamReader(const Ring& ring) noexcept : ring_(ring) {}

  /// Copies the newest message into `payload`; at most 3 copies. // RT:
  ReadStatus ReadLatest(std::span<std::uint64_t> payload, Received& received) noexcept;

  /// Copies the message after the one returned last. A reader that was lapped goes on in the middle
  /// of the ring and counts what it lost. At most 3 copies. // RT:
  ReadStatus ReadNext(std::span<std::uint64_t> payload, Received& received) noexcept;

  /// Room for a payload, as the writer's directory says it; 0 without a ring.
  std::uint32_t payload_bytes() const noexcept { return ring_.payload_bytes; }
  std::uint32_t slot_count() const noexcept { return ring_.slot_count; }
  /// The number of the message returned last: where ReadNext goes on.
  std::uint64_t cursor() const noexcept { return cursor_; }
  /// Messages that were overwritten before ReadNext saw them.
  std::uint64_t lost() const noexcept { return lost_; }
  /// Copies that had to be thrown away.
  std::uint64_t retries() const noexcept { return retries_; }

 private:
  bool Copy(std::uint64_t number, std::span<std::uint64_t> payload, Received& received) noexcept;
  ReadStatus Return(const Received& received) noexcept;

  Ring ring_;
  std::uint64_t cursor_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t retries_ = 0;
};

}  // namespace rikiseki::protocol
