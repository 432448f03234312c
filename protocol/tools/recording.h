// SPDX-License-Identifier: MIT
// A recording of a pair of daemons: every message as it stood in the rings, with the epoch of its segment.
//
// A file is a header and records, all of 8-byte little-endian words, so that what was written is whole up to
// the last record whatever ended the writer:
//   header  "RKRECORD", 1 (format), protocol version (major << 32 | minor), layout hash
//   record  stream type | blocks << 32, used bytes, epoch, number, stamp_ns, then the payload of SPEC.md 6
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "protocol/codec.h"
#include "protocol/ring.h"
#include "protocol/segment.h"

namespace rikiseki::protocol {

/// The file cannot be opened, is no recording, or there is no room for more of it. One plain line.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Record {
  StreamType type{};
  std::uint64_t epoch = 0;  // of the segment that it was read from
  Received received;
  std::span<const std::uint64_t> words;  // the payload; valid until the next record

  /// kOk, and fills the message, if this is one of its kind and sound.
  template <typename Message>
  bool Is(Message& message) const {
    return type == StreamOf<Message>::kType &&
           Decode(words, {received.used_bytes, received.blocks}, message) == DecodeStatus::kOk;
  }
};

class RecordingWriter {
 public:
  /// Makes the file; one that exists is refused. Throws RecordingError.
  explicit RecordingWriter(const std::string& path);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// Keeps it in memory until the next Flush.
  void Add(const Record& record);
  /// Hands everything to the kernel, and with `durable` to the disk. Throws RecordingError where there is
  /// no room; the file then ends with the last whole record.
  void Flush(bool durable);

  std::uint64_t bytes() const { return bytes_; }

 private:
  std::string path_;
  int file_ = -1;
  std::vector<std::uint64_t> pending_;
  std::vector<std::size_t> ends_;  // of the records in pending_, words
  std::uint64_t bytes_ = 0;        // in the file
};

class RecordingReader {
 public:
  /// Throws RecordingError: no such file, no recording, of another protocol.
  explicit RecordingReader(const std::string& path);

  /// The next one; false at the end.
  bool Next(Record& record);

  /// The file ends within a record: its writer was killed, or its disk was full.
  bool torn() const { return torn_; }

 private:
  bool Read(std::span<std::uint64_t> words);

  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::vector<std::uint64_t> words_;
  bool torn_ = false;
};

}  // namespace rikiseki::protocol
