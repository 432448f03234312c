// SPDX-License-Identifier: MIT
// What the two tiny sides share: a writer and a reader of whole messages that can leave out what makes
// them safe.
#pragma once

#include <atomic>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "common/clock.h"
#include "protocol/attach.h"
#include "protocol/codec.h"
#include "protocol/tools/check/lint.h"
#include "protocol/tools/check/played_segment.h"
#include "protocol/tools/check/totals.h"

namespace rikiseki::protocol::test {

/// Publishes; `before_write`: the counter first.
template <typename Message>
void PublishMessage(check::RawWriter& writer, const Message& message, bool before_write) {
  std::vector<std::uint64_t> words(StreamOf<Message>::kBytes / 8);
  const Encoded shape = Encode(message, words);
  words.resize(shape.used_bytes / 8);
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  if (before_write) {
    std::atomic_ref<std::uint64_t>(*writer.ring().published)
        .store(writer.published() + 1, std::memory_order_release);
    SleepUntil(MonotonicNow() + 100'000);
  }
  writer.Publish(words, shape, now);
}

/// Another map of the peer's object, without any check; null if the name is gone already.
inline std::unique_ptr<check::RawView> MapCarelessly(const std::string& instance, Role role) {
  try {
    return std::make_unique<check::RawView>(instance, role);
  } catch (const std::system_error&) {
    return nullptr;
  }
}

/// How the looks at a slot are left out.
struct Looks {
  bool first = true;
  bool second = true;
};

/// Reads one message by its number without the looks of SPEC.md 4.3 that are left out.
template <typename Message>
bool ReadCarelessly(const Ring& ring, std::uint64_t number, Looks looks, Message& message) {
  const auto load = [](std::uint64_t& word) {
    return std::atomic_ref<std::uint64_t>(word).load(std::memory_order_acquire);
  };
  std::uint64_t* const slot = ring.Slot(number);
  for (int i = 0; i < 3; ++i) {
    if (looks.first && load(slot[kSequenceWord]) != 2 * number) continue;
    // As if it was preempted here, which the second look is for.
    if (!looks.second) SleepUntil(MonotonicNow() + 50'000);
    const std::uint64_t shape = load(slot[kShapeWord]);
    std::vector<std::uint64_t> words(ring.payload_bytes / 8);
    for (std::size_t w = 0; w < words.size(); ++w) words[w] = load(slot[kPayloadWord + w]);
    if (looks.second && load(slot[kSequenceWord]) != 2 * number) continue;
    const Encoded encoded{static_cast<std::uint32_t>(shape),
                          static_cast<std::uint32_t>(shape >> 32)};
    return Decode(words, encoded, message) == DecodeStatus::kOk;
  }
  return false;
}

}  // namespace rikiseki::protocol::test
