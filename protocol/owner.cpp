// SPDX-License-Identifier: MIT
#include "protocol/owner.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>

#include "protocol/shared_object.h"

namespace rikiseki::protocol {
namespace {

// A frame's slot takes 16 KiB, so that blocks of later versions do not move the ring.
constexpr std::uint32_t kWorldFrameRoom = 16384 - sizeof(SlotHeader);
static_assert(kWorldFrameBytes <= kWorldFrameRoom);
constexpr std::uint32_t kMeshRoom = 64;  // meshes that world.scene can name

constexpr int kExitUsage = 64;
constexpr int kExitTemporary = 75;
constexpr int kExitConfig = 78;

std::uint64_t MonotonicNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000 +
         static_cast<std::uint64_t>(now.tv_nsec);
}

std::uint64_t RoundUp(std::uint64_t bytes, std::uint64_t multiple) {
  return (bytes + multiple - 1) / multiple * multiple;
}

void Store(std::uint64_t& word, std::uint64_t value, std::memory_order order) noexcept {
  std::atomic_ref<std::uint64_t>(word).store(value, order);
}

/// Makes a folder that only this user enters, or accepts one that is.
void MakePrivateFolder(const std::string& path) {
  if (mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) {
    throw SegmentError(kExitConfig,
                       "cannot make the runtime directory " + path + ": " + std::strerror(errno));
  }
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != geteuid()) {
    throw SegmentError(kExitConfig, "the runtime directory " + path +
                                        " is not a directory of this user; remove it or set "
                                        "RUNTIME_DIRECTORY");
  }
}

/// The file lock that makes a role exclusive. It goes with the process, however that ends.
class RoleLock {
 public:
  RoleLock(const std::string& folder, const std::string& instance, Role role) {
    MakePrivateFolder(folder);
    const std::string path = folder + "/rikiseki." + instance + "." + RoleName(role) + ".lock";
    descriptor_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (descriptor_ < 0) {
      throw SegmentError(kExitConfig,
                         "cannot open the lock file " + path + ": " + std::strerror(errno));
    }
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    if (fcntl(descriptor_, F_OFD_SETLK, &lock) != 0) {
      close(descriptor_);
      throw SegmentError(kExitTemporary, std::string("another process already is the ") +
                                             RoleName(role) + " side of instance '" + instance +
                                             "' (it holds " + path + ")");
    }
  }
  ~RoleLock() { close(descriptor_); }
  RoleLock(const RoleLock&) = delete;
  RoleLock& operator=(const RoleLock&) = delete;

 private:
  int descriptor_ = -1;
};

/// Puts the object of a dead predecessor out of the way. Returns its epoch, 0 if there was none.
std::uint64_t SupersedeOld(const std::string& name, std::vector<std::string>& notes) {
  const ObjectInfo info = StatObject(name);
  if (info.id == ObjectId{}) return 0;
  if (!info.regular) {
    throw SegmentError(kExitConfig,
                       "/dev/shm" + name + " is not a shared-memory object; remove it");
  }
  if (info.owner != geteuid()) {
    throw SegmentError(kExitConfig, "/dev/shm" + name + " belongs to user " +
                                        std::to_string(info.owner) +
                                        ": run as that user, have it removed, or choose another "
                                        "--instance");
  }
  std::uint64_t epoch = 0;
  try {
    const auto old = SharedObject::Open(name, true);
    if (old->OwnerLocked()) {
      throw SegmentError(kExitTemporary, "/dev/shm" + name +
                                             " is in use: its owner lives, with another runtime "
                                             "directory");
    }
    if (old->Info().bytes >= kHeaderBytes) {
      auto* const header = static_cast<SegmentHeader*>(old->Map(kHeaderBytes));
      if (header->magic == kMagic) {
        epoch = header->epoch;
        notes.push_back("superseded the segment that pid " + std::to_string(header->writer_pid) +
                        " left: state " + std::to_string(header->state) + ", tick " +
                        std::to_string(header->tick) + ", fault " +
                        std::to_string(header->fault_code) + ", overruns " +
                        std::to_string(header->overruns) + ", rejected " +
                        std::to_string(header->rejected));
        // SYNC: state. Tells those who still have the old object mapped.
        Store(header->state, static_cast<std::uint64_t>(SegmentState::kSuperseded),
              std::memory_order_release);
      }
    }
  } catch (const std::system_error& error) {
    notes.push_back("could not read the old segment: " + std::string(error.what()));
  }
  RemoveObject(name);
  return epoch;
}

struct Layout {
  std::vector<StreamEntry> entries;
  std::uint64_t bytes = 0;
};

Layout Arrange(const std::vector<StreamSpec>& streams) {
  if (streams.empty() || streams.size() > kMaxStreams) {
    throw SegmentError(kExitUsage, "a segment has 1 to 16 streams");
  }
  Layout layout;
  std::uint64_t cursor = kHeaderBytes;
  std::uint64_t ring = kHeaderBytes + kLineBytes * streams.size();
  for (const StreamSpec& spec : streams) {
    if (!std::has_single_bit(spec.slot_count) || spec.slot_count < kMinSlots ||
        spec.slot_count > kMaxSlots || spec.payload_bytes % 8 != 0) {
      throw SegmentError(kExitUsage, "stream " + std::to_string(static_cast<int>(spec.type)) +
                                         ": slots must be a power of two from 4 to 65536, the "
                                         "payload a multiple of 8");
    }
    StreamEntry entry{};
    entry.type_id = static_cast<std::uint32_t>(spec.type);
    entry.type_version = TypeVersion(spec.type);
    entry.cursor_offset = cursor;
    entry.ring_offset = ring;
    entry.slot_stride = static_cast<std::uint32_t>(
        RoundUp(sizeof(SlotHeader) + std::uint64_t{spec.payload_bytes}, kLineBytes));
    entry.slot_count = spec.slot_count;
    entry.payload_bytes = spec.payload_bytes;
    entry.period_ns = spec.period_ns;
    layout.entries.push_back(entry);
    cursor += kLineBytes;
    ring += std::uint64_t{entry.slot_stride} * entry.slot_count;
  }
  layout.bytes = RoundUp(ring, 4096);
  if (layout.bytes > kMaxSegmentBytes) {
    throw SegmentError(kExitConfig, "the segment would take " + std::to_string(layout.bytes) +
                                        " bytes, 16 MiB is the limit: lower the rate or the "
                                        "longest world period");
  }
  return layout;
}

}  // namespace

std::string SegmentName(const std::string& instance, Role role) {
  const bool plain = std::all_of(instance.begin(), instance.end(), [](unsigned char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
  if (!plain || instance.empty() || instance.size() > 64) {
    throw SegmentError(kExitUsage, "instance '" + instance + "' is not 1 to 64 of A-Z a-z 0-9 _ -");
  }
  return "/rikiseki." + instance + "." + RoleName(role);
}

const char* RoleName(Role role) noexcept {
  return role == Role::kHaptic ? "haptic" : "world";
}

std::uint32_t HapticTickSlots(std::uint64_t longest_world_period_ns, std::uint64_t latency_ns,
                              std::uint64_t period_ns) {
  const std::uint64_t ticks =
      (4 * (longest_world_period_ns + latency_ns) + period_ns - 1) / period_ns;
  return static_cast<std::uint32_t>(
      std::bit_ceil(std::clamp<std::uint64_t>(ticks, kMinSlots, kMaxSlots)));
}

std::vector<StreamSpec> HapticStreams(std::uint64_t period_ns, std::uint32_t tick_slots,
                                      std::uint64_t health_period_ns) {
  return {{StreamType::kHapticTick, kHapticTickBytes, tick_slots, period_ns},
          {StreamType::kHapticHealth, kHapticHealthBytes, kMinSlots, health_period_ns}};
}

std::vector<StreamSpec> WorldStreams(std::uint64_t period_ns, std::uint32_t bodies,
                                     std::uint64_t health_period_ns, std::uint32_t colliders) {
  const std::uint32_t body_room = std::min(bodies, kMaxBodies);
  const std::uint32_t collider_room = std::min(std::max(body_room, colliders), kMaxColliders);
  return {{StreamType::kWorldFrame, kWorldFrameRoom, 2 * kMinSlots, period_ns},
          {StreamType::kWorldHealth, kWorldHealthBytes, kMinSlots, health_period_ns},
          {StreamType::kWorldBodies, WorldBodiesBytes(body_room), kMinSlots, period_ns},
          {StreamType::kWorldScene, WorldSceneBytes(body_room, collider_room, kMeshRoom), kMinSlots,
           0}};
}

std::string RuntimeDirectory() {
  if (const char* given = std::getenv("RUNTIME_DIRECTORY"); given != nullptr && *given != '\0') {
    const std::string list = given;
    return list.substr(0, list.find(':'));
  }
  if (const char* session = std::getenv("XDG_RUNTIME_DIR");
      session != nullptr && *session != '\0') {
    return std::string(session) + "/haptics";
  }
  return "/tmp/rikiseki-" + std::to_string(geteuid());
}

struct SegmentOwner::Resources {
  RoleLock lock;
  std::unique_ptr<SharedObject> object;
  bool closed = false;
};

SegmentOwner::SegmentOwner(const OwnerOptions& options)
    : name_(SegmentName(options.instance, options.role)) {
  const Layout layout = Arrange(options.streams);
  const std::string folder =
      options.runtime_directory.empty() ? RuntimeDirectory() : options.runtime_directory;
  resources_.reset(new Resources{RoleLock(folder, options.instance, options.role), nullptr});
  const std::uint64_t old_epoch = SupersedeOld(name_, notes_);
  const std::uint64_t now = MonotonicNs();
  // A stale epoch from the future (another boot cannot be: /dev/shm went with it) is not believed
  // far.
  epoch_ = old_epoch >= now && old_epoch - now < 1'000'000'000 ? old_epoch + 1 : now;
  try {
    resources_->object = SharedObject::Create(name_, layout.bytes);
    header_ = static_cast<SegmentHeader*>(resources_->object->Map(layout.bytes));
  } catch (const std::system_error& error) {
    if (resources_->object != nullptr) RemoveObject(name_);
    if (error.code().value() == ENOSPC) {
      throw SegmentError(kExitTemporary, "/dev/shm is full: " + std::to_string(layout.bytes) +
                                             " bytes are needed for " + name_);
    }
    throw SegmentError(kExitTemporary, "cannot make " + name_ + ": " + error.what());
  }
  if (const std::string refusal = resources_->object->LockPages(); !refusal.empty()) {
    notes_.push_back("the segment's pages are not locked into memory: " + refusal);
  }
  if (!resources_->object->TakeOwnerLock()) {
    RemoveObject(name_);
    throw SegmentError(kExitTemporary, "somebody else locked " + name_ + " while it was made");
  }
  header_->magic = kMagic;
  header_->byte_order = kByteOrderMark;
  header_->version_major = kVersionMajor;
  header_->version_minor = kVersionMinor;
  header_->layout_hash = kLayoutHash;
  header_->header_bytes = kHeaderBytes;
  header_->stream_count = static_cast<std::uint32_t>(layout.entries.size());
  header_->segment_bytes = layout.bytes;
  header_->epoch = epoch_;
  header_->role = static_cast<std::uint32_t>(options.role);
  header_->writer_pid = static_cast<std::uint32_t>(getpid());
  options.build.copy(header_->build, sizeof header_->build - 1);
  header_->heartbeat_ns = now;
  std::copy(layout.entries.begin(), layout.entries.end(), header_->stream);
  // SYNC: state. Everything above is visible to whoever reads `ready`.
  Store(header_->state, static_cast<std::uint64_t>(SegmentState::kReady),
        std::memory_order_release);
}

SegmentOwner::~SegmentOwner() {
  Close();
}

StreamWriter SegmentOwner::Stream(StreamType type) const {
  for (std::uint32_t i = 0; i < header_->stream_count; ++i) {
    const StreamEntry& entry = header_->stream[i];
    if (entry.type_id != static_cast<std::uint32_t>(type)) continue;
    auto* const base = reinterpret_cast<unsigned char*>(header_);
    return StreamWriter({reinterpret_cast<std::uint64_t*>(base + entry.cursor_offset),
                         reinterpret_cast<std::uint64_t*>(base + entry.ring_offset),
                         entry.slot_stride, entry.slot_count, entry.payload_bytes});
  }
  throw std::out_of_range("the segment has no stream " + std::to_string(static_cast<int>(type)));
}

void SegmentOwner::Heartbeat(std::uint64_t tick, std::uint64_t now_ns) noexcept {
  Store(header_->tick, tick, std::memory_order_relaxed);
  Store(header_->heartbeat_ns, now_ns, std::memory_order_relaxed);
}

void SegmentOwner::SetFault(std::uint64_t code) noexcept {
  if (resources_->closed) return;
  Store(header_->fault_code, code, std::memory_order_relaxed);
  // SYNC: state. The code is visible to whoever reads `faulted`.
  Store(header_->state, static_cast<std::uint64_t>(SegmentState::kFaulted),
        std::memory_order_release);
}

void SegmentOwner::ClearFault() noexcept {
  if (resources_->closed) return;
  Store(header_->fault_code, 0, std::memory_order_relaxed);
  Store(header_->state, static_cast<std::uint64_t>(SegmentState::kReady),
        std::memory_order_release);
}

void SegmentOwner::SetCounters(const HealthCounters& counters) noexcept {
  Store(header_->overruns, counters.overruns, std::memory_order_relaxed);
  Store(header_->lapped, counters.lapped, std::memory_order_relaxed);
  Store(header_->read_retries, counters.read_retries, std::memory_order_relaxed);
  Store(header_->rejected, counters.rejected, std::memory_order_relaxed);
  Store(header_->gaps, counters.gaps, std::memory_order_relaxed);
}

void SegmentOwner::Close() noexcept {
  if (resources_->closed) return;
  resources_->closed = true;
  // SYNC: state. Every message published before is visible to whoever reads `closed`.
  Store(header_->state, static_cast<std::uint64_t>(SegmentState::kClosed),
        std::memory_order_release);
  if (StatObject(name_).id == resources_->object->Info().id) RemoveObject(name_);
}

}  // namespace rikiseki::protocol
