// SPDX-License-Identifier: MIT
#include "protocol/codec.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::Generator;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Words = std::array<std::uint64_t, 1800>;
static_assert(sizeof(Words) >= kWorldFrameBytes && sizeof(Words) >= kHapticHealthBytes);

template <typename Message>
void CheckRoundTrip(const Message& message) {
  Words words{};
  const Encoded encoded = Encode(message, words);
  REQUIRE(encoded.used_bytes > 0);
  REQUIRE(encoded.used_bytes <= StreamOf<Message>::kBytes);
  REQUIRE(encoded.used_bytes % 8 == 0);
  Message got;
  REQUIRE(Decode(words, encoded, got) == DecodeStatus::kOk);
  // The structs have no padding, and sound messages no NaN: equal bits are equal messages.
  REQUIRE(std::memcmp(&message, &got, sizeof got) == 0);
}

TEST_CASE("messages come back as they were sent") {
  Generator generator(1);
  for (int i = 0; i < 2000; ++i) {
    CheckRoundTrip(generator.Tick());
    CheckRoundTrip(generator.Frame());
    CheckRoundTrip(generator.Haptic());
    CheckRoundTrip(generator.World());
  }
}

TEST_CASE("bodies come back as they were sent") {
  Generator generator(2);
  for (const std::uint32_t size : {0u, 1u, 7u, kMaxBodies}) {
    std::vector<Body> bodies(size);
    for (Body& body : bodies) body = generator.OneBody();
    std::vector<std::uint64_t> words(WorldBodiesBytes(size) / 8);
    const Encoded encoded = Encode(bodies, words);
    REQUIRE(encoded.used_bytes == WorldBodiesBytes(size));
    std::vector<Body> got(size);
    std::uint32_t count = 99;
    REQUIRE(Decode(words, encoded, got, count) == DecodeStatus::kOk);
    REQUIRE(count == size);
    if (size > 0) CHECK(std::memcmp(got.data(), bodies.data(), size * sizeof(Body)) == 0);
  }
}

TEST_CASE("a message is as long as what it uses") {
  Words words{};
  HapticTick tick;
  CHECK(Encode(tick, words).used_bytes == 80);
  tick.pointer_count = 1;
  CHECK(Encode(tick, words).used_bytes == 80 + 88);
  tick.pointers[0].torque[2] = 1;
  CHECK(Encode(tick, words).used_bytes == 80 + 88 + 80);
  CHECK(Encode(tick, words).blocks == kTickRotations);
  tick.channel_count = 1;
  tick.ground.impulse[0] = 1;
  CHECK(Encode(tick, words).used_bytes == 80 + 88 + 80 + 144 + 48);
  CHECK(Encode(tick, words).blocks == (kTickRotations | kTickGround));
  tick.pointer_count = kMaxPointers;
  tick.channel_count = kMaxChannels;
  CHECK(Encode(tick, words).used_bytes == kHapticTickBytes);
  WorldFrame frame;
  CHECK(Encode(frame, words).used_bytes == 104);
  frame.plane_count = kMaxPlanes;
  std::uint32_t bytes = 104 + 32 * 64;
  CHECK(Encode(frame, words).used_bytes == bytes);
  const auto grows_by = [&](std::uint32_t more, std::uint32_t blocks) {
    bytes += more;
    CHECK(Encode(frame, words).used_bytes == bytes);
    CHECK(Encode(frame, words).blocks == blocks);
  };
  frame.planes[31].stiffness = 1;
  grows_by(32 * 16, kFrameSurfaces);
  frame.planes[7].velocity[1] = 1;
  grows_by(32 * 24, kFrameSurfaces | kFrameVelocities);
  frame.planes[0].dynamic_friction = 1;
  grows_by(32 * 16, kFrameSurfaces | kFrameVelocities | kFrameFriction);
  frame.planes[31].recovery_s = 1;
  grows_by(32 * 8, kFrameSurfaces | kFrameVelocities | kFrameFriction | kFrameRecovery);
  frame.local_body_count = 1;
  grows_by(16 + 224, 31);
  frame.local_bodies[0].contact_count = 1;
  grows_by(136, 31);
  frame.planes[5].inverse_mass = 0;  // "it cannot move" is no default
  grows_by(32 * 8, 31 | kFrameMobility);
  frame.planes[2].radius = 1;
  grows_by(32 * 8, 31 | kFrameMobility | kFrameRounding);
  frame.local_body_count = kMaxLocalBodies;
  for (LocalBody& body : frame.local_bodies) body.contact_count = kMaxContactPlanes;
  CHECK(Encode(frame, words).used_bytes == kWorldFrameBytes);
  HapticHealth health;
  CHECK(Encode(health, words).used_bytes == kHapticHealthBytes - 24 - 32);
  health.reconciliation.frames = 1;
  CHECK(Encode(health, words).used_bytes == kHapticHealthBytes - 32);
  health.energy.injected = -1e-9;
  CHECK(Encode(health, words).used_bytes == kHapticHealthBytes);
  health.reconciliation.frames = 0;
  CHECK(Encode(health, words).used_bytes == kHapticHealthBytes - 24);
  WorldScene scene;
  CHECK(Encode(scene, words).used_bytes == 120);
  scene.bodies.resize(2);
  scene.bodies[1].collider_count = 1;
  scene.colliders.resize(1);
  CHECK(Encode(scene, words).used_bytes == 120 + 2 * 80 + 120);
  CHECK(Encode(scene, words).blocks == 0);
  scene.colliders[0].shape = ShapeType::kMesh;
  scene.meshes.resize(1);
  CHECK(Encode(scene, words).used_bytes == 120 + 2 * 80 + 120 + 256);
  CHECK(Encode(scene, words).blocks == kSceneMeshes);
}

TEST_CASE("fields lie where SPEC.md section 6 puts them") {
  Words words{};
  const auto at = [&words](std::size_t offset, auto value) {
    std::memcpy(&value, reinterpret_cast<const char*>(words.data()) + offset, sizeof value);
    return value;
  };
  HapticTick tick = Generator(3).Tick();
  tick.pointer_count = 2;
  tick.channel_count = 1;
  tick.pointers[1].force = {1, 2, 3};
  tick.pointers[1].orientation = {0, 1, 0, 0};
  tick.channels[0].impulse = {-5, 6, 7};
  tick.ground.impulse = {8, 9, 10};
  Encode(tick, words);
  CHECK(at(0, std::uint64_t{}) == tick.tick);
  CHECK(at(24, std::uint64_t{}) == tick.previous_duration_ns);
  CHECK(at(64, double{}) == tick.force_cap);
  CHECK(at(72, std::uint32_t{}) == 2);
  CHECK(at(76, std::uint32_t{}) == 1);
  CHECK(at(80 + 88 + 64, double{}) == 1);                // second pointer, force x
  CHECK(at(80 + 2 * 88 + 24, std::int64_t{}) == -5);     // channel, J x
  CHECK(at(80 + 2 * 88 + 144 + 80 + 8, double{}) == 1);  // second rotation, x of w x y z
  CHECK(at(80 + 2 * 88 + 144 + 2 * 80 + 16, std::int64_t{}) == 10);  // ground, J z
  WorldFrame frame = Generator(4).Frame();
  frame.plane_count = 2;
  frame.planes[1] = {3, 4, 5, 6, {7, 8, 9}, {0, 0, 1}, 10, 11, {12, 13, 14}, 15, 16, 17, 21};
  frame.local_body_count = 2;
  frame.local_bodies[0].contact_count = 1;
  frame.local_bodies[1].contact_count = 2;
  frame.local_bodies[1].mass = 18;
  frame.local_bodies[1].contacts[1].gap = 19;
  frame.local_bodies[1].contacts[1].radius = 20;
  Encode(frame, words);
  CHECK(at(32, std::uint64_t{}) == frame.acked_tick);
  CHECK(at(100, std::uint32_t{}) == 2);
  CHECK(at(104 + 64 + 12, std::uint32_t{}) == 6);
  CHECK(at(104 + 64 + 56, double{}) == 1);
  CHECK(at(104 + 2 * 64 + 16 + 8, double{}) == 11);
  const std::size_t velocities = 104 + 2 * 64 + 2 * 16;
  CHECK(at(velocities + 24 + 16, double{}) == 14);
  CHECK(at(velocities + 2 * 24 + 16, double{}) == 15);
  CHECK(at(velocities + 2 * 24 + 2 * 16 + 8, double{}) == 17);
  const std::size_t local = velocities + 2 * 24 + 2 * 16 + 2 * 8;
  CHECK(at(local, std::uint32_t{}) == 2);
  CHECK(at(local + 16 + 224 + 16, double{}) == 18);
  const std::size_t contact = local + 16 + 2 * 224 + 2 * 136;  // the second of the second body
  CHECK(at(contact + 56, double{}) == 19);
  CHECK(at(contact + 128, double{}) == 20);
  CHECK(at(contact + 136 + 8, double{}) == 21);  // behind the local bodies: the second mobility
}

TEST_CASE("impossible counts and short buffers are not encoded") {
  Words words{};
  HapticTick tick;
  tick.pointer_count = kMaxPointers + 1;
  CHECK(Encode(tick, words).used_bytes == 0);
  tick.pointer_count = 0;
  tick.channel_count = kMaxChannels + 1;
  CHECK(Encode(tick, words).used_bytes == 0);
  WorldFrame frame;
  frame.plane_count = kMaxPlanes + 1;
  CHECK(Encode(frame, words).used_bytes == 0);
  frame.plane_count = 0;
  frame.local_body_count = kMaxLocalBodies + 1;
  CHECK(Encode(frame, words).used_bytes == 0);
  frame.local_body_count = 1;
  frame.local_bodies[0].contact_count = kMaxContactPlanes + 1;
  CHECK(Encode(frame, words).used_bytes == 0);
  WorldScene scene;
  scene.bodies.resize(1);
  scene.bodies[0].collider_count = 1;
  CHECK(Encode(scene, words).used_bytes == 0);
  scene.colliders.resize(1);
  CHECK(Encode(scene, words).used_bytes > 0);
  scene.colliders[0].shape = ShapeType::kMesh;
  CHECK(Encode(scene, words).used_bytes == 0);
  const auto short_words = std::span(words).first(9);
  CHECK(Encode(HapticTick{}, short_words).used_bytes == 0);
  CHECK(Encode(WorldFrame{}, short_words).used_bytes == 0);
  CHECK(Encode(HapticHealth{}, short_words).used_bytes == 0);
  CHECK(Encode(WorldHealth{}, short_words).used_bytes == 0);
  const std::vector<Body> bodies(1);
  CHECK(Encode(bodies, short_words).used_bytes == 0);
}

template <typename Message>
struct Nonsense {
  const char* what;
  std::function<void(Message&)> spoil;
  DecodeStatus status;
};

/// Spoils a sound message, sends it, and expects the refusal and an untouched receiver.
template <typename Message>
void CheckRefused(const Message& sound, const std::vector<Nonsense<Message>>& cases) {
  for (const auto& one : cases) {
    INFO(one.what);
    Words words{};
    Message spoiled = sound;
    one.spoil(spoiled);
    const Encoded encoded = Encode(spoiled, words);
    REQUIRE(encoded.used_bytes > 0);
    Message got = sound;
    CHECK(Decode(words, encoded, got) == one.status);
    CHECK(std::memcmp(&got, &sound, sizeof got) == 0);
  }
}

TEST_CASE("a nonsensical tick is refused") {
  Generator generator(5);
  HapticTick sound;
  do {
    sound = generator.Tick();
  } while (sound.pointer_count < 2 || sound.channel_count < 1 ||
           sound.pointers[0].torque == Vector{});
  using S = DecodeStatus;
  CheckRefused<HapticTick>(
      sound,
      {
          {"period 0", [](auto& m) { m.period_ns = 0; }, S::kRange},
          {"period 11 s", [](auto& m) { m.period_ns = 11'000'000'000; }, S::kRange},
          {"stiffness NaN", [](auto& m) { m.stiffness = kNaN; }, S::kNotFinite},
          {"stiffness < 0", [](auto& m) { m.stiffness = -1; }, S::kRange},
          {"damping", [](auto& m) { m.damping = kInfinity; }, S::kNotFinite},
          {"damping < 0", [](auto& m) { m.damping = -1; }, S::kRange},
          {"force cap", [](auto& m) { m.force_cap = -kInfinity; }, S::kNotFinite},
          {"force cap < 0", [](auto& m) { m.force_cap = -1; }, S::kRange},
          {"pointer 4", [](auto& m) { m.pointers[1].pointer = 4; }, S::kIdentity},
          {"pointer huge", [](auto& m) { m.pointers[1].pointer = ~0u; }, S::kIdentity},
          {"pointer twice", [](auto& m) { m.pointers[1].pointer = m.pointers[0].pointer; },
           S::kIdentity},
          {"reason 18", [](auto& m) { m.pointers[0].reason = static_cast<ForceReason>(18); },
           S::kEnumerator},
          {"radius", [](auto& m) { m.pointers[0].radius = kNaN; }, S::kNotFinite},
          {"radius < 0", [](auto& m) { m.pointers[0].radius = -1e-9; }, S::kRange},
          {"position", [](auto& m) { m.pointers[1].position[2] = kNaN; }, S::kNotFinite},
          {"velocity", [](auto& m) { m.pointers[1].velocity[0] = kInfinity; }, S::kNotFinite},
          {"force", [](auto& m) { m.pointers[0].force[1] = kNaN; }, S::kNotFinite},
          {"torque", [](auto& m) { m.pointers[0].torque[1] = kNaN; }, S::kNotFinite},
          {"spin", [](auto& m) { m.pointers[0].angular_velocity[1] = kNaN; }, S::kNotFinite},
          {"quaternion short",
           [](auto& m) {
             for (double& q : m.pointers[0].orientation) q *= 0.98;
           },
           S::kQuaternion},
          {"quaternion long",
           [](auto& m) {
             for (double& q : m.pointers[0].orientation) q *= 1.02;
           },
           S::kQuaternion},
          {"quaternion zero",
           [](auto& m) {
             m.pointers[0].orientation = {0, 0, 0, 0};
           },
           S::kQuaternion},
          {"quaternion NaN", [](auto& m) { m.pointers[0].orientation[3] = kNaN; }, S::kNotFinite},
          {"channel's pointer", [](auto& m) { m.channels[0].pointer = 4; }, S::kIdentity},
          {"channel's state 0", [](auto& m) { m.channels[0].state = static_cast<ChannelState>(0); },
           S::kEnumerator},
          {"channel's state 3", [](auto& m) { m.channels[0].state = static_cast<ChannelState>(3); },
           S::kEnumerator},
          {"opened in future", [](auto& m) { m.channels[0].opened_tick = m.tick + 1; }, S::kRange},
          {"moment", [](auto& m) { m.channels[0].first_moment[0] = kNaN; }, S::kNotFinite},
          {"angular moment", [](auto& m) { m.channels[0].angular_first_moment[0] = kNaN; },
           S::kNotFinite},
          {"contact", [](auto& m) { m.channels[0].contact_point[2] = kNaN; }, S::kNotFinite},
      });
}

TEST_CASE("a nonsensical frame is refused") {
  Generator generator(6);
  WorldFrame sound;
  do {
    sound = generator.Frame();
  } while (sound.plane_count < 2 || sound.planes[0].stiffness == 0 ||
           sound.planes[0].recovery_s == 0);
  using S = DecodeStatus;
  CheckRefused<WorldFrame>(
      sound,
      {
          {"frame 0", [](auto& m) { m.frame = 0; }, S::kRange},
          {"period 0", [](auto& m) { m.period_ns = 0; }, S::kRange},
          {"ack before baseline", [](auto& m) { m.baseline_tick = m.acked_tick + 1; }, S::kRange},
          {"coupling 0", [](auto& m) { m.coupling = static_cast<Coupling>(0); }, S::kEnumerator},
          {"coupling 4", [](auto& m) { m.coupling = static_cast<Coupling>(4); }, S::kEnumerator},
          {"pointer 4", [](auto& m) { m.planes[1].pointer = 4; }, S::kIdentity},
          {"point", [](auto& m) { m.planes[1].point[0] = kInfinity; }, S::kNotFinite},
          {"normal NaN", [](auto& m) { m.planes[1].normal[0] = kNaN; }, S::kNotFinite},
          {"normal huge", [](auto& m) { m.planes[1].normal.fill(1.7e308); }, S::kNotFinite},
          {"normal zero",
           [](auto& m) {
             m.planes[1].normal = {0, 0, 0};
           },
           S::kNormal},
          {"normal tiny",
           [](auto& m) {
             m.planes[1].normal = {1e-12, 0, 0};
           },
           S::kNormal},
          {"stiffness", [](auto& m) { m.planes[0].stiffness = kNaN; }, S::kNotFinite},
          {"stiffness < 0", [](auto& m) { m.planes[0].stiffness = -1; }, S::kRange},
          {"damping", [](auto& m) { m.planes[0].damping = kInfinity; }, S::kNotFinite},
          {"damping < 0", [](auto& m) { m.planes[0].damping = -1; }, S::kRange},
          {"velocity", [](auto& m) { m.planes[1].velocity[2] = kNaN; }, S::kNotFinite},
          {"friction", [](auto& m) { m.planes[1].static_friction = kNaN; }, S::kNotFinite},
          {"friction < 0", [](auto& m) { m.planes[1].static_friction = -1; }, S::kRange},
          {"sliding", [](auto& m) { m.planes[1].dynamic_friction = kInfinity; }, S::kNotFinite},
          {"sliding < 0", [](auto& m) { m.planes[1].dynamic_friction = -1; }, S::kRange},
          {"recovery", [](auto& m) { m.planes[1].recovery_s = kNaN; }, S::kNotFinite},
          {"recovery < 0", [](auto& m) { m.planes[1].recovery_s = -1; }, S::kRange},
          {"recovery 11 s", [](auto& m) { m.planes[1].recovery_s = 11; }, S::kRange},
          {"mobility", [](auto& m) { m.planes[1].inverse_mass = kNaN; }, S::kNotFinite},
          {"mobility infinite", [](auto& m) { m.planes[1].inverse_mass = kInfinity; },
           S::kNotFinite},
          {"mobility < 0", [](auto& m) { m.planes[1].inverse_mass = -1e-9; }, S::kRange},
          {"mobility nearly not said",
           [](auto& m) { m.planes[1].inverse_mass = std::nextafter(kMobilityNotSaid, 0); },
           S::kRange},
          {"mobility below not said",
           [](auto& m) { m.planes[1].inverse_mass = std::nextafter(kMobilityNotSaid, -2); },
           S::kRange},
          {"rounding", [](auto& m) { m.planes[1].radius = kNaN; }, S::kNotFinite},
          {"rounding infinite", [](auto& m) { m.planes[1].radius = kInfinity; }, S::kNotFinite},
          {"rounding < 0", [](auto& m) { m.planes[1].radius = -1e-9; }, S::kRange},
      });
}

TEST_CASE("a nonsensical local body is refused") {
  Generator generator(14);
  WorldFrame sound;
  do {
    sound = generator.Frame();
  } while (sound.local_body_count < 2 || sound.local_bodies[1].contact_count < 2);
  using S = DecodeStatus;
  const auto body = [](auto spoil) { return [spoil](WorldFrame& m) { spoil(m.local_bodies[1]); }; };
  const auto contact = [](auto spoil) {
    return [spoil](WorldFrame& m) { spoil(m.local_bodies[1].contacts[1]); };
  };
  using Inertia = std::array<double, 6>;
  CheckRefused<WorldFrame>(
      sound,
      {
          {"substep 0", [](auto& m) { m.local_substep_ns = 0; }, S::kRange},
          {"substep 11 s", [](auto& m) { m.local_substep_ns = 11'000'000'000; }, S::kRange},
          {"body twice", [](auto& m) { m.local_bodies[1].body = m.local_bodies[0].body; },
           S::kIdentity},
          {"mass NaN", body([](auto& b) { b.mass = kNaN; }), S::kNotFinite},
          {"mass 0", body([](auto& b) { b.mass = 0; }), S::kRange},
          {"mass tiny", body([](auto& b) { b.mass = 1e-10; }), S::kRange},
          {"mass huge", body([](auto& b) { b.mass = 1e10; }), S::kRange},
          {"inertia NaN", body([](auto& b) { b.inertia[4] = kNaN; }), S::kNotFinite},
          {"inertia 0", body([](auto& b) { b.inertia = Inertia{}; }), S::kRange},
          {"inertia < 0", body([](auto& b) { b.inertia[3] = -1; }), S::kRange},
          {"inertia flat", body([](auto& b) { b.inertia = Inertia{1, 1, 0, 1, 0, 1}; }), S::kRange},
          {"inertia indefinite", body([](auto& b) { b.inertia = Inertia{1, 0, 0, 1, 2, 1}; }),
           S::kRange},
          {"inertia huge", body([](auto& b) { b.inertia = Inertia{1e308, 0, 0, 1e308, 0, 1e308}; }),
           S::kRange},
          {"position", body([](auto& b) { b.position[0] = kNaN; }), S::kNotFinite},
          {"orientation", body([](auto& b) { b.orientation = Quaternion{}; }), S::kQuaternion},
          {"velocity", body([](auto& b) { b.velocity[0] = kInfinity; }), S::kNotFinite},
          {"spin", body([](auto& b) { b.angular_velocity[0] = kNaN; }), S::kNotFinite},
          {"acceleration", body([](auto& b) { b.acceleration[0] = kNaN; }), S::kNotFinite},
          {"turning", body([](auto& b) { b.angular_acceleration[0] = kNaN; }), S::kNotFinite},
          {"point", contact([](auto& c) { c.point[1] = kNaN; }), S::kNotFinite},
          {"normal zero", contact([](auto& c) { c.normal = Vector{}; }), S::kNormal},
          {"normal NaN", contact([](auto& c) { c.normal[1] = kNaN; }), S::kNotFinite},
          {"gap", contact([](auto& c) { c.gap = kInfinity; }), S::kNotFinite},
          {"friction", contact([](auto& c) { c.friction = kNaN; }), S::kNotFinite},
          {"friction < 0", contact([](auto& c) { c.friction = -1; }), S::kRange},
          {"other velocity", contact([](auto& c) { c.other_velocity[1] = kNaN; }), S::kNotFinite},
          {"other mass", contact([](auto& c) { c.other_inverse_mass = kNaN; }), S::kNotFinite},
          {"other mass < 0", contact([](auto& c) { c.other_inverse_mass = -1; }), S::kRange},
          {"impulse", contact([](auto& c) { c.impulse[1] = kNaN; }), S::kNotFinite},
          {"rounding", contact([](auto& c) { c.radius = kNaN; }), S::kNotFinite},
          {"rounding < 0", contact([](auto& c) { c.radius = -1e-9; }), S::kRange},
      });
}

TEST_CASE("counts within the block of local bodies bound what is read") {
  Generator generator(15);
  WorldFrame sound;
  do {
    sound = generator.Frame();
  } while (sound.local_body_count != 2 || sound.local_bodies[1].contact_count < 2);
  Words words{};
  const Encoded right = Encode(sound, words);
  const std::uint32_t contacts_sent =
      sound.local_bodies[0].contact_count + sound.local_bodies[1].contact_count;
  const std::uint32_t behind = ((right.blocks & kFrameMobility) != 0 ? 8 * sound.plane_count : 0) +
                               ((right.blocks & kFrameRounding) != 0 ? 8 * sound.plane_count : 0);
  const std::uint32_t local = right.used_bytes - behind - 16 - 2 * 224 - 136 * contacts_sent;
  const auto with = [&](std::uint32_t offset, std::uint32_t value, Encoded encoded) {
    Words spoiled = words;
    std::memcpy(reinterpret_cast<char*>(spoiled.data()) + offset, &value, sizeof value);
    WorldFrame got;
    return Decode(spoiled, encoded, got);
  };
  REQUIRE(with(local, 2, right) == DecodeStatus::kOk);
  CHECK(with(local, 1, right) == DecodeStatus::kLength);
  CHECK(with(local, 4, right) != DecodeStatus::kOk);
  CHECK(with(local, 5, right) == DecodeStatus::kCount);
  CHECK(with(local, ~0u, right) == DecodeStatus::kCount);
  const std::uint32_t contacts = local + 16 + 224 + 8;  // of the second body
  CHECK(with(contacts, 17, right) == DecodeStatus::kCount);
  CHECK(with(contacts, ~0u, right) == DecodeStatus::kCount);
  CHECK(with(contacts, 1, right) == DecodeStatus::kLength);
  for (std::uint32_t bytes = 0; bytes < right.used_bytes; bytes += 8) {
    WorldFrame got;
    CHECK(Decode(words, {bytes, right.blocks}, got) == DecodeStatus::kLength);
    CHECK(Decode(std::span<const std::uint64_t>(words).first(bytes / 8), right, got) ==
          DecodeStatus::kLength);
  }
  // Behind the block that this version knows last, a later one may put more.
  CHECK(with(local, 2, {right.used_bytes + 40, right.blocks | 128}) == DecodeStatus::kOk);
}

TEST_CASE("a frame that says no mobility leaves every plane's not said, and 0 is not the same") {
  Words words{};
  WorldFrame frame;
  frame.frame = 1;
  frame.period_ns = 1;
  frame.plane_count = 2;
  frame.planes[0].normal = frame.planes[1].normal = {0, 0, 1};
  WorldFrame got;
  got.planes[0].inverse_mass = 77;
  Encoded encoded = Encode(frame, words);
  CHECK(encoded.blocks == 0);
  REQUIRE(Decode(words, encoded, got) == DecodeStatus::kOk);
  CHECK(got.planes[0].inverse_mass == kMobilityNotSaid);
  frame.planes[1].inverse_mass = 0;
  encoded = Encode(frame, words);
  CHECK(encoded.blocks == kFrameMobility);
  REQUIRE(Decode(words, encoded, got) == DecodeStatus::kOk);
  CHECK(got.planes[0].inverse_mass == kMobilityNotSaid);
  CHECK(got.planes[1].inverse_mass == 0);
}

TEST_CASE("scenes come back as they were sent") {
  Generator generator(16);
  for (int i = 0; i < 300; ++i) {
    const WorldScene scene = generator.Scene();
    std::vector<std::uint64_t> words(WorldSceneBytes(20, 80, 80) / 8);
    const Encoded encoded = Encode(scene, words);
    REQUIRE(encoded.used_bytes > 0);
    WorldScene got;
    REQUIRE(Decode(words, encoded, got) == DecodeStatus::kOk);
    std::vector<std::uint64_t> again(words.size());
    REQUIRE(Encode(got, again).used_bytes == encoded.used_bytes);
    REQUIRE(again == words);
    REQUIRE(got.bodies.size() == scene.bodies.size());
    REQUIRE(got.meshes.size() == scene.meshes.size());
    // Without the block, a mesh has no place.
    if (scene.meshes.empty()) continue;
    const auto without = static_cast<std::uint32_t>(scene.meshes.size()) * 256;
    REQUIRE(Decode(words, {encoded.used_bytes - without, 0}, got) == DecodeStatus::kOk);
    CHECK(got.meshes.size() == scene.meshes.size());
    CHECK(got.meshes[0].path[0] == 0);
  }
}

TEST_CASE("a nonsensical scene is refused") {
  Generator generator(17);
  WorldScene sound;
  do {
    sound = generator.Scene();
  } while (sound.bodies.size() < 3 || sound.colliders.size() < 3 || sound.meshes.empty() ||
           sound.colliders[0].shape == ShapeType::kMesh);
  std::vector<std::uint64_t> words(WorldSceneBytes(20, 80, 80) / 8);
  const auto decode = [&](const std::function<void(WorldScene&)>& spoil) {
    WorldScene spoiled = sound;
    spoil(spoiled);
    const Encoded encoded = Encode(spoiled, words);
    REQUIRE(encoded.used_bytes > 0);
    WorldScene got;
    const DecodeStatus status = Decode(words, encoded, got);
    CHECK((got.revision != 0) == (status == DecodeStatus::kOk));
    return status;
  };
  using S = DecodeStatus;
  CHECK(decode([](auto&) {}) == S::kOk);
  CHECK(decode([](auto& m) { m.revision = 0; }) == S::kRange);
  CHECK(decode([](auto& m) { m.needs = m.left_out = 1; }) == S::kRange);
  CHECK(decode([](auto& m) { m.gravity[2] = kNaN; }) == S::kNotFinite);
  CHECK(decode([](auto& m) { m.bodies[1].fixed = 2; }) == S::kEnumerator);
  CHECK(decode([](auto& m) { m.colliders[0].colour[0] = 1.5; }) == S::kRange);
  CHECK(decode([](auto& m) { m.colliders[0].colour[3] = kNaN; }) == S::kNotFinite);
  CHECK(decode([](auto& m) { m.colliders[0].position[0] = kNaN; }) == S::kNotFinite);
  CHECK(decode([](auto& m) { m.colliders[0].orientation = Quaternion{}; }) == S::kQuaternion);
  CHECK(decode([](auto& m) { m.colliders[0].dimensions[0] = kInfinity; }) == S::kNotFinite);
  const auto shaped = [&](ShapeType shape, const Vector& dimensions) {
    return decode([&](auto& m) {
      m.colliders[0].shape = shape;
      m.colliders[0].dimensions = dimensions;
    });
  };
  CHECK(shaped(static_cast<ShapeType>(0), {1, 1, 1}) == S::kEnumerator);
  CHECK(shaped(static_cast<ShapeType>(8), {1, 1, 1}) == S::kEnumerator);
  CHECK(shaped(ShapeType::kBox, {1, 1, 1}) == S::kOk);
  CHECK(shaped(ShapeType::kBox, {1, 1, 0}) == S::kRange);
  CHECK(shaped(ShapeType::kSphere, {1, 0, 0}) == S::kOk);
  CHECK(shaped(ShapeType::kSphere, {-1, 0, 0}) == S::kRange);
  CHECK(shaped(ShapeType::kCylinder, {1, 0, 0}) == S::kRange);
  CHECK(shaped(ShapeType::kCapsule, {1, 0, 0}) == S::kOk);
  CHECK(shaped(ShapeType::kCapsule, {1, -1, 0}) == S::kRange);
  CHECK(shaped(ShapeType::kHalfSpace, {0, 0, 0}) == S::kNormal);
  CHECK(shaped(ShapeType::kHalfSpace, {0, 0, -2}) == S::kOk);

  // Counts that do not agree, whatever length is said.
  Encode(sound, words);
  const auto counted = [&](std::uint32_t bodies, std::uint32_t colliders) {
    std::vector<std::uint64_t> spoiled = words;
    spoiled[14] = bodies | static_cast<std::uint64_t>(colliders) << 32;
    WorldScene got;
    return Decode(spoiled, {static_cast<std::uint32_t>(words.size() * 8), 1}, got);
  };
  const auto bodies = static_cast<std::uint32_t>(sound.bodies.size());
  const auto colliders = static_cast<std::uint32_t>(sound.colliders.size());
  CHECK(counted(bodies, colliders) == S::kLength);
  CHECK(counted(bodies, colliders - 1) == S::kCount);
  CHECK(counted(kMaxBodies, colliders) == S::kLength);
  CHECK(counted(kMaxBodies + 1, colliders) == S::kCount);
  CHECK(counted(bodies, kMaxColliders + 1) == S::kCount);
  CHECK(counted(~0u, ~0u) == S::kCount);
}

TEST_CASE("nonsensical health is refused") {
  using S = DecodeStatus;
  CheckRefused<HapticHealth>(
      Generator(7).Haptic(),
      {
          {"reason", [](auto& m) { m.reason = static_cast<ForceReason>(18); }, S::kEnumerator},
          {"peer", [](auto& m) { m.peer_state = static_cast<PeerState>(6); }, S::kEnumerator},
          {"force", [](auto& m) { m.largest_force = kNaN; }, S::kNotFinite},
          {"step", [](auto& m) { m.largest_force_step = kNaN; }, S::kNotFinite},
          {"slew", [](auto& m) { m.slew_limit = kInfinity; }, S::kNotFinite},
          {"target", [](auto& m) { m.target[1] = kNaN; }, S::kNotFinite},
          {"jump",
           [](auto& m) {
             m.reconciliation = Reconciliation{1, kNaN, 1};
           },
           S::kNotFinite},
          {"jump < 0",
           [](auto& m) {
             m.reconciliation = Reconciliation{1, 1, -1};
           },
           S::kRange},
          {"injected", [](auto& m) { m.energy.injected = kNaN; }, S::kNotFinite},
          {"dissipated", [](auto& m) { m.energy.dissipated = kInfinity; }, S::kNotFinite},
          {"dissipated < 0", [](auto& m) { m.energy.dissipated = -1e-9; }, S::kRange},
          {"unstable", [](auto& m) { m.energy.unstable = 2; }, S::kEnumerator},
          {"controller", [](auto& m) { m.energy.controller = 2; }, S::kEnumerator},
          {"period", [](auto& m) { m.period_ns = 0; }, S::kRange},
      });
  CheckRefused<WorldHealth>(
      Generator(8).World(),
      {
          {"coupling", [](auto& m) { m.coupling = static_cast<Coupling>(9); }, S::kEnumerator},
          {"peer", [](auto& m) { m.peer_state = static_cast<PeerState>(6); }, S::kEnumerator},
          {"penalty", [](auto& m) { m.penalty_impulse[2] = kNaN; }, S::kNotFinite},
          {"period", [](auto& m) { m.period_ns = 0; }, S::kRange},
      });
}

TEST_CASE("nonsensical bodies are refused") {
  const auto decode = [](const std::function<void(Body&)>& spoil, std::size_t room = 2) {
    Generator generator(9);
    std::vector<Body> bodies{generator.OneBody(), generator.OneBody()};
    spoil(bodies[1]);
    Words words{};
    const Encoded encoded = Encode(bodies, words);
    std::vector<Body> got(room);
    std::uint32_t count = 77;
    const DecodeStatus status = Decode(words, encoded, got, count);
    if (status != DecodeStatus::kOk) CHECK(count == 77);
    return status;
  };
  CHECK(decode([](Body&) {}) == DecodeStatus::kOk);
  CHECK(decode([](Body&) {}, 1) == DecodeStatus::kCount);
  CHECK(decode([](Body& b) { b.mass = -1; }) == DecodeStatus::kRange);
  CHECK(decode([](Body& b) { b.mass = kNaN; }) == DecodeStatus::kNotFinite);
  CHECK(decode([](Body& b) { b.position[0] = kNaN; }) == DecodeStatus::kNotFinite);
  CHECK(decode([](Body& b) { b.velocity[0] = kInfinity; }) == DecodeStatus::kNotFinite);
  CHECK(decode([](Body& b) { b.angular_velocity[0] = kNaN; }) == DecodeStatus::kNotFinite);
  CHECK(decode([](Body& b) { b.orientation = {0, 0, 0, 0}; }) == DecodeStatus::kQuaternion);
}

TEST_CASE("lengths must agree with counts and blocks") {
  Words words{};
  Generator generator(10);
  HapticTick sound;
  do {
    sound = generator.Tick();
  } while (sound.pointer_count < 1 || sound.channel_count < 1);
  const Encoded right = Encode(sound, words);
  const auto status = [&words](Encoded encoded) {
    HapticTick got;
    return Decode(words, encoded, got);
  };
  REQUIRE(status(right) == DecodeStatus::kOk);
  for (std::uint32_t bytes = 0; bytes < kHapticTickBytes + 80; bytes += 8) {
    if (bytes != right.used_bytes) CHECK(status({bytes, right.blocks}) == DecodeStatus::kLength);
  }
  CHECK(status({~0u, right.blocks}) == DecodeStatus::kLength);
  CHECK(status({right.used_bytes, right.blocks ^ kTickGround}) == DecodeStatus::kLength);
  // A block of a later version may follow behind those known, but not cut them short.
  CHECK(status({right.used_bytes + 64, right.blocks | 4}) == DecodeStatus::kOk);
  CHECK(status({right.used_bytes - 8, right.blocks | 4}) == DecodeStatus::kLength);
  // The private copy ends before the message does.
  HapticTick got;
  CHECK(Decode(std::span<const std::uint64_t>(words).first(right.used_bytes / 8 - 1), right, got) ==
        DecodeStatus::kLength);
  CHECK(Decode(std::span<const std::uint64_t>(), right, got) == DecodeStatus::kLength);
  // Counts beyond what there may be, with any length.
  for (const std::uint64_t counts : {5ull, 17ull << 32, ~0ull, 0xFFFFFFFFull}) {
    Words spoiled = words;
    spoiled[9] = counts;
    CHECK(Decode(spoiled, right, got) == DecodeStatus::kCount);
  }
}

TEST_CASE("directions are renormalised, and exact ones keep their bits") {
  Words words{};
  WorldFrame frame;
  frame.frame = 1;
  frame.period_ns = 1;
  frame.plane_count = 3;
  frame.planes[0].normal = {3, 0, 4};
  frame.planes[1].normal = {0.6, 0, 0.8};
  frame.planes[2].normal = {1e-11, 0, 0};
  WorldFrame got;
  REQUIRE(Decode(words, Encode(frame, words), got) == DecodeStatus::kOk);
  CHECK(got.planes[0].normal == Vector{0.6, 0, 0.8});
  CHECK(got.planes[1].normal == frame.planes[1].normal);
  CHECK(got.planes[2].normal == Vector{1, 0, 0});
  HapticTick tick;
  tick.period_ns = 1;
  tick.pointer_count = 1;
  tick.pointers[0].orientation = {0, 1.005, 0, 0};
  HapticTick got_tick;
  REQUIRE(Decode(words, Encode(tick, words), got_tick) == DecodeStatus::kOk);
  CHECK(got_tick.pointers[0].orientation == Quaternion{0, 1, 0, 0});
}

bool AllFinite(const HapticTick& m) {
  double sum = m.stiffness + m.damping + m.force_cap;
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    const Pointer& p = m.pointers[i];
    sum += p.radius * 0;
    for (const auto& v : {p.position, p.velocity, p.angular_velocity, p.force, p.torque}) {
      for (const double x : v) sum += x * 0;
    }
    for (const double x : p.orientation) sum += x * 0;
  }
  for (std::uint32_t i = 0; i < m.channel_count; ++i) {
    const Channel& c = m.channels[i];
    for (const auto& v : {c.first_moment, c.angular_first_moment, c.contact_point}) {
      for (const double x : v) sum += x * 0;
    }
  }
  return std::isfinite(sum * 0);
}

bool AllFinite(const WorldFrame& m) {
  double sum = 0;
  for (std::uint32_t i = 0; i < m.plane_count; ++i) {
    for (const double x : m.planes[i].point) sum += x * 0;
    const Vector& n = m.planes[i].normal;
    sum += (m.planes[i].stiffness + m.planes[i].damping + m.planes[i].inverse_mass) * 0;
    if (m.planes[i].inverse_mass < 0 && m.planes[i].inverse_mass != kMobilityNotSaid) return false;
    if (std::abs(std::hypot(n[0], n[1], n[2]) - 1) > 1e-12) return false;
  }
  for (std::uint32_t i = 0; i < m.local_body_count; ++i) {
    const LocalBody& b = m.local_bodies[i];
    if (!(b.mass > 0) || b.contact_count > kMaxContactPlanes) return false;
    for (const auto& v : {b.position, b.velocity, b.angular_velocity, b.acceleration}) {
      for (const double x : v) sum += x * 0;
    }
    for (const double x : b.inertia) sum += x * 0;
    for (std::uint32_t j = 0; j < b.contact_count; ++j) {
      const ContactPlane& c = b.contacts[j];
      for (const auto& v : {c.point, c.normal, c.other_velocity, c.impulse}) {
        for (const double x : v) sum += x * 0;
      }
      sum += (c.gap + c.friction + c.other_inverse_mass + c.radius) * 0;
      if (c.radius < 0) return false;
    }
  }
  return std::isfinite(sum);
}

TEST_CASE("whatever the bytes are, what is accepted is finite and within bounds") {
  std::mt19937_64 random(11);
  Generator generator(12);
  int accepted = 0;
  for (int i = 0; i < 60000; ++i) {
    Words words{};
    Encoded tick_encoded = Encode(generator.Tick(), words);
    Words frame_words{};
    Encoded frame_encoded = Encode(generator.Frame(), frame_words);
    if (i % 4 == 0) {
      for (auto& word : words) word = random();
      frame_words = words;
      words[9] = (random() % 18) << 32 | random() % 6;
      tick_encoded = {static_cast<std::uint32_t>(random() % 600 * 8),
                      static_cast<std::uint32_t>(random() % 64)};
      frame_encoded = tick_encoded;
    } else {
      // A few bits flipped, the exponents' above all.
      for (int flips = 0; flips < i % 4; ++flips) {
        words[random() % (tick_encoded.used_bytes / 8)] ^= 0x7FF0000000000000ULL << random() % 2;
        frame_words[random() % (frame_encoded.used_bytes / 8)] ^= 1ULL << random() % 64;
      }
    }
    HapticTick tick;
    if (Decode(words, tick_encoded, tick) == DecodeStatus::kOk) {
      ++accepted;
      REQUIRE(tick.pointer_count <= kMaxPointers);
      REQUIRE(tick.channel_count <= kMaxChannels);
      REQUIRE(AllFinite(tick));
    }
    WorldFrame frame;
    if (Decode(frame_words, frame_encoded, frame) == DecodeStatus::kOk) {
      ++accepted;
      REQUIRE(frame.plane_count <= kMaxPlanes);
      REQUIRE(frame.local_body_count <= kMaxLocalBodies);
      REQUIRE(AllFinite(frame));
    }
  }
  CHECK(accepted > 1000);  // the check above had something to look at
}

TEST_CASE("the histogram of a damaged health message cannot hurt") {
  // All bit patterns of integers are sound; only their sum could overflow, which readers must
  // survive.
  HapticHealth health = Generator(13).Haptic();
  health.lateness.fill(std::numeric_limits<std::uint64_t>::max());
  CheckRoundTrip(health);
}

}  // namespace
}  // namespace rikiseki::protocol
