// A ring and a codec together: messages in, messages out, with the scratch memory inside. Neither
// allocates after construction; each belongs to one thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/codec.h"
#include "protocol/ring.h"

namespace rikiseki::protocol {

/// How many refusals of a stream's messages in a row end in detaching. SPEC.md 9.2.
inline constexpr std::uint32_t kRejectionsBeforeDetach = 10;

template <typename Message>
class MessageWriter {
 public:
  MessageWriter() = default;
  explicit MessageWriter(const StreamWriter& writer) noexcept : writer_(writer) {}

  /// False, and nothing is published, for a message with impossible counts. // RT:
  bool Publish(const Message& message, std::uint64_t stamp_ns) noexcept {
    const Encoded encoded = Encode(message, std::span<std::uint64_t>(words_));
    if (encoded.used_bytes == 0) return false;
    return writer_.Publish(std::span<const std::uint64_t>(words_).first(encoded.used_bytes / 8),
                           encoded.blocks, stamp_ns);
  }

  std::uint64_t published() const noexcept { return writer_.published(); }

 private:
  StreamWriter writer_;
  std::array<std::uint64_t, StreamOf<Message>::kBytes / 8> words_{};
};

template <typename Message>
class MessageReader {
 public:
  MessageReader() = default;
  explicit MessageReader(const StreamReader& reader) noexcept : reader_(reader) {}

  /// Unless kFresh, `message` is untouched. // RT:
  ReadStatus ReadLatest(Message& message) noexcept {
    if (hopeless()) return ReadStatus::kEmpty;
    return Accept(reader_.ReadLatest(words_, received_), message);
  }
  ReadStatus ReadNext(Message& message) noexcept {
    if (hopeless()) return ReadStatus::kEmpty;
    return Accept(reader_.ReadNext(words_, received_), message);
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
  ReadStatus Accept(ReadStatus status, Message& message) noexcept {
    if (status == ReadStatus::kBackwards) backwards_ = true;
    if (status == ReadStatus::kRejected) {
      refusal_ = DecodeStatus::kLength;
    } else if (status == ReadStatus::kFresh) {
      refusal_ = Decode(words_, {received_.used_bytes, received_.blocks}, message);
      if (refusal_ == DecodeStatus::kOk) {
        rejected_in_a_row_ = 0;
        return status;
      }
    } else {
      return status;
    }
    ++rejected_;
    ++rejected_in_a_row_;
    return ReadStatus::kRejected;
  }

  StreamReader reader_;
  std::array<std::uint64_t, StreamOf<Message>::kBytes / 8> words_{};
  Received received_;
  std::uint64_t rejected_ = 0;
  std::uint32_t rejected_in_a_row_ = 0;
  DecodeStatus refusal_ = DecodeStatus::kOk;
  bool backwards_ = false;
};

/// world.bodies, whose size the scene decides.
class BodiesWriter {
 public:
  BodiesWriter() = default;
  explicit BodiesWriter(const StreamWriter& writer)
      : writer_(writer), words_(writer.payload_bytes() / 8) {}

  /// False, and nothing is published, if they are more than the stream was made for.
  bool Publish(std::span<const Body> bodies, std::uint64_t stamp_ns) noexcept {
    const Encoded encoded = Encode(bodies, std::span<std::uint64_t>(words_));
    if (encoded.used_bytes == 0) return false;
    return writer_.Publish(std::span<const std::uint64_t>(words_).first(encoded.used_bytes / 8),
                           encoded.blocks, stamp_ns);
  }

 private:
  StreamWriter writer_;
  std::vector<std::uint64_t> words_;
};

class BodiesReader {
 public:
  BodiesReader() = default;
  explicit BodiesReader(const StreamReader& reader)
      : reader_(reader), words_(WorldBodiesBytes(kMaxBodies) / 8), bodies_(kMaxBodies) {}

  /// The bodies of the newest message read; empty before the first.
  std::span<const Body> bodies() const noexcept { return std::span(bodies_).first(count_); }
  const Received& received() const noexcept { return received_; }

  ReadStatus ReadLatest() noexcept {
    const ReadStatus status = reader_.ReadLatest(words_, received_);
    if (status != ReadStatus::kFresh) return status;
    std::uint32_t count = 0;
    const DecodeStatus decoded =
        Decode(words_, {received_.used_bytes, received_.blocks}, std::span(bodies_), count);
    count_ = count;
    return decoded == DecodeStatus::kOk ? status : ReadStatus::kRejected;
  }

 private:
  StreamReader reader_;
  std::vector<std::uint64_t> words_;
  std::vector<Body> bodies_;
  Received received_;
  std::uint32_t count_ = 0;
};

/// world.scene, whose size the scene decides: published when a scene was loaded, not every tick.
class SceneWriter {
 public:
  SceneWriter() = default;
  explicit SceneWriter(const StreamWriter& writer)
      : writer_(writer), words_(writer.payload_bytes() / 8) {}

  /// False, and nothing is published, if it does not fit the room that the stream was made with.
  bool Publish(const WorldScene& scene, std::uint64_t stamp_ns) noexcept {
    const Encoded encoded = Encode(scene, std::span<std::uint64_t>(words_));
    if (encoded.used_bytes == 0) return false;
    return writer_.Publish(std::span<const std::uint64_t>(words_).first(encoded.used_bytes / 8),
                           encoded.blocks, stamp_ns);
  }

 private:
  StreamWriter writer_;
  std::vector<std::uint64_t> words_;
};

class SceneReader {
 public:
  SceneReader() = default;
  explicit SceneReader(const StreamReader& reader)
      : reader_(reader), words_(reader.payload_bytes() / 8) {}

  /// The newest sound scene read; revision 0 before the first.
  const WorldScene& scene() const noexcept { return scene_; }

  ReadStatus ReadLatest() {
    Received received;
    const ReadStatus status = reader_.ReadLatest(words_, received);
    if (status != ReadStatus::kFresh) return status;
    const DecodeStatus decoded = Decode(words_, {received.used_bytes, received.blocks}, scene_);
    return decoded == DecodeStatus::kOk ? status : ReadStatus::kRejected;
  }

 private:
  StreamReader reader_;
  std::vector<std::uint64_t> words_;
  WorldScene scene_;
};

}  // namespace rikiseki::protocol
