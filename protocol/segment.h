// SPDX-License-Identifier: MIT
// The bytes of a segment: header, stream directory and slot header, as SPEC.md sections 3 and 4
// give them. Only plain words live here; ring.h and attach.h say how they may be touched.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "protocol/version.h"

namespace rikiseki::protocol {

inline constexpr std::uint64_t kMagic = 0x494B455349'4B4952ULL;  // "RIKISEKI", little-endian
inline constexpr std::uint32_t kByteOrderMark = 0x01020304;
inline constexpr std::uint32_t kHeaderBytes = 4096;
inline constexpr std::uint32_t kMaxStreams = 16;
inline constexpr std::uint32_t kLineBytes = 128;  // two cache lines: the adjacent one is prefetched
inline constexpr std::uint32_t kMinSlots = 4;
inline constexpr std::uint32_t kMaxSlots = 65536;
inline constexpr std::uint64_t kMaxSegmentBytes = 16ULL << 20;

enum class Role : std::uint32_t { kHaptic = 1, kWorld = 2 };

enum class SegmentState : std::uint64_t {
  kInitialising = 0,
  kReady = 1,
  kClosed = 2,
  kFaulted = 3,
  kSuperseded = 4,
};

/// One stream of a segment: where its counter and its ring lie. SPEC.md 3.2.
struct StreamEntry {
  std::uint32_t type_id;  // what the payload means; never reused
  std::uint16_t type_version;
  std::uint16_t flags;
  std::uint64_t cursor_offset;  // of the `published` counter, 128-aligned, alone on its line
  std::uint64_t ring_offset;    // 128-aligned
  std::uint32_t slot_stride;    // bytes, a multiple of 128; readers step by the writer's stride
  std::uint32_t slot_count;     // a power of two in [4, 65536]
  std::uint32_t payload_bytes;  // room for payload, a multiple of 8, <= slot_stride - 32
  std::uint32_t reserved0;
  std::uint64_t period_ns;  // nominal; 0 = aperiodic
  std::uint64_t reserved1[2];
};

/// The first 4096 bytes of every segment. SPEC.md 3.1.
struct SegmentHeader {
  // Constant once state == kReady: a reader copies this part once and never looks again.
  std::uint64_t magic;
  std::uint32_t byte_order;
  std::uint16_t version_major;
  std::uint16_t version_minor;
  std::uint64_t layout_hash;  // compared only where (major, minor) are equal
  std::uint32_t header_bytes;
  std::uint32_t stream_count;
  std::uint64_t segment_bytes;
  std::uint64_t epoch;  // creation time, ns: grows strictly over the restarts within one boot
  std::uint32_t role;
  std::uint32_t writer_pid;  // for people and logs, never for decisions
  char build[64];            // NUL padded, diagnostics only
  std::uint64_t reserved0;
  // Liveness, on a 128-byte line of its own.
  std::uint64_t state;
  std::uint64_t heartbeat_ns;  // CLOCK_MONOTONIC, each tick
  std::uint64_t tick;          // each tick
  std::uint64_t fault_code;
  std::uint64_t reserved1[12];
  // What the writer met as a reader of its peer: monotonic counters, a line of their own.
  std::uint64_t overruns;
  std::uint64_t lapped;
  std::uint64_t read_retries;
  std::uint64_t rejected;
  std::uint64_t gaps;
  std::uint64_t reserved2[11];
  std::uint64_t reserved3[80];
  StreamEntry stream[kMaxStreams];
  std::uint64_t reserved4[256];
};

/// In front of every payload. SPEC.md 4.1: 2n - 1 while message n is being written, 2n when whole.
struct SlotHeader {
  std::uint64_t sequence;
  std::uint64_t stamp_ns;
  std::uint32_t used_bytes;
  std::uint32_t blocks;  // which optional blocks follow, in fixed order
  std::uint64_t reserved;
};

static_assert(sizeof(StreamEntry) == 64 && sizeof(SlotHeader) == 32);
static_assert(sizeof(SegmentHeader) == kHeaderBytes);
static_assert(offsetof(SegmentHeader, state) == 0x80);
static_assert(offsetof(SegmentHeader, overruns) == 0x100);
static_assert(offsetof(SegmentHeader, stream) == 0x400);
static_assert(std::has_unique_object_representations_v<StreamEntry>);
static_assert(std::has_unique_object_representations_v<SegmentHeader>);
static_assert(std::has_unique_object_representations_v<SlotHeader>);
static_assert(std::endian::native == std::endian::little && sizeof(void*) == 8);

}  // namespace rikiseki::protocol
