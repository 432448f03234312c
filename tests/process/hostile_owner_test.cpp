// SPDX-License-Identifier: MIT
// Owners that break every rule, against the real daemons: one that truncates its segment under its
// reader, one that writes noise into it at full speed, one that lies plausibly; a /dev/shm without
// room; and peers that come and go so often that a leak would show.
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>

#include "common/clock.h"
#include "protocol/attach.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::Role;

constexpr double kSlewLimit = 5000;  // N/s
constexpr std::int64_t kWorldPeriodNs = 20'000'000;
constexpr std::int64_t kTickPeriodNs = 1'000'000;
constexpr double kZeroForce = 1e-12;  // N: the strings' tensions add up to zero but for rounding

std::vector<std::string> HapticCommand(const std::string& instance) {
  return {Program("haptic_server"),
          "--config",
          SourceFile("config/haptic_server.ini"),
          "--instance",
          instance,
          "--set",
          "safety.slew_limit_n_per_s=5000",
          "--set",
          "hand.rest_ms=100",
          "--set",
          "hand.hold_ms=1500"};
}

std::vector<std::string> WorldCommand(const std::string& instance) {
  return {Program("world_server"), "--config", SourceFile("config/world_server.ini"), "--instance",
          instance};
}

void Pause(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

std::string SegmentPath(const std::string& instance, Role role) {
  return "/dev/shm" + protocol::SegmentName(instance, role);
}

// A segment of this process, filled by a thread of its own, soundly: a world that shows a wall in
// the way of the hand, or a haptic side that pushes body 1 along x with 1 N.
class Peer {
 public:
  Peer(const std::string& instance, Role role)
      : owner_({.instance = instance,
                .role = role,
                .streams = role == Role::kWorld
                               ? protocol::WorldStreams(kWorldPeriodNs, 4, kWorldPeriodNs)
                               : protocol::HapticStreams(kTickPeriodNs, 1024, 10'000'000),
                .build = "hostile owner test",
                .runtime_directory = ""}) {
    if (role == Role::kWorld) {
      frames_ = owner_.Writer<protocol::WorldFrame>();
    } else {
      ticks_ = owner_.Writer<protocol::HapticTick>();
    }
    thread_ = std::thread([this, role] {
      while (!stop_) {
        if (role == Role::kWorld) {
          PublishFrame();
          std::this_thread::sleep_for(std::chrono::nanoseconds(kWorldPeriodNs));
        } else {
          PublishTick();
          std::this_thread::sleep_for(std::chrono::nanoseconds(kTickPeriodNs));
        }
      }
    });
  }
  ~Peer() { Rest(); }

  // Publishes no more; the segment stays.
  void Rest() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

  std::uint64_t epoch() const { return owner_.epoch(); }

  // Lets a lie into every message from now on; called on the publishing thread.
  void Lie(std::function<void(protocol::WorldFrame&)> lie) {
    const std::lock_guard lock(mutex_);
    frame_lie_ = std::move(lie);
  }
  void Lie(std::function<void(protocol::HapticTick&)> lie) {
    const std::lock_guard lock(mutex_);
    tick_lie_ = std::move(lie);
  }

 private:
  void PublishFrame() {
    protocol::WorldFrame frame;
    frame.frame = ++number_;
    frame.period_ns = kWorldPeriodNs;
    frame.plane_count = 1;
    frame.planes[0].body = 1;
    frame.planes[0].generation = 1;
    frame.planes[0].point = {-0.02, 0, 0};
    frame.planes[0].normal = {-1, 0, 0};
    {
      const std::lock_guard lock(mutex_);
      if (frame_lie_) frame_lie_(frame);
    }
    const auto now_ns = static_cast<std::uint64_t>(MonotonicNow());
    frames_.Publish(frame, now_ns);
    owner_.Heartbeat(number_, now_ns);
  }

  void PublishTick() {
    const auto now_ns = static_cast<std::uint64_t>(MonotonicNow());
    protocol::HapticTick tick;
    tick.tick = number_++;
    tick.start_ns = now_ns;
    tick.period_ns = kTickPeriodNs;
    tick.stiffness = 2000;
    tick.force_cap = 10;
    tick.pointer_count = 1;
    tick.pointers[0].radius = 0.01;
    tick.pointers[0].position = {-0.04, 0, 0};
    tick.channel_count = 1;
    tick.channels[0].body = 1;
    tick.channels[0].generation = 1;
    tick.channels[0].impulse = {static_cast<std::int64_t>(tick.tick) * 1'000'000'000, 0, 0};
    {
      const std::lock_guard lock(mutex_);
      if (tick_lie_) tick_lie_(tick);
    }
    ticks_.Publish(tick, now_ns);
    owner_.Heartbeat(tick.tick, now_ns);
  }

  protocol::SegmentOwner owner_;
  protocol::MessageWriter<protocol::WorldFrame> frames_;
  protocol::MessageWriter<protocol::HapticTick> ticks_;
  std::uint64_t number_ = 0;
  std::mutex mutex_;
  std::function<void(protocol::WorldFrame&)> frame_lie_;
  std::function<void(protocol::HapticTick&)> tick_lie_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

enum class Damage { kEverything, kRings };

// The whole of a segment, writable, through its name.
class Vandal {
 public:
  Vandal(const std::string& instance, Role role) {
    const int descriptor = open(SegmentPath(instance, role).c_str(), O_RDWR | O_CLOEXEC);
    REQUIRE(descriptor >= 0);
    struct stat status {};
    REQUIRE(fstat(descriptor, &status) == 0);
    bytes_ = static_cast<std::size_t>(status.st_size);
    words_ = static_cast<std::uint64_t*>(
        mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0));
    close(descriptor);
    REQUIRE(words_ != MAP_FAILED);
  }
  ~Vandal() { munmap(words_, bytes_); }
  Vandal(const Vandal&) = delete;
  Vandal& operator=(const Vandal&) = delete;

  // Noise, over and over, for so long.
  void Rage(double seconds, Damage damage) {
    std::mt19937_64 random(7);
    const std::size_t begin = damage == Damage::kRings ? header().stream[0].ring_offset : 0;
    const auto limit = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < limit) {
      for (std::size_t i = begin / 8; i < bytes_ / 8; ++i) Store(words_[i], random());
    }
  }

  // Right numbers and marks, and noise as content: what is read whole and must be judged by its
  // content.
  void PublishNoise(double seconds, int pause_us) {
    const protocol::StreamEntry stream = header().stream[0];
    std::mt19937_64 random(11);
    const auto limit = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    std::uint64_t number = words_[stream.cursor_offset / 8];
    while (std::chrono::steady_clock::now() < limit) {
      ++number;
      std::uint64_t* const slot =
          words_ +
          (stream.ring_offset + (number & (stream.slot_count - 1)) * stream.slot_stride) / 8;
      Store(slot[0], 2 * number - 1);
      Store(slot[1], static_cast<std::uint64_t>(MonotonicNow()));
      // Half of them of a length that fits.
      const std::uint64_t used =
          random() % 2 == 0 ? 168 : 8 * (random() % (stream.payload_bytes / 8));
      Store(slot[2], used | (random() % 8) << 32);
      for (std::size_t i = 0; i < stream.payload_bytes / 8; ++i) Store(slot[4 + i], random());
      Store(slot[0], 2 * number);
      Store(words_[stream.cursor_offset / 8], number);
      Store(words_[0x88 / 8], static_cast<std::uint64_t>(MonotonicNow()));
      std::this_thread::sleep_for(std::chrono::microseconds(pause_us));
    }
  }

 private:
  protocol::SegmentHeader& header() { return *reinterpret_cast<protocol::SegmentHeader*>(words_); }
  static void Store(std::uint64_t& word, std::uint64_t value) {
    std::atomic_ref<std::uint64_t>(word).store(value, std::memory_order_release);
  }

  std::uint64_t* words_ = nullptr;
  std::size_t bytes_ = 0;
};

// How long the hostile keep at it.
double HostileSeconds() {
  return std::getenv("RIKISEKI_FULL") != nullptr ? 20 : 2;
}

// Numbers that pass for what they stand for.
class Lies {
 public:
  explicit Lies(std::uint64_t seed) : random_(seed) {}
  std::uint64_t Word() { return random_(); }
  bool Coin() { return random_() % 2 == 0; }
  double Near(double size) { return std::uniform_real_distribution<double>(-size, size)(random_); }
  // Of any order of magnitude, finite.
  double Any() {
    return Near(1) * std::pow(10.0, std::uniform_int_distribution<int>(-320, 307)(random_));
  }

 private:
  std::mt19937_64 random_;
};

// Memory aside: an allocator takes and gives as it likes.
bool HoldsAs(pid_t process, const Usage& before) {
  const Usage now = UsageOf(process);
  return now.descriptors == before.descriptors && now.mappings == before.mappings &&
         now.segments == before.segments;
}

bool BlockIsFinite(const protocol::PeerView& world) {
  const protocol::Body body = ReadMovingBody(world);  // decoding refuses what is not finite
  return std::hypot(body.position[0], body.position[1], body.position[2]) < 1e6;
}

}  // namespace

TEST_CASE(
    "a world that truncates its segment ends the haptic server by SIGBUS, and a restart works") {
  const Instance instance;
  {
    Child haptic(HapticCommand(instance));
    const TickWatch watch(instance, kSlewLimit);
    Peer world(instance, Role::kWorld);
    REQUIRE(Eventually([&] { return watch.Latest().force > 1; }));
    world.Rest();
    REQUIRE(truncate(SegmentPath(instance, Role::kWorld).c_str(), protocol::kHeaderBytes) == 0);
    CHECK(haptic.Wait() == -SIGBUS);
    CheckSafe(watch);
  }
  Child haptic(HapticCommand(instance));
  Child world(WorldCommand(instance));
  const TickWatch watch(instance, kSlewLimit);
  CHECK(Eventually([&] { return watch.Latest().force > 1; }, 15));
  CheckSafe(watch);
}

TEST_CASE(
    "a haptic side that truncates its segment ends the world server by SIGBUS, and a restart "
    "works") {
  const Instance instance;
  {
    Child world(WorldCommand(instance));
    const auto view = Observe(instance, Role::kWorld);
    Peer haptic(instance, Role::kHaptic);
    REQUIRE(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == haptic.epoch(); }));
    haptic.Rest();
    REQUIRE(truncate(SegmentPath(instance, Role::kHaptic).c_str(), protocol::kHeaderBytes) == 0);
    CHECK(world.Wait() == -SIGBUS);
  }
  Child world(WorldCommand(instance));
  const auto view = Observe(instance, Role::kWorld);
  Peer haptic(instance, Role::kHaptic);
  CHECK(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == haptic.epoch(); }));
}

TEST_CASE(
    "a world whose whole segment becomes noise is refused: zero force, a reason, and the next one "
    "is taken") {
  const Instance instance;
  Child haptic(HapticCommand(instance));
  const TickWatch watch(instance, kSlewLimit);
  const auto view = Observe(instance, Role::kHaptic);
  {
    Peer world(instance, Role::kWorld);
    REQUIRE(Eventually([&] { return watch.Latest().force > 1; }));
    world.Rest();
    Vandal(instance, Role::kWorld).Rage(HostileSeconds(), Damage::kEverything);
    CHECK(haptic.IsRunning());
    CHECK(watch.Latest().force < kZeroForce);
    CHECK_THAT(haptic.Stderr(), Contains("refused, its messages break the protocol"));
  }
  const Peer sound(instance, Role::kWorld);
  CHECK(Eventually([&] { return watch.Latest().force > 1; }));
  CHECK(ReadHapticHealth(*view).peer_epoch == sound.epoch());
  CheckSafe(watch);
}

TEST_CASE("a world whose rings become noise is lost: zero force, and it may come back") {
  const Instance instance;
  Child haptic(HapticCommand(instance));
  const TickWatch watch(instance, kSlewLimit);
  Peer world(instance, Role::kWorld);
  REQUIRE(Eventually([&] { return watch.Latest().force > 1; }));
  Vandal(instance, Role::kWorld).Rage(HostileSeconds(), Damage::kRings);
  CHECK(haptic.IsRunning());
  CheckSafe(watch);
  CHECK(Eventually([&] { return watch.Latest().force > 1; }));  // the sound messages go on
}

TEST_CASE("a world that publishes noise as content is refused") {
  const Instance instance;
  Child haptic(HapticCommand(instance));
  const TickWatch watch(instance, kSlewLimit);
  Peer world(instance, Role::kWorld);
  REQUIRE(Eventually([&] { return watch.Latest().force > 1; }));
  world.Rest();
  Vandal(instance, Role::kWorld).PublishNoise(HostileSeconds(), 1000);
  CHECK(haptic.IsRunning());
  CHECK(watch.Latest().force < kZeroForce);
  CHECK_THAT(haptic.Stderr(), Contains("refused, its messages break the protocol"));
  CheckSafe(watch);
}

TEST_CASE(
    "a world that lies plausibly has no more power than the cap and the slew limit leave it") {
  const Instance instance;
  Child haptic(HapticCommand(instance));
  const TickWatch watch(instance, kSlewLimit);
  const auto view = Observe(instance, Role::kHaptic);
  Peer world(instance, Role::kWorld);
  REQUIRE(Eventually([&] { return watch.Latest().force > 1; }));
  Lies lies(3);
  world.Lie([&](protocol::WorldFrame& frame) {
    frame.acked_epoch = lies.Coin() ? view->epoch() : lies.Word();
    frame.baseline_tick = lies.Word() % 4000;
    frame.acked_tick = frame.baseline_tick + lies.Word() % 4000;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      frame.applied[axis] = static_cast<std::int64_t>(lies.Word());
      frame.discarded[axis] = static_cast<std::int64_t>(lies.Word());
    }
    if (lies.Coin()) frame.period_ns = 1 + lies.Word() % 10'000'000'000;
    frame.plane_count = static_cast<std::uint32_t>(lies.Word() % (protocol::kMaxPlanes + 1));
    for (protocol::Plane& plane : frame.planes) {
      plane.pointer = static_cast<std::uint32_t>(lies.Word() % 4);
      plane.body = static_cast<std::uint32_t>(lies.Word() % 3);
      plane.generation = static_cast<std::uint32_t>(lies.Word() % 3);
      plane.feature = static_cast<std::uint32_t>(lies.Word() % 3);
      for (double& x : plane.point) x = lies.Coin() ? lies.Near(0.05) : lies.Any();
      for (double& x : plane.normal) x = lies.Near(1);
      plane.stiffness = lies.Coin() ? 0 : std::abs(lies.Any());
      plane.damping = lies.Coin() ? 0 : std::abs(lies.Any());
    }
  });
  Pause(static_cast<int>(1000 * HostileSeconds()));
  CHECK(haptic.IsRunning());
  CheckSafe(watch);
  world.Lie(std::function<void(protocol::WorldFrame&)>());
  CHECK(Eventually([&] { return watch.Latest().force > 1; }));
  CheckSafe(watch);
}

TEST_CASE("a haptic side whose whole segment becomes noise is refused, and the world goes on") {
  const Instance instance;
  Child world(WorldCommand(instance));
  const auto view = Observe(instance, Role::kWorld);
  {
    Peer haptic(instance, Role::kHaptic);
    REQUIRE(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == haptic.epoch(); }));
    haptic.Rest();
    Vandal(instance, Role::kHaptic).Rage(HostileSeconds(), Damage::kEverything);
    CHECK(world.IsRunning());
    CHECK_THAT(world.Stderr(), Contains("refused, its messages break the protocol"));
    CHECK(BlockIsFinite(*view));
  }
  const Peer sound(instance, Role::kHaptic);
  CHECK(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == sound.epoch(); }));
}

TEST_CASE("a haptic side that publishes noise as content is refused, and the world goes on") {
  const Instance instance;
  Child world(WorldCommand(instance));
  const auto view = Observe(instance, Role::kWorld);
  Peer haptic(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == haptic.epoch(); }));
  haptic.Rest();
  Vandal(instance, Role::kHaptic).PublishNoise(HostileSeconds(), 200);
  CHECK(world.IsRunning());
  CHECK_THAT(world.Stderr(), Contains("refused, its messages break the protocol"));
  const std::uint64_t frame = ReadWorldFrame(*view).frame;
  CHECK(Eventually([&] { return ReadWorldFrame(*view).frame > frame + 3; }));
  CHECK(BlockIsFinite(*view));
}

TEST_CASE(
    "a haptic side that lies plausibly moves the block by no more than the gap rule lets through") {
  const Instance instance;
  Child world(WorldCommand(instance));
  const auto view = Observe(instance, Role::kWorld);
  Peer haptic(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadWorldFrame(*view).acked_epoch == haptic.epoch(); }));
  const protocol::WorldFrame before = ReadWorldFrame(*view);
  Lies lies(5);
  haptic.Lie([&](protocol::HapticTick& tick) {
    tick.world_epoch = lies.Coin() ? view->epoch() : lies.Word();
    if (lies.Coin()) tick.start_ns = lies.Word();
    tick.previous_duration_ns = lies.Word();
    tick.stiffness = std::abs(lies.Any());
    for (double& x : tick.pointers[0].position) x = lies.Coin() ? lies.Near(0.05) : lies.Any();
    for (double& x : tick.pointers[0].velocity) x = lies.Any();
    tick.channel_count = static_cast<std::uint32_t>(lies.Word() % (protocol::kMaxChannels + 1));
    for (protocol::Channel& channel : tick.channels) {
      channel.body = static_cast<std::uint32_t>(lies.Word() % 3);
      channel.generation = static_cast<std::uint32_t>(lies.Word() % 3);
      channel.opened_tick = lies.Word() % (tick.tick + 1);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        // Some as large as they can be, some that add up to what passes for a push.
        const bool large = lies.Coin();
        const auto units = [&] {
          return large ? static_cast<std::int64_t>(lies.Word())
                       : static_cast<std::int64_t>(lies.Near(1) * 1e11);
        };
        channel.impulse[axis] = units();
        channel.angular_impulse[axis] = units();
      }
    }
  });
  Pause(static_cast<int>(1000 * HostileSeconds()));
  CHECK(world.IsRunning());
  const protocol::WorldFrame after = ReadWorldFrame(*view);
  CHECK(after.frame > before.frame);
  // SPEC.md 7.4 rule 4: 20 N * 150 ms per world tick.
  const protocol::Body block = ReadMovingBody(*view);
  const double speed = std::hypot(block.velocity[0], block.velocity[1], block.velocity[2]);
  CHECK(block.mass * speed <= 3.0 * static_cast<double>(after.frame - before.frame + 2));
  CHECK(BlockIsFinite(*view));
  CHECK(ReadWorldFrame(*view).frame > 0);
}

TEST_CASE("a full /dev/shm is an error at the start, with a sentence, and no SIGBUS") {
  const std::vector<std::string> unshare = {"/usr/bin/unshare", "--mount", "/bin/true"};
  if (!std::filesystem::exists(unshare[0]) || Child(unshare).Wait() != 0) {
    WARN("no private mount namespace may be had here: skipped");
    return;
  }
  const Instance instance;
  for (const auto& command : {HapticCommand(instance), WorldCommand(instance)}) {
    std::vector<std::string> line = {"/usr/bin/unshare",
                                     "--mount",
                                     "/bin/sh",
                                     "-c",
                                     "mount -t tmpfs -o size=128k tmpfs /dev/shm && exec \"$@\"",
                                     "sh"};
    line.insert(line.end(), command.begin(), command.end());
    Child child(line);
    CHECK(child.Wait() == 75);
    CHECK_THAT(child.Stderr(), Contains("/dev/shm is full") && Contains("bytes are needed for"));
  }
}

TEST_CASE(
    "a daemon whose peer restarts over and over keeps no descriptor and no mapping of the dead") {
  const int restarts = std::getenv("RIKISEKI_FULL") != nullptr ? 1000 : 100;
  const Instance with_haptic;
  const Instance with_world;
  Child haptic(HapticCommand(with_haptic));
  Child world(WorldCommand(with_world));
  const auto haptic_view = Observe(with_haptic, Role::kHaptic);
  const auto world_view = Observe(with_world, Role::kWorld);
  const auto settle = [&](const Peer& fake_world, const Peer& fake_haptic) {
    return Eventually([&] {
      return ReadHapticHealth(*haptic_view).peer_epoch == fake_world.epoch() &&
             ReadWorldHealth(*world_view).peer_epoch == fake_haptic.epoch();
    });
  };
  Usage haptic_usage;
  Usage world_usage;
  for (int i = 0; i <= restarts; ++i) {
    const Peer fake_world(with_haptic, Role::kWorld);
    const Peer fake_haptic(with_world, Role::kHaptic);
    REQUIRE(settle(fake_world, fake_haptic));
    if (i == 5) {  // everything that is made once has been made
      Pause(500);  // the view before this one is given back within two polls of the attacher
      haptic_usage = UsageOf(haptic.pid());
      world_usage = UsageOf(world.pid());
      CHECK(haptic_usage.segments >= 2);
      CHECK(world_usage.segments >= 2);
    }
    if (i == restarts) {
      CHECK(Eventually([&] { return HoldsAs(haptic.pid(), haptic_usage); }, 3));
      CHECK(Eventually([&] { return HoldsAs(world.pid(), world_usage); }, 3));
      INFO(haptic_usage.descriptors << " " << haptic_usage.mappings << " now "
                                    << UsageOf(haptic.pid()).mappings);
    }
  }
}
