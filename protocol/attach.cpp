// SPDX-License-Identifier: MIT
#include "protocol/attach.h"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace rikiseki::protocol {
namespace {

std::uint64_t Load(std::uint64_t& word, std::memory_order order) noexcept {
  return std::atomic_ref<std::uint64_t>(word).load(order);
}

std::string Differs(const std::string& field, std::uint64_t theirs, std::uint64_t ours) {
  return field + " is " + std::to_string(theirs) + ", this program knows " + std::to_string(ours);
}

std::string Hex(std::uint64_t value) {
  std::string text(16, '0');
  for (std::size_t i = 16; i-- > 0; value >>= 4) text[i] = "0123456789abcdef"[value & 15];
  return text;
}

/// A stretch of the segment that one stream needs for itself.
struct Extent {
  std::uint64_t begin;
  std::uint64_t end;
};

/// The first wrong field of one directory entry, or empty. What it occupies is appended to
/// `extents`.
std::string CheckEntry(const StreamEntry& entry, std::uint64_t segment_bytes,
                       std::vector<Extent>& extents) {
  if (entry.type_id == 0) return "type_id is 0";
  if (entry.slot_stride == 0 || entry.slot_stride % kLineBytes != 0) {
    return "slot_stride is no multiple of 128";
  }
  if (!std::has_single_bit(entry.slot_count) || entry.slot_count < kMinSlots ||
      entry.slot_count > kMaxSlots) {
    return "slot_count is no power of two from 4 to 65536";
  }
  if (entry.payload_bytes % 8 != 0 ||
      entry.payload_bytes > entry.slot_stride - sizeof(SlotHeader)) {
    return "payload_bytes is no multiple of 8 that fits a slot";
  }
  const std::uint64_t ring_bytes = std::uint64_t{entry.slot_stride} * entry.slot_count;
  const auto inside = [&](std::uint64_t offset, std::uint64_t bytes) {
    return offset >= kHeaderBytes && offset <= segment_bytes && bytes <= segment_bytes - offset;
  };
  if (entry.cursor_offset % kLineBytes != 0 || !inside(entry.cursor_offset, kLineBytes)) {
    return "cursor_offset is not an aligned place inside the segment";
  }
  if (entry.ring_offset % kLineBytes != 0 || !inside(entry.ring_offset, ring_bytes)) {
    return "ring_offset is not an aligned place inside the segment";
  }
  const Extent cursor{entry.cursor_offset, entry.cursor_offset + kLineBytes};
  const Extent ring{entry.ring_offset, entry.ring_offset + ring_bytes};
  const auto taken = [&extents](const Extent& extent) {
    return std::any_of(extents.begin(), extents.end(), [&extent](const Extent& other) {
      return extent.begin < other.end && other.begin < extent.end;
    });
  };
  if (taken(cursor)) return "cursor_offset overlaps another stream";
  extents.push_back(cursor);
  if (taken(ring)) return "ring_offset overlaps a counter or another stream";
  extents.push_back(ring);
  return {};
}

/// The first requirement that the directory does not meet, or empty.
std::string CheckRequired(const SegmentHeader& header,
                          const std::vector<StreamRequirement>& required) {
  for (const StreamRequirement& need : required) {
    const auto* const end = header.stream + header.stream_count;
    const auto* const found = std::find_if(header.stream, end, [&](const StreamEntry& entry) {
      return entry.type_id == static_cast<std::uint32_t>(need.type);
    });
    const std::string name = "stream type " + std::to_string(static_cast<std::uint32_t>(need.type));
    if (found == end) return name + " is missing";
    if (found->type_version < need.min_version) {
      return name + ": type_version is " + std::to_string(found->type_version) + ", needed is " +
             std::to_string(need.min_version);
    }
    const std::uint64_t period_ns = std::min<std::uint64_t>(found->period_ns, 10'000'000'000);
    if (found->slot_count * period_ns < need.min_history_ns) {
      return name + ": slot_count " + std::to_string(found->slot_count) + " holds " +
             std::to_string(found->slot_count * period_ns / 1'000'000) + " ms, needed are " +
             std::to_string(need.min_history_ns / 1'000'000) + " ms";
    }
  }
  return {};
}

}  // namespace

struct PeerView::Mapped {
  std::unique_ptr<SharedObject> object;
  SegmentHeader* header = nullptr;  // in shared memory: atomic access to its changing words only
};

PeerView::PeerView() : mapped_(std::make_unique<Mapped>()) {}
PeerView::~PeerView() = default;

SegmentState PeerView::State() const noexcept {
  // SYNC: state. What the owner wrote before it said so is visible.
  return static_cast<SegmentState>(Load(mapped_->header->state, std::memory_order_acquire));
}
std::uint64_t PeerView::HeartbeatNs() const noexcept {
  return Load(mapped_->header->heartbeat_ns, std::memory_order_relaxed);
}
std::uint64_t PeerView::Tick() const noexcept {
  return Load(mapped_->header->tick, std::memory_order_relaxed);
}
std::uint64_t PeerView::FaultCode() const noexcept {
  return Load(mapped_->header->fault_code, std::memory_order_relaxed);
}
HealthCounters PeerView::Counters() const noexcept {
  SegmentHeader& header = *mapped_->header;
  return {Load(header.overruns, std::memory_order_relaxed),
          Load(header.lapped, std::memory_order_relaxed),
          Load(header.read_retries, std::memory_order_relaxed),
          Load(header.rejected, std::memory_order_relaxed),
          Load(header.gaps, std::memory_order_relaxed)};
}

const StreamEntry* PeerView::Find(StreamType type) const noexcept {
  for (std::uint32_t i = 0; i < header_.stream_count; ++i) {
    if (header_.stream[i].type_id == static_cast<std::uint32_t>(type)) return &header_.stream[i];
  }
  return nullptr;
}

bool PeerView::Has(StreamType type) const noexcept {
  return Find(type) != nullptr;
}

std::uint64_t PeerView::PeriodNs(StreamType type) const noexcept {
  const StreamEntry* const entry = Find(type);
  return entry == nullptr ? 0 : entry->period_ns;
}

StreamReader PeerView::Stream(StreamType type) const noexcept {
  const StreamEntry* const entry = Find(type);
  if (entry == nullptr) return {};
  auto* const base = reinterpret_cast<unsigned char*>(mapped_->header);
  return StreamReader({reinterpret_cast<std::uint64_t*>(base + entry->cursor_offset),
                       reinterpret_cast<std::uint64_t*>(base + entry->ring_offset),
                       entry->slot_stride, entry->slot_count, entry->payload_bytes});
}

bool PeerView::OwnerAlive() const noexcept {
  return mapped_->object->OwnerLocked();
}
bool PeerView::IsCurrent() const noexcept {
  return StatObject(name_).id == object_;
}

std::vector<uid_t> DefaultOwners() {
  std::vector<uid_t> owners{geteuid(), 0};
  for (const char* user : {"haptics-device", "haptics-world"}) {
    passwd entry{};
    passwd* found = nullptr;
    std::vector<char> text(16384);
    if (getpwnam_r(user, &entry, text.data(), text.size(), &found) == 0 && found != nullptr) {
      owners.push_back(entry.pw_uid);
    }
  }
  return owners;
}

std::string CompareVersion(std::uint16_t their_major, std::uint16_t their_minor,
                           std::uint64_t their_hash, std::uint16_t our_major,
                           std::uint16_t our_minor, std::uint64_t our_hash) {
  if (their_major != our_major) return Differs("version_major", their_major, our_major);
  if (their_minor == our_minor && their_hash != our_hash) {
    return "layout_hash is " + Hex(their_hash) + ", this program knows " + Hex(our_hash) +
           " at the same version: the layout was changed without raising it";
  }
  return {};
}

std::string CheckHeader(const SegmentHeader& header, std::uint64_t object_bytes, Role role) {
  if (header.magic != kMagic) return "magic is not RIKISEKI";
  if (header.byte_order != kByteOrderMark) return "byte_order is not little-endian";
  if (std::string differs =
          CompareVersion(header.version_major, header.version_minor, header.layout_hash,
                         kVersionMajor, kVersionMinor, kLayoutHash);
      !differs.empty()) {
    return differs;
  }
  if (header.header_bytes != kHeaderBytes) {
    return Differs("header_bytes", header.header_bytes, kHeaderBytes);
  }
  if (header.role != static_cast<std::uint32_t>(role)) {
    return Differs("role", header.role, static_cast<std::uint32_t>(role));
  }
  if (header.epoch == 0) return "epoch is 0";
  if (header.segment_bytes < kHeaderBytes || header.segment_bytes > object_bytes) {
    return "segment_bytes is " + std::to_string(header.segment_bytes) + ", the object has " +
           std::to_string(object_bytes);
  }
  if (header.stream_count == 0 || header.stream_count > kMaxStreams) {
    return "stream_count is " + std::to_string(header.stream_count) + ", not 1 to 16";
  }
  std::vector<Extent> extents;
  for (std::uint32_t i = 0; i < header.stream_count; ++i) {
    const StreamEntry& entry = header.stream[i];
    const std::string place = "stream[" + std::to_string(i) + "].";
    for (std::uint32_t j = 0; j < i; ++j) {
      if (header.stream[j].type_id == entry.type_id) return place + "type_id stands twice";
    }
    if (const std::string wrong = CheckEntry(entry, header.segment_bytes, extents);
        !wrong.empty()) {
      return place + wrong;
    }
  }
  return {};
}

/// One attempt, step by step.
struct Attachment {
  const AttachRequest& request;
  std::string name;
  AttachResult result;

  AttachResult Fail(AttachStatus status, const std::string& why) {
    result.status = status;
    result.text = name.substr(1) + ": " + why;
    result.view.reset();
    return std::move(result);
  }

  AttachResult Run() {
    const ObjectInfo named = StatObject(name);
    result.object = named.id;
    if (named.id == ObjectId{}) return Fail(AttachStatus::kAbsent, "there is no such segment");
    if (!named.regular) return Fail(AttachStatus::kForbidden, "it is not a regular object");
    std::unique_ptr<SharedObject> object;
    try {
      object = SharedObject::Open(name, false);
    } catch (const std::system_error& error) {
      if (error.code().value() == ENOENT) return Fail(AttachStatus::kAbsent, "it has just gone");
      return Fail(AttachStatus::kForbidden, std::string("it may not be read: ") + error.what() +
                                                " (is this user in the group haptics?)");
    }
    const ObjectInfo info = object->Info();
    result.object = info.id;
    const std::vector<uid_t> owners = request.owners.empty() ? DefaultOwners() : request.owners;
    if (!info.regular) return Fail(AttachStatus::kForbidden, "it is not a regular object");
    if (std::find(owners.begin(), owners.end(), info.owner) == owners.end()) {
      return Fail(AttachStatus::kForbidden,
                  "its owner, user " + std::to_string(info.owner) + ", may not own a segment");
    }
    if (info.bytes == 0) return Fail(AttachStatus::kNotReady, "it has no memory yet");
    if (info.bytes < kHeaderBytes || info.bytes > kMaxSegmentBytes) {
      return Fail(AttachStatus::kIncompatible,
                  "its size is " + std::to_string(info.bytes) + ", not 4096 bytes to 16 MiB");
    }
    return Examine(std::move(object), info);
  }

  AttachResult Examine(std::unique_ptr<SharedObject> object, const ObjectInfo& info) {
    std::unique_ptr<PeerView> view(new PeerView);
    try {
      view->mapped_->header = static_cast<SegmentHeader*>(object->Map(info.bytes));
    } catch (const std::system_error& error) {
      return Fail(AttachStatus::kForbidden, std::string("it cannot be mapped: ") + error.what());
    }
    view->mapped_->object = std::move(object);
    const SegmentState state = view->State();
    switch (state) {
      case SegmentState::kInitialising:
        return Fail(AttachStatus::kNotReady, "its owner is still filling it");
      case SegmentState::kClosed:
      case SegmentState::kSuperseded:
        return Fail(AttachStatus::kOwnerGone, "its owner has closed it");
      case SegmentState::kReady:
      case SegmentState::kFaulted:
        break;
      default:
        return Fail(
            AttachStatus::kIncompatible,
            "state is " + std::to_string(static_cast<std::uint64_t>(state)) + ", not 0 to 4");
    }
    // Copied once, word by word, then checked: the copy cannot change under the checks.
    auto* const shared = reinterpret_cast<std::uint64_t*>(view->mapped_->header);
    std::array<std::uint64_t, kHeaderBytes / 8> words;
    for (std::size_t i = 0; i < words.size(); ++i) {
      words[i] = Load(shared[i], std::memory_order_relaxed);
    }
    view->header_ = std::bit_cast<SegmentHeader>(words);
    std::string wrong = CheckHeader(view->header_, info.bytes, request.role);
    if (wrong.empty()) wrong = CheckRequired(view->header_, request.required);
    if (!wrong.empty()) return Fail(AttachStatus::kIncompatible, wrong);
    if (!view->mapped_->object->OwnerLocked()) {
      return Fail(AttachStatus::kOwnerGone, "its owner has died");
    }
    if (const std::string refusal = view->mapped_->object->LockPages(); !refusal.empty()) {
      view->note_ = "its pages are not locked into memory: " + refusal;
    }
    view->name_ = name;
    view->object_ = info.id;
    result.status = AttachStatus::kAttached;
    result.text = name.substr(1) + ": attached, epoch " + std::to_string(view->epoch()) + ", pid " +
                  std::to_string(view->header_.writer_pid);
    result.view = std::move(view);
    return std::move(result);
  }
};

AttachResult Attach(const AttachRequest& request) {
  return Attachment{request, SegmentName(request.instance, request.role), {}}.Run();
}

}  // namespace rikiseki::protocol
