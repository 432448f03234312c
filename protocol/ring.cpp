// SPDX-License-Identifier: MIT
#include "protocol/ring.h"

namespace rikiseki::protocol {
namespace {

// A lock-free 8-byte load writes nothing, so it may look at a read-only page through an atomic_ref,
// which C++20 does not offer for const words; hence Ring holds plain pointers on both sides.
std::uint64_t Load(std::uint64_t& word, std::memory_order order) noexcept {
  return std::atomic_ref<std::uint64_t>(word).load(order);
}

constexpr int kTries = 3;
// Twice a number must fit into a word: 292 million years at 1 kHz.
constexpr std::uint64_t kEndOfNumbers = 1ULL << 63;
// ReadNext keeps this far from the slot that the writer fills next.
constexpr std::uint64_t kGuard = 2;
constexpr std::size_t kCacheLineWords = 8;

// Asks for all lines of the slot at once: a large ring lies outside the first cache, and the stores,
// which are in order, would wait for one line after the other. A hint that changes no memory.
void FetchSlot(std::uint64_t* slot, std::size_t words) noexcept {
  for (std::size_t i = 0; i < words; i += kCacheLineWords) __builtin_prefetch(slot + i, 1);
}

}  // namespace

bool StreamWriter::Publish(std::span<const std::uint64_t> payload, std::uint32_t blocks,
                           std::uint64_t stamp_ns) noexcept {
  if (payload.size_bytes() > ring_.payload_bytes) return false;
  ++published_;
  FetchSlot(ring_.Slot(published_), kPayloadWord + payload.size());
  PublishStores(ring_, published_, payload, blocks, stamp_ns,
                [](std::uint64_t& word, std::uint64_t value, std::memory_order order) {
                  std::atomic_ref<std::uint64_t>(word).store(value, order);
                });
  return true;
}

bool StreamReader::Copy(std::uint64_t number, std::span<std::uint64_t> payload,
                        Received& received) noexcept {
  return CopyLoads(ring_, number, payload, received, Load);
}

ReadStatus StreamReader::Return(const Received& received) noexcept {
  cursor_ = received.number;
  const bool plausible = received.used_bytes <= ring_.payload_bytes && received.used_bytes % 8 == 0;
  return plausible ? ReadStatus::kFresh : ReadStatus::kRejected;
}

ReadStatus StreamReader::ReadLatest(std::span<std::uint64_t> payload, Received& received) noexcept {
  if (ring_.published == nullptr) return ReadStatus::kEmpty;
  for (int i = 0; i < kTries; ++i) {
    // SYNC: published. The message with this number is whole.
    const std::uint64_t newest = Load(*ring_.published, std::memory_order_acquire);
    if (newest < cursor_ || newest >= kEndOfNumbers) return ReadStatus::kBackwards;
    if (newest == 0) return ReadStatus::kEmpty;
    if (newest == cursor_) return ReadStatus::kSame;
    if (Copy(newest, payload, received)) return Return(received);
    ++retries_;
  }
  return ReadStatus::kContended;
}

ReadStatus StreamReader::ReadNext(std::span<std::uint64_t> payload, Received& received) noexcept {
  if (ring_.published == nullptr) return ReadStatus::kEmpty;
  for (int i = 0; i < kTries; ++i) {
    // SYNC: published. Every message up to this number was whole when it was published.
    const std::uint64_t newest = Load(*ring_.published, std::memory_order_acquire);
    if (newest < cursor_ || newest >= kEndOfNumbers) return ReadStatus::kBackwards;
    if (newest == cursor_) return ReadStatus::kEmpty;
    if (newest - cursor_ > ring_.slot_count - kGuard) {
      const std::uint64_t resumed = newest - ring_.slot_count / 2;
      lost_ += resumed - cursor_;
      cursor_ = resumed;
    }
    if (Copy(cursor_ + 1, payload, received)) return Return(received);
    ++retries_;
  }
  return ReadStatus::kContended;
}

}  // namespace rikiseki::protocol
