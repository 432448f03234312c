// SPDX-License-Identifier: MIT
#include "protocol/stream.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <new>
#include <vector>

#include "tests/protocol/support.h"

namespace {
std::atomic<std::uint64_t> allocations{0};
}  // namespace

// Counts every allocation of this test program. Not inlined, so that the compiler sees matching
// pairs. The sanitizers bring their own operators and do not like others.
#if defined(__SANITIZE_ADDRESS__)
#define RIKISEKI_SANITIZED
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define RIKISEKI_SANITIZED
#endif
#endif
#ifndef RIKISEKI_SANITIZED
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  if (void* memory = std::malloc(bytes != 0 ? bytes : 1)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
#endif

namespace rikiseki::protocol {
namespace {

/// Four slots for ticks, in ordinary memory.
class Memory {
 public:
  Ring ring() { return {&published_, words_.data(), kStride, 4, kHapticTickBytes}; }

 private:
  static constexpr std::uint32_t kStride = (kHapticTickBytes + 32 + 127) / 128 * 128;
  std::uint64_t published_ = 0;
  std::vector<std::uint64_t> words_ = std::vector<std::uint64_t>(4 * kStride / 8);
};

TEST_CASE("publishing and reading messages allocates nothing") {
  Memory memory;
  MessageWriter<HapticTick> writer{StreamWriter(memory.ring())};
  MessageReader<HapticTick> reader{StreamReader(memory.ring())};
  test::Generator generator(1);
  std::vector<HapticTick> ticks;
  for (int i = 0; i < 100; ++i) ticks.push_back(generator.Tick());
  HapticTick got;
  bool right = true;
  const std::uint64_t before = allocations.load();
  for (const HapticTick& tick : ticks) {
    right = right && writer.Publish(tick, 1);
    right = right && reader.ReadNext(got) == ReadStatus::kFresh && got.tick == tick.tick;
    right = right && reader.ReadLatest(got) == ReadStatus::kSame;
  }
  const std::uint64_t after = allocations.load();
  CHECK(right);
  CHECK(after == before);
  std::vector<int> one(1);
#ifndef RIKISEKI_SANITIZED
  CHECK(allocations.load() == after + 1);  // the counter counts
#endif
}

TEST_CASE("nonsense is rejected, counted, and ten in a row are hopeless") {
  Memory memory;
  MessageWriter<HapticTick> writer{StreamWriter(memory.ring())};
  MessageReader<HapticTick> reader{StreamReader(memory.ring())};
  HapticTick sound;
  sound.period_ns = 1;
  HapticTick nonsense = sound;
  nonsense.stiffness = -1;
  HapticTick got;
  for (int i = 0; i < 9; ++i) {
    writer.Publish(nonsense, 1);
    CHECK(reader.ReadLatest(got) == ReadStatus::kRejected);
  }
  CHECK_FALSE(reader.hopeless());
  writer.Publish(sound, 1);
  CHECK(reader.ReadLatest(got) == ReadStatus::kFresh);
  CHECK(reader.rejected() == 9);
  for (int i = 0; i < 10; ++i) {
    CHECK_FALSE(reader.hopeless());
    writer.Publish(nonsense, 1);
    CHECK(reader.ReadNext(got) == ReadStatus::kRejected);
  }
  CHECK(reader.hopeless());
  CHECK(reader.refusal() == DecodeStatus::kRange);
  CHECK(got.stiffness == 0);
}

}  // namespace
}  // namespace rikiseki::protocol
