// SPDX-License-Identifier: MIT
// A ring and a codec together: messages in, messages out, with the scratch memory inside. Neither
// allocates after construction; each belongs to one thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "protocol/codec.h"
#include "protocol/ring.h"

namespace rikiseki::protocol {

/// How many refusals of a stream's messages in a row end in detaching. SPEC.md 9.2.
inline constexpr std::uint32_t kRejectionsBeforeDetach = 10;

/// Messages as large as `Words` has room for.
template <typename Message, typename Words>
class WordsWriter {
 public:
  WordsWriter() = default;
  explicit WordsWriter(const StreamWriter& writer) : writer_(writer) {
    if constexpr (requires { words_.resize(0); }) words_.resize(writer.payload_bytes() / 8);
  }

  /// False, and nothing is published, for a message with impossible counts, or for one that is more
  /// than the stream was made for. // RT:
  bool Publish(const Message& message, std::uint64_t stamp_ns) noexcept {
    const Encoded encoded = Encode(message, std::span<std::uint64_t>(words_));
    if (encoded.used_bytes == 0) return false;
    return writer_.Publish(std::span<const std::uint64_t>(words_).first(encoded.used_bytes / 8),
                           encoded.blocks, stamp_ns);
  }

  std::uint64_t published() const noexcept { return writer_.published(); }

 private:
  StreamWriter writer_;
  Words words_{};
};

template <typename Message>
using MessageWriter =
    WordsWriter<Message, std::array<std::uint64_t, StreamOf<Message>::kBytes / 8>>;
/// world.bodies and world.scene, whose size the scene decides; the latter is published when a scene
/// was loaded, not every tick.
using BodiesWriter = WordsWriter<std::span<const Body>, std::vector<std::uint64_t>>;
using SceneWriter = WordsWriter<WorldScene, std::vector<std::uint64_t>>;

/// A reader that has no clock asks with this: stamps and counters are then not held against one.
inline constexpr std::uint64_t kNoClock = ~std::uint64_t{0};
/// How far in the future a stamp may lie. SPEC.md 9.2-8.
inline constexpr std::uint64_t kStampSlackNs = 1'000'000;

/// Reads a stream into `Words`, and judges what it reads: stamps, counters, and what Decode says.
template <typename Words>
class WordsReader {
 public:
  WordsReader() = default;
  /// `period_ns`: of the stream's directory; 0 = aperiodic.
  WordsReader(const StreamReader& reader, std::uint64_t period_ns, Words words = {})
      : reader_(reader), period_ns_(period_ns), words_(std::move(words)) {}

  /// `decode(words, encoded)` leaves what it fills untouched unless kOk. // RT:
  template <typename DecodeFunction>
  ReadStatus ReadLatest(std::uint64_t now_ns, DecodeFunction&& decode) {
    if (hopeless()) return ReadStatus::kEmpty;
    return Accept(reader_.ReadLatest(words_, received_), now_ns, decode);
  }
  template <typename DecodeFunction>
  ReadStatus ReadNext(std::uint64_t now_ns, DecodeFunction&& decode) {
    if (hopeless()) return ReadStatus::kEmpty;
    return Accept(reader_.ReadNext(words_, received_), now_ns, decode);
  }

  const StreamReader& ring() const noexcept { return reader_; }
  /// Number and stamp of the message returned (or rejected) last.
  const Received& received() const noexcept { return received_; }
  std::uint64_t rejected() const noexcept { return rejected_; }
  std::uint32_t rejected_in_a_row() const noexcept { return rejected_in_a_row_; }
  /// Why the last rejected message was.
  DecodeStatus refusal() const noexcept { return refusal_; }
  /// The peer talks nonsense: PeerLink::Refuse() it. Final: nothing more is read from this ring.
  bool hopeless() const noexcept {
    return backwards_ || rejected_in_a_row_ >= kRejectionsBeforeDetach;
  }

 private:
  template <typename DecodeFunction>
  ReadStatus Accept(ReadStatus status, std::uint64_t now_ns, DecodeFunction& decode) {
    if (status == ReadStatus::kFresh && Jumped(now_ns)) status = ReadStatus::kBackwards;
    if (status == ReadStatus::kBackwards) backwards_ = true;
    if (status == ReadStatus::kRejected) {
      refusal_ = DecodeStatus::kLength;
    } else if (status == ReadStatus::kFresh && !StampIsSound(now_ns)) {
      refusal_ = DecodeStatus::kStamp;
    } else if (status == ReadStatus::kFresh) {
      refusal_ = decode(std::span<const std::uint64_t>(words_),
                        Encoded{received_.used_bytes, received_.blocks});
      if (refusal_ == DecodeStatus::kOk) {
        rejected_in_a_row_ = 0;
        stamp_ns_ = received_.stamp_ns;
        return status;
      }
    } else {
      return status;
    }
    ++rejected_;
    ++rejected_in_a_row_;
    return ReadStatus::kRejected;
  }

  bool StampIsSound(std::uint64_t now_ns) const noexcept {
    if (received_.stamp_ns < stamp_ns_) return false;
    return now_ns == kNoClock || received_.stamp_ns <= now_ns ||
           received_.stamp_ns - now_ns <= kStampSlackNs;
  }

  /// The counter has grown faster than any writer of this period can be meant to. SPEC.md 9.2-9.
  bool Jumped(std::uint64_t now_ns) noexcept {
    if (now_ns == kNoClock || period_ns_ == 0) return false;
    const std::uint64_t periods = looked_ns_ == 0 ? 0 : (now_ns - looked_ns_) / period_ns_;
    const bool first = looked_ns_ == 0;
    const std::uint64_t grown = received_.number - looked_number_;
    looked_ns_ = now_ns;
    looked_number_ = received_.number;
    return !first && grown / 4 > periods + reader_.slot_count();
  }

  StreamReader reader_;
  std::uint64_t period_ns_ = 0;
  std::uint64_t looked_ns_ = 0;  // when the newest message came; 0 = none yet
  std::uint64_t looked_number_ = 0;
  std::uint64_t stamp_ns_ = 0;  // of the message accepted last
  Words words_{};
  Received received_;
  std::uint64_t rejected_ = 0;
  std::uint32_t rejected_in_a_row_ = 0;
  DecodeStatus refusal_ = DecodeStatus::kOk;
  bool backwards_ = false;
};

template <typename Message>
class MessageReader {
 public:
  MessageReader() = default;
  /// `period_ns`: of the stream's directory; 0 = aperiodic.
  explicit MessageReader(const StreamReader& reader, std::uint64_t period_ns = 0) noexcept
      : reader_(reader, period_ns) {}

  /// Unless kFresh, `message` is untouched. `now_ns`: CLOCK_MONOTONIC just before the call. // RT:
  ReadStatus ReadLatest(Message& message, std::uint64_t now_ns = kNoClock) noexcept {
    return reader_.ReadLatest(now_ns, Into(message));
  }
  ReadStatus ReadNext(Message& message, std::uint64_t now_ns = kNoClock) noexcept {
    return reader_.ReadNext(now_ns, Into(message));
  }

  const StreamReader& ring() const noexcept { return reader_.ring(); }
  const Received& received() const noexcept { return reader_.received(); }
  std::uint64_t rejected() const noexcept { return reader_.rejected(); }
  std::uint32_t rejected_in_a_row() const noexcept { return reader_.rejected_in_a_row(); }
  DecodeStatus refusal() const noexcept { return reader_.refusal(); }
  bool hopeless() const noexcept { return reader_.hopeless(); }

 private:
  static auto Into(Message& message) noexcept {
    return [&message](std::span<const std::uint64_t> words, Encoded encoded) noexcept {
      return Decode(words, encoded, message);
    };
  }

  WordsReader<std::array<std::uint64_t, StreamOf<Message>::kBytes / 8>> reader_;
};

class BodiesReader {
 public:
  BodiesReader() = default;
  explicit BodiesReader(const StreamReader& reader)
      : reader_(reader, 0, std::vector<std::uint64_t>(WorldBodiesBytes(kMaxBodies) / 8)),
        bodies_(kMaxBodies) {}

  /// The bodies of the newest message read; empty before the first, and if it was not sound.
  std::span<const Body> bodies() const noexcept { return std::span(bodies_).first(count_); }
  const Received& received() const noexcept { return reader_.received(); }

  ReadStatus ReadLatest() noexcept {
    return reader_.ReadLatest(
        kNoClock, [this](std::span<const std::uint64_t> words, Encoded encoded) noexcept {
          const DecodeStatus status = Decode(words, encoded, std::span(bodies_), count_);
          if (status != DecodeStatus::kOk) count_ = 0;  // they may be partly overwritten
          return status;
        });
  }

 private:
  WordsReader<std::vector<std::uint64_t>> reader_;
  std::vector<Body> bodies_;
  std::uint32_t count_ = 0;
};

class SceneReader {
 public:
  SceneReader() = default;
  explicit SceneReader(const StreamReader& reader)
      : reader_(reader, 0, std::vector<std::uint64_t>(reader.payload_bytes() / 8)) {}

  /// The newest sound scene read; revision 0 before the first.
  const WorldScene& scene() const noexcept { return scene_; }

  ReadStatus ReadLatest() {
    return reader_.ReadLatest(kNoClock,
                              [this](std::span<const std::uint64_t> words, Encoded encoded) {
                                return Decode(words, encoded, scene_);
                              });
  }

 private:
  WordsReader<std::vector<std::uint64_t>> reader_;
  WorldScene scene_;
};

}  // namespace rikiseki::protocol
