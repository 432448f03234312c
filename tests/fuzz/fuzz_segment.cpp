// SPDX-License-Identifier: MIT
// Bytes -> attach -> read, through a real shared-memory object and the shipped Attach. Whatever the
// object holds: no fault, and what is accepted lies inside it.
//
// Input: u8 wishes, then the bytes of the object. Wish 1: the fields that a random change would
// always break (magic, version, hash, ..., state) are set right, so that what lies behind them is
// reached. Wish 2: the object's size is not that of the input but a page more.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/stream.h"
#include "protocol/version.h"

namespace {

using namespace rikiseki::protocol;  // NOLINT(google-build-using-namespace)

constexpr std::size_t kMostBytes = 1 << 18;

void Require(bool condition) {
  if (!condition) std::abort();
}

/// One object per role and process, locked by an owner: this process, through a descriptor of its
/// own.
class Object {
 public:
  explicit Object(Role role) : instance_("fuzz-" + std::to_string(getpid())), role_(role) {
    name_ = SegmentName(instance_, role);
    shm_unlink(name_.c_str());
    descriptor_ = shm_open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL, 0640);
    Require(descriptor_ >= 0 && ftruncate(descriptor_, kMostBytes) == 0);
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    lock.l_len = 1;
    Require(fcntl(descriptor_, F_OFD_SETLK, &lock) == 0);
    map_ = static_cast<unsigned char*>(
        mmap(nullptr, kMostBytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0));
    Require(map_ != MAP_FAILED);
  }
  ~Object() { shm_unlink(name_.c_str()); }
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;

  void Fill(const std::uint8_t* data, std::size_t size, std::size_t object_bytes) {
    Require(ftruncate(descriptor_, static_cast<off_t>(object_bytes)) == 0);
    std::memcpy(map_, data, size);
    std::memset(map_ + size, 0, object_bytes - size);
  }
  SegmentHeader* header() { return reinterpret_cast<SegmentHeader*>(map_); }

  AttachRequest Request() const {
    AttachRequest request;
    request.instance = instance_;
    request.role = role_;
    request.owners = {geteuid()};
    return request;
  }

 private:
  std::string instance_;
  Role role_;
  std::string name_;
  int descriptor_ = -1;
  unsigned char* map_ = nullptr;
};

template <typename Message>
void ReadAll(const PeerView& view) {
  static Message message;
  auto latest = view.Reader<Message>();
  auto next = view.Reader<Message>();
  for (int i = 0; i < 3; ++i) latest.ReadLatest(message, 1'000'000'000);
  for (int i = 0; i < 12; ++i) next.ReadNext(message, 1'000'000'000);
}

void ReadEverything(const PeerView& view) {
  ReadAll<HapticTick>(view);
  ReadAll<HapticHealth>(view);
  ReadAll<WorldFrame>(view);
  ReadAll<WorldHealth>(view);
  if (view.Has(StreamType::kWorldScene)) {
    SceneReader scenes(view.Stream(StreamType::kWorldScene));
    scenes.ReadLatest();
  }
  if (view.Has(StreamType::kWorldBodies)) {
    StreamReader bodies = view.Stream(StreamType::kWorldBodies);
    std::vector<std::uint64_t> words(std::min<std::size_t>(bodies.payload_bytes() / 8, 4096));
    static std::vector<Body> decoded(kMaxBodies);
    Received received;
    if (bodies.ReadLatest(words, received) == ReadStatus::kFresh) {
      std::uint32_t count = 0;
      Decode(words, {received.used_bytes, received.blocks}, decoded, count);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Object haptic(Role::kHaptic);
  static Object world(Role::kWorld);
  if (size < 1 || size - 1 > kMostBytes - 4096) return 0;
  const std::uint8_t wishes = data[0];
  ++data;
  --size;
  std::uint32_t role = 1;
  if (size >= sizeof(SegmentHeader)) {
    std::memcpy(&role, data + offsetof(SegmentHeader, role), sizeof role);
  }
  Object& object = role == 2 ? world : haptic;
  const std::size_t object_bytes = size + ((wishes & 2) != 0 ? 4096 : 0);
  object.Fill(data, size, object_bytes);
  if ((wishes & 1) != 0 && size >= sizeof(SegmentHeader)) {
    SegmentHeader& header = *object.header();
    header.magic = kMagic;
    header.byte_order = kByteOrderMark;
    header.version_major = kVersionMajor;
    header.version_minor = kVersionMinor;
    header.layout_hash = kLayoutHash;
    header.header_bytes = kHeaderBytes;
    header.role = role == 2 ? 2 : 1;
    header.epoch = std::max<std::uint64_t>(header.epoch, 1);
    header.state = static_cast<std::uint64_t>(SegmentState::kReady);
  }
  const AttachResult result = Attach(object.Request());
  Require(result.view == nullptr || result.status == AttachStatus::kAttached);
  Require(result.view != nullptr || !result.text.empty());
  if (result.view != nullptr) {
    Require(result.view->header().segment_bytes <= object_bytes);
    ReadEverything(*result.view);
  }
  return 0;
}
