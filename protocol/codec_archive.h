// SPDX-License-Identifier: MIT
// What the encoders and decoders of codec_*.cpp have in common: the archives that walk the fields of
// fields.h, and the checks of length. Private to them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "protocol/codec.h"
#include "protocol/fields.h"

namespace rikiseki::protocol {

// Little-endian bytes are this machine's own (asserted in segment.h), so a field is copied as it is.

class Encoder {
 public:
  explicit Encoder(std::span<std::uint64_t> words) : bytes_(std::as_writable_bytes(words)) {}

  template <typename T>
  void operator()(const char*, const T& value) {
    std::memcpy(bytes_.data() + offset_, &value, sizeof(T));
    offset_ += sizeof(T);
  }

  /// Records that lie in memory as on the wire.
  template <typename Record>
  void Whole(std::span<const Record> records) {
    std::memcpy(bytes_.data() + offset_, records.data(), records.size_bytes());
    offset_ += records.size_bytes();
  }

 private:
  std::span<std::byte> bytes_;
  std::size_t offset_ = 0;
};

class Decoder {
 public:
  explicit Decoder(std::span<const std::uint64_t> words) : bytes_(std::as_bytes(words)) {}

  template <typename T>
  void operator()(const char*, T& value) {
    std::memcpy(&value, bytes_.data() + offset_, sizeof(T));
    offset_ += sizeof(T);
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t offset_ = 0;
};

/// Sums up how many bytes a record takes.
class Ruler {
 public:
  template <typename T>
  constexpr void operator()(const char*, const T&) {
    bytes_ += static_cast<std::uint32_t>(sizeof(T));
  }
  constexpr std::uint32_t bytes() const { return bytes_; }

 private:
  std::uint32_t bytes_ = 0;
};

template <typename Record, typename Fields>
constexpr std::uint32_t Measure(Fields fields) {
  const Record record{};
  Ruler ruler;
  fields(ruler, record);
  return ruler.bytes();
}

/// Both the copy and the message, as it says of itself, reach this far.
inline bool Reaches(std::span<const std::uint64_t> words, Encoded encoded, std::uint64_t bytes) {
  return bytes <= words.size_bytes() && bytes <= encoded.used_bytes;
}

/// The lengths agree: exactly, or, if blocks of a later version follow, at least.
inline bool LengthAgrees(std::span<const std::uint64_t> words, Encoded encoded,
                         std::uint32_t known_bytes, std::uint32_t known_blocks) {
  if (known_bytes > words.size_bytes()) return false;
  const bool more_follows = (encoded.blocks & ~known_blocks) != 0;
  return more_follows ? encoded.used_bytes >= known_bytes : encoded.used_bytes == known_bytes;
}

}  // namespace rikiseki::protocol
