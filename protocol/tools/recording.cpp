// SPDX-License-Identifier: MIT
#include "protocol/tools/recording.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>

#include "protocol/layout.h"
#include "protocol/version.h"

namespace rikiseki::protocol {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint64_t kMagicWord = 0x44524F4345524B52;  // "RKRECORD"
constexpr std::uint64_t kFormat = 1;
constexpr std::size_t kHeadWords = 5;                 // before a payload
constexpr std::uint64_t kLargestPayload = 16U << 20;  // bytes, of a segment

constexpr std::uint64_t Version() {
  return std::uint64_t{kVersionMajor} << 32 | kVersionMinor;
}

constexpr std::array<std::uint64_t, 4> kHeader{kMagicWord, kFormat, Version(), kLayoutHash};

}  // namespace

RecordingWriter::RecordingWriter(const std::string& path) : path_(path) {
  file_ = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file_ < 0) throw RecordingError(path + ": " + std::strerror(errno));
  pending_.assign(kHeader.begin(), kHeader.end());
  ends_.push_back(pending_.size());
  Flush(false);
}

RecordingWriter::~RecordingWriter() {
  close(file_);
}

void RecordingWriter::Add(const Record& record) {
  const std::array<std::uint64_t, kHeadWords> head{
      static_cast<std::uint64_t>(record.type) | std::uint64_t{record.received.blocks} << 32,
      record.received.used_bytes, record.epoch, record.received.number, record.received.stamp_ns};
  pending_.insert(pending_.end(), head.begin(), head.end());
  pending_.insert(pending_.end(), record.words.begin(), record.words.end());
  ends_.push_back(pending_.size());
}

void RecordingWriter::Flush(bool durable) {
  const auto bytes = std::as_bytes(std::span(pending_));
  std::size_t done = 0;
  int error = 0;
  while (done < bytes.size() && error == 0) {
    const ssize_t written = write(file_, bytes.data() + done, bytes.size() - done);
    if (written >= 0) {
      done += static_cast<std::size_t>(written);
    } else if (errno != EINTR) {
      error = errno;
    }
  }
  if (error == 0 && durable && fdatasync(file_) != 0) error = errno;
  if (error == 0) {
    bytes_ += bytes.size();
    pending_.clear();
    ends_.clear();
    return;
  }
  // What is whole stays.
  std::size_t whole = 0;
  for (const std::size_t end : ends_) {
    if (end * sizeof(std::uint64_t) <= done) whole = end * sizeof(std::uint64_t);
  }
  pending_.clear();
  ends_.clear();
  bytes_ += whole;
  (void)!ftruncate(file_, static_cast<off_t>(bytes_));
  throw RecordingError(path_ + ": " + std::strerror(error) + "; it holds what was recorded before");
}

RecordingReader::RecordingReader(const std::string& path)
    : file_(std::fopen(path.c_str(), "rbe"), &std::fclose) {
  if (file_ == nullptr) throw RecordingError(path + ": " + std::strerror(errno));
  std::array<std::uint64_t, kHeader.size()> header{};
  if (!Read(header) || header[0] != kMagicWord) {
    throw RecordingError(path + ": no recording of haptic_log");
  }
  if (header != kHeader) {
    throw RecordingError(path + ": recorded with protocol " + std::to_string(header[2] >> 32) +
                         "." + std::to_string(header[2] & 0xFFFFFFFF) + ", this program reads " +
                         std::to_string(kVersionMajor) + "." + std::to_string(kVersionMinor));
  }
  torn_ = false;
}

// False at the end; part of what was asked for is a torn end.
bool RecordingReader::Read(std::span<std::uint64_t> words) {
  const std::size_t got = std::fread(words.data(), 1, words.size_bytes(), file_.get());
  if (got == words.size_bytes()) return true;
  torn_ = got > 0;
  return false;
}

bool RecordingReader::Next(Record& record) {
  std::array<std::uint64_t, kHeadWords> head{};
  if (torn_ || !Read(head)) return false;
  const std::uint64_t bytes = head[1];
  if (bytes % 8 != 0 || bytes > kLargestPayload) {
    torn_ = true;
    return false;
  }
  words_.resize(bytes / 8);
  if (!Read(words_)) {
    torn_ = true;
    return false;
  }
  record.type = static_cast<StreamType>(head[0] & 0xFFFFFFFF);
  record.epoch = head[2];
  record.received = {.number = head[3],
                     .stamp_ns = head[4],
                     .used_bytes = static_cast<std::uint32_t>(bytes),
                     .blocks = static_cast<std::uint32_t>(head[0] >> 32)};
  record.words = words_;
  return true;
}

}  // namespace rikiseki::protocol
