// SPDX-License-Identifier: MIT
#include "protocol/tools/check/played_segment.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <stdexcept>

#include "common/clock.h"
#include "protocol/layout.h"

namespace rikiseki::protocol::check {
namespace {

std::uint64_t RoundUp(std::uint64_t bytes, std::uint64_t multiple) {
  return (bytes + multiple - 1) / multiple * multiple;
}

void Store(std::uint64_t& word, std::uint64_t value, std::memory_order order) {
  std::atomic_ref<std::uint64_t>(word).store(value, order);
}

OwnerOptions KeeperOptions(const std::string& instance, Role role, const std::string& folder) {
  OwnerOptions options;
  options.instance = instance;
  options.role = role;
  options.streams = role == Role::kWorld ? WorldStreams(20'000'000, 1, 0)
                                         : HapticStreams(1'000'000, kMinSlots, 0);
  options.build = "protocol_check";
  options.runtime_directory = folder;
  return options;
}

struct TextSink {
  std::string text;
  void operator()(char character) { text += character; }
};

const std::string& LayoutText() {
  static const std::string text = [] {
    TextSink sink;
    WriteLayout(sink);
    return sink.text;
  }();
  return text;
}

}  // namespace

RoleHolder::RoleHolder(const std::string& instance, Role role, const std::string& runtime_directory)
    : keeper_(KeeperOptions(instance, role, runtime_directory)), last_epoch_(keeper_.epoch()) {
  keeper_.Close();
}

std::uint64_t RoleHolder::NextEpoch() {
  last_epoch_ = std::max(last_epoch_ + 1, static_cast<std::uint64_t>(MonotonicNow()));
  return last_epoch_;
}

PlayedSegment::PlayedSegment(const SegmentScript& script)
    : name_(SegmentName(script.instance, script.role)), epoch_(script.epoch) {
  std::uint64_t cursor = kHeaderBytes;
  std::uint64_t ring = kHeaderBytes + kLineBytes * script.streams.size();
  for (const StreamSpec& spec : script.streams) {
    StreamEntry entry{};
    entry.type_id = static_cast<std::uint32_t>(spec.type);
    entry.type_version = TypeVersion(spec.type);
    entry.cursor_offset = cursor;
    entry.ring_offset = ring;
    entry.slot_stride =
        static_cast<std::uint32_t>(RoundUp(sizeof(SlotHeader) + spec.payload_bytes, kLineBytes));
    entry.slot_count = spec.slot_count;
    entry.payload_bytes = spec.payload_bytes;
    entry.period_ns = spec.period_ns;
    entries_.push_back(entry);
    cursor += kLineBytes;
    ring += std::uint64_t{entry.slot_stride} * entry.slot_count;
  }
  const std::uint64_t bytes = RoundUp(ring, 4096);
  RemoveObject(name_);
  object_ = SharedObject::Create(name_, bytes);
  header_ = static_cast<SegmentHeader*>(object_->Map(bytes));
  id_ = object_->Info().id;
  if (!object_->TakeOwnerLock()) throw std::runtime_error("cannot lock " + name_);
  header_->magic = kMagic;
  header_->byte_order = kByteOrderMark;
  header_->version_major = kVersionMajor;
  header_->version_minor = kVersionMinor;
  header_->layout_hash = kLayoutHash;
  header_->header_bytes = kHeaderBytes;
  header_->stream_count = static_cast<std::uint32_t>(entries_.size());
  header_->segment_bytes = bytes;
  header_->epoch = epoch_;
  header_->role = static_cast<std::uint32_t>(script.role);
  header_->writer_pid = static_cast<std::uint32_t>(getpid());
  std::strncpy(header_->build, "protocol_check", sizeof header_->build - 1);
  header_->heartbeat_ns = static_cast<std::uint64_t>(MonotonicNow());
  std::copy(entries_.begin(), entries_.end(), header_->stream);
  if (script.alter) script.alter(*header_);
  SetState(script.state);
}

PlayedSegment::~PlayedSegment() {
  Die();
  if (StatObject(name_).id == id_) RemoveObject(name_);
}

Ring PlayedSegment::RingOf(StreamType type) const {
  for (const StreamEntry& entry : entries_) {
    if (entry.type_id != static_cast<std::uint32_t>(type)) continue;
    auto* const base = reinterpret_cast<unsigned char*>(header_);
    return {reinterpret_cast<std::uint64_t*>(base + entry.cursor_offset),
            reinterpret_cast<std::uint64_t*>(base + entry.ring_offset), entry.slot_stride,
            entry.slot_count, entry.payload_bytes};
  }
  throw std::out_of_range("no such stream");
}

void PlayedSegment::Heartbeat(std::uint64_t tick, std::uint64_t now_ns) {
  Store(header_->tick, tick, std::memory_order_relaxed);
  Store(header_->heartbeat_ns, now_ns, std::memory_order_relaxed);
}

void PlayedSegment::SetState(SegmentState state) {
  // SYNC: state.
  Store(header_->state, static_cast<std::uint64_t>(state), std::memory_order_release);
}

void PlayedSegment::CountRejected(std::uint64_t total) {
  Store(header_->rejected, total, std::memory_order_relaxed);
}

void PlayedSegment::Close() {
  if (ended_) return;
  SetState(SegmentState::kClosed);
  if (StatObject(name_).id == id_) RemoveObject(name_);
  Die();
}

void PlayedSegment::Die() {
  ended_ = true;
  header_ = nullptr;
  object_.reset();
}

void RawWriter::Publish(std::span<const std::uint64_t> payload, Encoded shape,
                        std::uint64_t stamp_ns) {
  ++published_;
  const std::uint64_t* const shape_word = &ring_.Slot(published_)[kShapeWord];
  PublishStores(ring_, published_, payload, shape.blocks, stamp_ns,
                [&](std::uint64_t& word, std::uint64_t value, std::memory_order order) {
                  if (&word == shape_word) {
                    value = shape.used_bytes | static_cast<std::uint64_t>(shape.blocks) << 32;
                  }
                  Store(word, value, order);
                });
}

void RawWriter::PublishPartly(std::span<const std::uint64_t> payload, Encoded shape,
                              std::size_t missing) {
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  std::size_t stores = 0;
  PublishStores(ring_, published_ + 1, payload, shape.blocks, now,
                [&stores](std::uint64_t&, std::uint64_t, std::memory_order) { ++stores; });
  PublishStores(ring_, published_ + 1, payload, shape.blocks, now,
                [&](std::uint64_t& word, std::uint64_t value, std::memory_order order) {
                  if (stores > missing) Store(word, value, order);
                  --stores;
                });
}

void RawWriter::SetPublished(std::uint64_t number) {
  published_ = number;
  Store(*ring_.published, number, std::memory_order_release);
}

std::size_t FieldOffset(std::string_view record, std::string_view field) {
  const std::string key = "\n" + std::string(record) + "." + std::string(field) + ":";
  const std::string text = "\n" + LayoutText();
  const std::size_t line = text.find(key);
  if (line == std::string::npos) throw std::out_of_range("no field " + key.substr(1));
  return std::stoul(text.substr(text.find(':', line + key.size()) + 1));
}

std::size_t RecordBytes(std::string_view record) {
  const std::string key = "\n" + std::string(record) + ".";
  const std::string text = "\n" + LayoutText();
  std::size_t bytes = 0;
  for (std::size_t line = text.find(key); line != std::string::npos;
       line = text.find(key, line + 1)) {
    const std::size_t type = text.find(':', line);
    const std::size_t offset = text.find(':', type + 1);
    const std::size_t size = text.find(':', offset + 1);
    bytes = std::max<std::size_t>(
        bytes, std::stoul(text.substr(offset + 1)) + std::stoul(text.substr(size + 1)));
  }
  return bytes;
}

template <typename T>
void Poke(std::span<std::uint64_t> words, std::size_t offset, T value) {
  std::memcpy(reinterpret_cast<unsigned char*>(words.data()) + offset, &value, sizeof value);
}
template void Poke(std::span<std::uint64_t>, std::size_t, std::uint32_t);
template void Poke(std::span<std::uint64_t>, std::size_t, std::uint64_t);
template void Poke(std::span<std::uint64_t>, std::size_t, double);

}  // namespace rikiseki::protocol::check
