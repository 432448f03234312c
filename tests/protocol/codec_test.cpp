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

using Words = std::array<std::uint64_t, 600>;
static_assert(sizeof(Words) >= kHapticHealthBytes);

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
  CHECK(Encode(frame, words).used_bytes == 104 + 32 * 64);
  frame.planes[31].stiffness = 1;
  CHECK(Encode(frame, words).used_bytes == kWorldFrameBytes);
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
  frame.planes[1] = {3, 4, 5, 6, {7, 8, 9}, {0, 0, 1}, 10, 11};
  Encode(frame, words);
  CHECK(at(32, std::uint64_t{}) == frame.acked_tick);
  CHECK(at(100, std::uint32_t{}) == 2);
  CHECK(at(104 + 64 + 12, std::uint32_t{}) == 6);
  CHECK(at(104 + 64 + 56, double{}) == 1);
  CHECK(at(104 + 2 * 64 + 16 + 8, double{}) == 11);
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
          {"reason 15", [](auto& m) { m.pointers[0].reason = static_cast<ForceReason>(15); },
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
  } while (sound.plane_count < 2 || sound.planes[0].stiffness == 0);
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
      });
}

TEST_CASE("nonsensical health is refused") {
  using S = DecodeStatus;
  CheckRefused<HapticHealth>(
      Generator(7).Haptic(),
      {
          {"reason", [](auto& m) { m.reason = static_cast<ForceReason>(15); }, S::kEnumerator},
          {"peer", [](auto& m) { m.peer_state = static_cast<PeerState>(6); }, S::kEnumerator},
          {"force", [](auto& m) { m.largest_force = kNaN; }, S::kNotFinite},
          {"step", [](auto& m) { m.largest_force_step = kNaN; }, S::kNotFinite},
          {"slew", [](auto& m) { m.slew_limit = kInfinity; }, S::kNotFinite},
          {"target", [](auto& m) { m.target[1] = kNaN; }, S::kNotFinite},
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
    sum += (m.planes[i].stiffness + m.planes[i].damping) * 0;
    if (std::abs(std::hypot(n[0], n[1], n[2]) - 1) > 1e-12) return false;
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
                      static_cast<std::uint32_t>(random() % 4)};
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
