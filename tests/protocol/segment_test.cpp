// SPDX-License-Identifier: MIT
// Owner and attach together: the life of a segment within one process, and every kind of hostile
// shape.
#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <functional>
#include <memory>
#include <random>

#include "protocol/attach.h"
#include "protocol/owner.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::FreshInstance;
using test::HapticOptions;
using test::TemporaryFolder;

AttachRequest Asking(const std::string& instance, Role role = Role::kHaptic) {
  AttachRequest request;
  request.instance = instance;
  request.role = role;
  return request;
}

int ExitCodeOf(const OwnerOptions& options, std::string* text = nullptr) {
  try {
    SegmentOwner owner(options);
  } catch (const SegmentError& error) {
    if (text != nullptr) *text = error.what();
    return error.exit_code();
  }
  return 0;
}

TEST_CASE("a segment is attached with all its streams, and messages pass") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  AttachRequest request = Asking(instance);
  request.required = {{StreamType::kHapticTick, 1, 16'000'000}, {StreamType::kHapticHealth}};
  const AttachResult result = Attach(request);
  INFO(result.text);
  REQUIRE(result.status == AttachStatus::kAttached);
  PeerView& view = *result.view;
  CHECK(view.epoch() == owner.epoch());
  CHECK(view.Ready());
  CHECK(view.OwnerAlive());
  CHECK(view.IsCurrent());
  CHECK(view.PeriodNs(StreamType::kHapticTick) == 1'000'000);
  CHECK_FALSE(view.Has(StreamType::kWorldFrame));
  CHECK(std::string(view.header().build) == "test");

  auto writer = owner.Writer<HapticTick>();
  auto reader = view.Reader<HapticTick>();
  HapticTick got;
  CHECK(reader.ReadLatest(got) == ReadStatus::kEmpty);
  for (std::uint64_t n = 1; n < 40; ++n) {
    REQUIRE(writer.Publish(test::Numbered(n), 1000 + n));
    REQUIRE(reader.ReadNext(got) == ReadStatus::kFresh);
    REQUIRE(got.tick == n);
    REQUIRE(test::IsNumbered(got));
    REQUIRE(reader.received().stamp_ns == 1000 + n);
  }
  owner.Heartbeat(7, 77);
  CHECK(view.Tick() == 7);
  CHECK(view.HeartbeatNs() == 77);
  owner.SetCounters({1, 2, 3, 4, 5});
  CHECK(view.Counters().overruns == 1);
  CHECK(view.Counters().gaps == 5);
  StreamReader absent = view.Stream(StreamType::kWorldFrame);
  Received received;
  CHECK(absent.ReadLatest({}, received) == ReadStatus::kEmpty);
  CHECK_THROWS_AS(owner.Stream(StreamType::kWorldFrame), std::out_of_range);
}

TEST_CASE("a world segment carries frames and bodies") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  OwnerOptions options = HapticOptions(instance, folder.path());
  options.role = Role::kWorld;
  options.streams = WorldStreams(50'000'000, 3, 100'000'000);
  SegmentOwner owner(options);
  const AttachResult result = Attach(Asking(instance, Role::kWorld));
  INFO(result.text);
  REQUIRE(result.status == AttachStatus::kAttached);
  test::Generator generator(1);
  std::vector<Body> bodies(4);
  for (Body& body : bodies) body = generator.OneBody();
  BodiesWriter writer(owner.Stream(StreamType::kWorldBodies));
  BodiesReader reader(result.view->Stream(StreamType::kWorldBodies));
  CHECK_FALSE(writer.Publish(bodies, 5));  // made for three
  bodies.pop_back();
  CHECK(reader.ReadLatest() == ReadStatus::kEmpty);
  REQUIRE(writer.Publish(bodies, 5));
  REQUIRE(reader.ReadLatest() == ReadStatus::kFresh);
  REQUIRE(reader.bodies().size() == 3);
  CHECK(std::memcmp(reader.bodies().data(), bodies.data(), 3 * sizeof(Body)) == 0);
  CHECK(reader.received().stamp_ns == 5);
}

TEST_CASE("a clean close is seen at once, and the name is free") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  auto owner = std::make_unique<SegmentOwner>(HapticOptions(instance, folder.path()));
  auto writer = owner->Writer<HapticTick>();
  writer.Publish(test::Numbered(1), 1);
  const AttachResult result = Attach(Asking(instance));
  REQUIRE(result.view);
  owner->Close();
  CHECK(result.view->State() == SegmentState::kClosed);
  CHECK_FALSE(result.view->Ready());
  CHECK_FALSE(result.view->IsCurrent());
  CHECK(Attach(Asking(instance)).status == AttachStatus::kAbsent);
  owner->SetFault(3);  // too late to say
  CHECK(result.view->State() == SegmentState::kClosed);
  owner.reset();
  // The old map stays readable.
  auto reader = result.view->Reader<HapticTick>();
  HapticTick got;
  CHECK(reader.ReadLatest(got) == ReadStatus::kFresh);
  CHECK(test::IsNumbered(got));
}

TEST_CASE("a fault is a state that comes and goes, and the segment can still be attached") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  owner.SetFault(12);
  const AttachResult result = Attach(Asking(instance));
  REQUIRE(result.view);
  CHECK(result.view->State() == SegmentState::kFaulted);
  CHECK(result.view->FaultCode() == 12);
  CHECK_FALSE(result.view->Ready());
  owner.ClearFault();
  CHECK(result.view->Ready());
  CHECK(result.view->FaultCode() == 0);
}

TEST_CASE("the object is private to user and group, and its lock file to the user") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const mode_t before = umask(0077);
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  umask(before);
  struct stat status {};
  REQUIRE(stat(("/dev/shm" + owner.name()).c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0640);
  CHECK(status.st_blocks * 512 >= status.st_size);  // allocated, not a hole
  const std::string lock = folder.path() + "/rikiseki." + instance + ".haptic.lock";
  REQUIRE(stat(lock.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0600);
}

TEST_CASE("a second owner is refused with 75") {
  const TemporaryFolder folder;
  const TemporaryFolder other_folder;
  const std::string instance = FreshInstance();
  const SegmentOwner owner(HapticOptions(instance, folder.path()));
  std::string text;
  CHECK(ExitCodeOf(HapticOptions(instance, folder.path()), &text) == 75);
  CHECK_THAT(text, Catch::Contains("already"));
  // A hand-run one with another runtime directory must not push the living one out either.
  CHECK(ExitCodeOf(HapticOptions(instance, other_folder.path()), &text) == 75);
  CHECK_THAT(text, Catch::Contains("in use"));
  CHECK(owner.epoch() == Attach(Asking(instance)).view->epoch());
  // Another role or instance is another matter.
  OwnerOptions world = HapticOptions(instance, folder.path());
  world.role = Role::kWorld;
  CHECK(ExitCodeOf(world) == 0);
  CHECK(ExitCodeOf(HapticOptions(FreshInstance(), folder.path())) == 0);
}

TEST_CASE("names and shapes that cannot be are refused") {
  const TemporaryFolder folder;
  for (const std::string instance : {"", "a/b", "..", "a b", "\n"}) {
    CHECK(ExitCodeOf(HapticOptions(instance, folder.path())) == 64);
  }
  CHECK(ExitCodeOf(HapticOptions(std::string(65, 'a'), folder.path())) == 64);
  OwnerOptions options = HapticOptions(FreshInstance(), folder.path());
  options.streams[0].slot_count = 6;
  CHECK(ExitCodeOf(options) == 64);
  options.streams[0].slot_count = 2;
  CHECK(ExitCodeOf(options) == 64);
  options.streams[0].slot_count = 65536;
  std::string text;
  CHECK(ExitCodeOf(options, &text) == 78);
  CHECK_THAT(text, Catch::Contains("16 MiB"));
  CHECK(HapticTickSlots(200'000'000, 0, 1'000'000) == 1024);
  CHECK(HapticTickSlots(50'000'000, 6'000'000, 1'000'000) == 256);
  CHECK(HapticTickSlots(1, 0, 1'000'000) == kMinSlots);
}

TEST_CASE("a restart supersedes the old object: epoch grows, the old map is frozen") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  std::uint64_t last_epoch = 0;
  AttachResult old;
  for (int i = 0; i < 5; ++i) {
    const pid_t child = test::Fork([&] {
      SegmentOwner owner(HapticOptions(instance, folder.path()));
      auto writer = owner.Writer<HapticTick>();
      for (std::uint64_t n = 1; n <= 30; ++n) writer.Publish(test::Numbered(n), n);
      raise(SIGKILL);
    });
    test::Reap(child);
    // Nobody owns it any more: it cannot be attached, only superseded.
    CHECK(Attach(Asking(instance)).status == AttachStatus::kOwnerGone);
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    CHECK(owner.epoch() > last_epoch);
    last_epoch = owner.epoch();
    REQUIRE(!owner.notes().empty());
    CHECK_THAT(owner.notes()[0], Catch::Contains("superseded"));
    if (old.view) {
      CHECK(old.view->State() == SegmentState::kClosed);
      CHECK_FALSE(old.view->IsCurrent());
      CHECK(old.view->epoch() < owner.epoch());
    }
    old = Attach(Asking(instance));
    REQUIRE(old.view);
    CHECK(old.view->epoch() == owner.epoch());
  }
}

TEST_CASE("an epoch grows over a predecessor's of the same instant, but not over nonsense") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const std::string name = SegmentName(instance, Role::kHaptic);
  SegmentHeader header{};
  {
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    header = Attach(Asking(instance)).view->header();
  }
  const auto epoch_after = [&](std::uint64_t ahead_ns) {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    header.epoch = static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000 +
                   static_cast<std::uint64_t>(now.tv_nsec) + ahead_ns;
    const int object = shm_open(name.c_str(), O_RDWR | O_CREAT | O_EXCL, 0600);
    REQUIRE(write(object, &header, sizeof header) == sizeof header);
    close(object);
    return SegmentOwner(HapticOptions(instance, folder.path())).epoch();
  };
  CHECK(epoch_after(900'000'000) > header.epoch);
  CHECK(epoch_after(1'000'000'000'000) < header.epoch);
}

TEST_CASE("an observer's read lock keeps nobody from starting") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const pid_t child = test::Fork([&] {
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    pause();
  });
  REQUIRE(test::Eventually([&] { return Attach(Asking(instance)).view != nullptr; }));
  const std::string path = "/dev/shm" + SegmentName(instance, Role::kHaptic);
  const int observer = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  REQUIRE(observer >= 0);
  struct flock lock {};
  lock.l_type = F_RDLCK;
  lock.l_start = 1;  // everything but the owner's byte, and then, once that is free, it too
  REQUIRE(fcntl(observer, F_OFD_SETLK, &lock) == 0);
  kill(child, SIGKILL);
  test::Reap(child);
  lock.l_start = 0;
  REQUIRE(fcntl(observer, F_OFD_SETLK, &lock) == 0);
  CHECK(Attach(Asking(instance)).status == AttachStatus::kOwnerGone);
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  CHECK(Attach(Asking(instance)).view != nullptr);
  close(observer);
}

TEST_CASE("a store through the read-only map faults") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  auto writer = owner.Writer<HapticTick>();
  writer.Publish(test::Numbered(1), 1);
  const int status = test::Reap(test::Fork([&] {
    signal(SIGSEGV, SIG_DFL);
    const AttachResult result = Attach(Asking(instance));
    // What a reader holds is where the pages are: StreamWriter would store there.
    StreamReader reader = result.view->Stream(StreamType::kHapticTick);
    Ring ring;
    static_assert(sizeof(StreamReader) > sizeof(Ring));
    std::memcpy(static_cast<void*>(&ring), &reader, sizeof ring);
    if (ring.published == nullptr || *ring.published != 1) _exit(3);
    StreamWriter(ring).Publish({}, 0, 0);
  }));
  REQUIRE(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == SIGSEGV);
}

TEST_CASE("a full /dev/shm is an error in words, not a bus error") {
  const int status = test::Reap(test::Fork([] {
    // A small /dev/shm of this child's own; needs a privilege that not every machine gives.
    if (unshare(CLONE_NEWNS) != 0 ||
        mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", "/dev/shm", "tmpfs", 0, "size=64k") != 0) {
      _exit(42);
    }
    const TemporaryFolder folder;
    std::string text;
    const std::string instance = FreshInstance();
    if (ExitCodeOf(HapticOptions(instance, folder.path()), &text) != 75) _exit(1);
    if (text.find("/dev/shm is full") == std::string::npos) _exit(2);
    if (StatObject(SegmentName(instance, Role::kHaptic)).id != ObjectId{}) _exit(3);
    _exit(0);
  }));
  REQUIRE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 42) {
    WARN("skipped: this user may not mount a small /dev/shm");
  } else {
    CHECK(WEXITSTATUS(status) == 0);
  }
}

TEST_CASE("an object of another user is left alone with 78, and not attached") {
  if (geteuid() != 0) {
    WARN("skipped: only root can give an object away");
    return;
  }
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  const std::string path = "/dev/shm" + owner.name();
  REQUIRE(chown(path.c_str(), 4242, 4242) == 0);
  const AttachResult result = Attach(Asking(instance));
  CHECK(result.status == AttachStatus::kForbidden);
  CHECK_THAT(result.text, Catch::Contains("4242"));
  const TemporaryFolder other_folder;
  std::string text;
  CHECK(ExitCodeOf(HapticOptions(instance, other_folder.path()), &text) == 78);
  CHECK_THAT(text, Catch::Contains("belongs to user 4242"));
  AttachRequest trusting = Asking(instance);
  trusting.owners = {4242};
  CHECK(Attach(trusting).status == AttachStatus::kAttached);
}

TEST_CASE("what is not an object is neither opened nor removed") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const std::string path = "/dev/shm" + SegmentName(instance, Role::kHaptic);
  REQUIRE(mkfifo(path.c_str(), 0600) == 0);  // opening it would block for ever
  CHECK(Attach(Asking(instance)).status == AttachStatus::kForbidden);
  CHECK(ExitCodeOf(HapticOptions(instance, folder.path())) == 78);
  unlink(path.c_str());
}

/// A sound header and the size of its object, to be spoiled.
struct Sound {
  SegmentHeader header;
  std::uint64_t bytes;
};

Sound MakeSound() {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const SegmentOwner owner(HapticOptions(instance, folder.path()));
  const SegmentHeader header = Attach(Asking(instance)).view->header();
  return {header, header.segment_bytes};
}

struct Shape {
  const char* field;
  std::function<void(SegmentHeader&)> spoil;
};

const std::vector<Shape>& HostileShapes() {
  static const std::vector<Shape> shapes{
      {"magic", [](auto& h) { ++h.magic; }},
      {"byte_order", [](auto& h) { h.byte_order = 0x04030201; }},
      {"version_major", [](auto& h) { ++h.version_major; }},
      {"layout_hash", [](auto& h) { h.layout_hash ^= 1; }},
      {"header_bytes", [](auto& h) { h.header_bytes = 8192; }},
      {"role", [](auto& h) { h.role = 2; }},
      {"epoch", [](auto& h) { h.epoch = 0; }},
      {"segment_bytes", [](auto& h) { h.segment_bytes += 1; }},
      {"segment_bytes", [](auto& h) { h.segment_bytes = ~0ull; }},
      {"segment_bytes", [](auto& h) { h.segment_bytes = 100; }},
      {"stream_count", [](auto& h) { h.stream_count = 0; }},
      {"stream_count", [](auto& h) { h.stream_count = 17; }},
      {"stream_count", [](auto& h) { h.stream_count = ~0u; }},
      {"stream[1].type_id", [](auto& h) { h.stream[1].type_id = h.stream[0].type_id; }},
      {"stream[0].type_id", [](auto& h) { h.stream[0].type_id = 0; }},
      {"stream[0].cursor_offset", [](auto& h) { h.stream[0].cursor_offset += 8; }},
      {"stream[0].cursor_offset", [](auto& h) { h.stream[0].cursor_offset = 0; }},
      {"stream[0].cursor_offset", [](auto& h) { h.stream[0].cursor_offset = h.segment_bytes; }},
      {"stream[0].cursor_offset", [](auto& h) { h.stream[0].cursor_offset = ~0ull - 127; }},
      {"stream[1].cursor_offset",
       [](auto& h) { h.stream[1].cursor_offset = h.stream[0].cursor_offset; }},
      {"stream[1].cursor_offset",
       [](auto& h) { h.stream[1].cursor_offset = h.stream[0].ring_offset + 128; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].ring_offset += 1; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].ring_offset = 0; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].ring_offset = h.segment_bytes - 128; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].ring_offset = ~0ull - 127; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].ring_offset = 4096; }},
      {"stream[1].ring_offset", [](auto& h) { h.stream[1].ring_offset -= 128; }},
      {"stream[0].slot_stride", [](auto& h) { h.stream[0].slot_stride = 0; }},
      {"stream[0].slot_stride", [](auto& h) { h.stream[0].slot_stride += 8; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].slot_stride = 0xFFFFFF80; }},
      {"stream[0].slot_count", [](auto& h) { h.stream[0].slot_count = 0; }},
      {"stream[0].slot_count", [](auto& h) { h.stream[0].slot_count = 2; }},
      {"stream[0].slot_count", [](auto& h) { h.stream[0].slot_count = 15; }},
      {"stream[0].slot_count", [](auto& h) { h.stream[0].slot_count = 1u << 17; }},
      {"stream[0].ring_offset", [](auto& h) { h.stream[0].slot_count = 65536; }},
      {"stream[0].payload_bytes", [](auto& h) { h.stream[0].payload_bytes += 1; }},
      {"stream[0].payload_bytes",
       [](auto& h) { h.stream[0].payload_bytes = h.stream[0].slot_stride; }},
      {"stream[0].payload_bytes", [](auto& h) { h.stream[0].payload_bytes = 0xFFFFFFF8; }},
  };
  return shapes;
}

TEST_CASE("a hostile header is refused with the name of its field") {
  const Sound sound = MakeSound();
  REQUIRE(CheckHeader(sound.header, sound.bytes, Role::kHaptic).empty());
  for (const Shape& shape : HostileShapes()) {
    SegmentHeader header = sound.header;
    shape.spoil(header);
    CHECK_THAT(CheckHeader(header, sound.bytes, Role::kHaptic), Catch::StartsWith(shape.field));
  }
  CHECK_THAT(CheckHeader(sound.header, sound.bytes - 1, Role::kHaptic),
             Catch::StartsWith("segment_bytes"));
}

TEST_CASE("version rules") {
  const auto differs = [](std::uint16_t major, std::uint16_t minor, std::uint64_t hash) {
    return CompareVersion(major, minor, hash, 1, 4, 99);
  };
  CHECK(differs(1, 4, 99).empty());
  CHECK_THAT(differs(1, 4, 98), Catch::StartsWith("layout_hash"));
  CHECK(differs(1, 3, 98).empty());  // another minor: the directory decides, not the hash
  CHECK(differs(1, 5, 98).empty());
  CHECK_THAT(differs(0, 4, 99), Catch::StartsWith("version_major"));
  CHECK_THAT(differs(2, 4, 99), Catch::StartsWith("version_major"));
}

TEST_CASE("whatever the directory holds, what is accepted lies inside and apart") {
  const Sound sound = MakeSound();
  std::mt19937_64 random(3);
  int accepted = 0;
  for (int i = 0; i < 200000; ++i) {
    SegmentHeader header = sound.header;
    auto* const words = reinterpret_cast<unsigned char*>(&header);
    for (std::uint64_t flips = 1 + random() % 3; flips > 0; --flips) {
      const std::size_t at = offsetof(SegmentHeader, stream) + random() % (2 * sizeof(StreamEntry));
      words[at] = static_cast<unsigned char>(words[at] ^ (1u << random() % 8));
    }
    if (!CheckHeader(header, sound.bytes, Role::kHaptic).empty()) continue;
    ++accepted;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> extents;
    for (std::uint32_t s = 0; s < header.stream_count; ++s) {
      const StreamEntry& e = header.stream[s];
      extents.emplace_back(e.cursor_offset, e.cursor_offset + 8);
      extents.emplace_back(e.ring_offset,
                           e.ring_offset + std::uint64_t{e.slot_stride} * e.slot_count);
      REQUIRE(e.payload_bytes + sizeof(SlotHeader) <= e.slot_stride);
    }
    std::sort(extents.begin(), extents.end());
    REQUIRE(extents.front().first >= kHeaderBytes);
    REQUIRE(extents.back().second <= sound.bytes);
    for (std::size_t e = 1; e < extents.size(); ++e) {
      REQUIRE(extents[e].first >= extents[e - 1].second);
    }
  }
  CHECK(accepted > 100);
}

/// An object with these bytes, owned and locked like a living owner's.
class RawObject {
 public:
  RawObject(const std::string& instance, const SegmentHeader& header, std::uint64_t bytes)
      : name_(SegmentName(instance, Role::kHaptic)),
        descriptor_(shm_open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL, 0600)) {
    REQUIRE(descriptor_ >= 0);
    REQUIRE(ftruncate(descriptor_, static_cast<off_t>(bytes)) == 0);
    if (bytes > 0) {
      const std::size_t some = std::min<std::size_t>(bytes, sizeof header);
      REQUIRE(pwrite(descriptor_, &header, some, 0) == static_cast<ssize_t>(some));
    }
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_len = 1;
    REQUIRE(fcntl(descriptor_, F_OFD_SETLK, &lock) == 0);
  }
  ~RawObject() {
    close(descriptor_);
    shm_unlink(name_.c_str());
  }

 private:
  std::string name_;
  int descriptor_;
};

TEST_CASE("an object of a hostile shape is not attached") {
  const Sound sound = MakeSound();
  const auto attach = [](const SegmentHeader& header, std::uint64_t bytes) {
    const std::string instance = FreshInstance();
    const RawObject object(instance, header, bytes);
    AttachResult result = Attach(Asking(instance));
    CHECK(result.object != ObjectId{});
    return result;
  };
  {
    SegmentHeader ready = sound.header;
    ready.state = 1;
    CHECK(attach(ready, sound.bytes).status == AttachStatus::kAttached);
  }
  CHECK(attach(sound.header, 0).status == AttachStatus::kNotReady);
  for (const std::uint64_t bytes : {std::uint64_t{1}, std::uint64_t{4095}, kMaxSegmentBytes + 1}) {
    const AttachResult result = attach(sound.header, bytes);
    CHECK(result.status == AttachStatus::kIncompatible);
    CHECK_THAT(result.text, Catch::Contains("size"));
  }
  for (const Shape& shape : HostileShapes()) {
    SegmentHeader header = sound.header;
    shape.spoil(header);
    const AttachResult result = attach(header, sound.bytes);
    INFO(result.text);
    CHECK(result.status == AttachStatus::kIncompatible);
    CHECK_THAT(result.text, Catch::Contains(": " + std::string(shape.field)));
    CHECK(result.view == nullptr);
  }
  const std::pair<std::uint64_t, AttachStatus> states[] = {
      {0, AttachStatus::kNotReady},     {2, AttachStatus::kOwnerGone},
      {3, AttachStatus::kAttached},     {4, AttachStatus::kOwnerGone},
      {5, AttachStatus::kIncompatible}, {~0ull, AttachStatus::kIncompatible}};
  for (const auto& [state, status] : states) {
    SegmentHeader header = sound.header;
    header.state = state;
    CHECK(attach(header, sound.bytes).status == status);
  }
}

TEST_CASE("streams that a reader needs must be there, new enough and long enough") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const SegmentOwner owner(HapticOptions(instance, folder.path()));
  AttachRequest request = Asking(instance);
  request.required = {{StreamType::kWorldFrame}};
  AttachResult result = Attach(request);
  CHECK(result.status == AttachStatus::kIncompatible);
  CHECK_THAT(result.text, Catch::Contains("stream type 16 is missing"));
  request.required = {{StreamType::kHapticTick, 2}};
  CHECK_THAT(Attach(request).text, Catch::Contains("type_version"));
  request.required = {{StreamType::kHapticTick, 1, 17'000'000}};
  CHECK_THAT(Attach(request).text, Catch::Contains("slot_count 16 holds 16 ms, needed are 17 ms"));
}

}  // namespace
}  // namespace rikiseki::protocol
