// SPDX-License-Identifier: MIT
#include "tests/protocol/fixtures.h"

#include <cstring>

namespace rikiseki::protocol::test {
namespace {

/// 1, 2, 3, ... in whatever form a field wants it: no two fields of a message are alike.
class Counter {
 public:
  std::uint32_t Small() { return static_cast<std::uint32_t>(++count_); }
  std::uint64_t Big() { return static_cast<std::uint64_t>(++count_) << 33; }
  double Real() { return static_cast<double>(++count_) / 8; }
  Vector Triple() { return {Real(), -Real(), Real()}; }
  ImpulseUnits Units() {
    const auto one = [this] { return static_cast<std::int64_t>(Big()); };
    return {one(), -one(), one()};
  }
  Histogram Counts() {
    Histogram counts{};
    for (auto& bucket : counts) bucket = Small();
    return counts;
  }

 private:
  std::int64_t count_ = 0;
};

constexpr Vector kDirection{0.6, 0, -0.8};
constexpr Quaternion kOrientation{0.5, -0.5, 0.5, -0.5};

template <std::size_t size>
std::array<char, size> Text(const char* text) {
  std::array<char, size> padded{};
  std::memcpy(padded.data(), text, std::strlen(text));
  return padded;
}

}  // namespace

HapticTick FixtureTick() {
  Counter next;
  HapticTick m;
  m.tick = next.Big();
  m.start_ns = next.Big();
  m.period_ns = 1'000'000;
  m.previous_duration_ns = next.Big();
  m.world_epoch = next.Big();
  m.world_frame = next.Big();
  m.stiffness = next.Real();
  m.damping = next.Real();
  m.force_cap = next.Real();
  m.pointer_count = 2;
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    m.pointers[i] = {2 * i + 1,     ForceReason::kCapped, next.Real(),
                     next.Triple(), kOrientation,         next.Triple(),
                     next.Triple(), next.Triple(),        next.Triple()};
  }
  m.channel_count = 3;
  for (std::uint32_t i = 0; i < m.channel_count; ++i) {
    m.channels[i] = {next.Small(),
                     next.Small(),
                     i,
                     i == 1 ? ChannelState::kClosed : ChannelState::kOpen,
                     next.Small(),
                     next.Units(),
                     next.Units(),
                     next.Triple(),
                     next.Triple(),
                     next.Triple()};
  }
  m.ground = {next.Units(), next.Units()};
  return m;
}

HapticHealth FixtureHapticHealth() {
  Counter next;
  HapticHealth m;
  m.ticks = next.Big();
  m.period_ns = 1'000'000;
  m.missed = next.Big();
  m.worst_missed_in_a_row = next.Big();
  m.reason_ticks = next.Big();
  m.reason = ForceReason::kSoftStart;
  m.peer_state = PeerState::kLate;
  m.peer_epoch = next.Big();
  m.feature_age_ns = next.Big();
  m.zero_force_after_ns = next.Big();
  m.largest_force = next.Real();
  m.largest_force_step = next.Real();
  m.slew_limit = next.Real();
  m.target = next.Triple();
  m.scheduling = {next.Small(), next.Small(), 1, next.Small()};
  m.books = {next.Units(), next.Units(), next.Units(), next.Units(), next.Units(), next.Units()};
  m.minor_faults = next.Big();
  m.major_faults = next.Big();
  m.device = Text<32>("fixture");
  m.lateness = next.Counts();
  m.duration = next.Counts();
  m.reconciliation = {next.Big(), next.Real(), next.Real()};
  m.energy = {next.Real(), next.Real(), next.Big(), 1, 1};
  return m;
}

WorldFrame FixtureFrame() {
  Counter next;
  WorldFrame m;
  m.frame = next.Big();
  m.world_time_ns = next.Big();
  m.period_ns = 50'000'000;
  m.acked_epoch = next.Big();
  m.baseline_tick = next.Big();
  m.acked_tick = next.Big();
  m.applied = next.Units();
  m.discarded = next.Units();
  m.coupling = Coupling::kLocal;
  m.plane_count = 2;
  for (std::uint32_t i = 0; i < m.plane_count; ++i) {
    m.planes[i] = {i,           next.Small(), next.Small(), next.Small(),  next.Triple(),
                   kDirection,  next.Real(),  next.Real(),  next.Triple(), next.Real(),
                   next.Real(), 0.25,         next.Real(),  next.Real()};
  }
  m.local_body_count = 2;
  m.local_substep_ns = 1'000'000;
  for (std::uint32_t i = 0; i < m.local_body_count; ++i) {
    LocalBody& b = m.local_bodies[i];
    b.body = next.Small();
    b.generation = next.Small();
    b.contact_count = i + 1;
    b.mass = next.Real();
    b.inertia = {3 + next.Real(), -0.5, 0.25, 4 + next.Real(), 0.125, 5 + next.Real()};
    b.position = next.Triple();
    b.orientation = kOrientation;
    b.velocity = next.Triple();
    b.angular_velocity = next.Triple();
    b.acceleration = next.Triple();
    b.angular_acceleration = next.Triple();
    for (std::uint32_t j = 0; j < b.contact_count; ++j) {
      b.contacts[j] = {next.Small(), next.Small(),  next.Triple(), kDirection,    -next.Real(),
                       next.Real(),  next.Triple(), next.Real(),   next.Triple(), next.Real()};
    }
  }
  return m;
}

WorldHealth FixtureWorldHealth() {
  Counter next;
  WorldHealth m;
  m.frames = next.Big();
  m.period_ns = 50'000'000;
  m.missed = next.Big();
  m.lapped = next.Big();
  m.peer_state = PeerState::kLost;
  m.coupling = Coupling::kPosition;
  m.peer_epoch = next.Big();
  m.applied = next.Units();
  for (auto& units : m.discarded) units = next.Units();
  m.penalty_impulse = next.Triple();
  m.moving_bodies = next.Big();
  m.resets = next.Big();
  m.scheduling = {next.Small(), next.Small(), 1, next.Small()};
  m.scene = Text<64>("fixture");
  m.lateness = next.Counts();
  m.duration = next.Counts();
  return m;
}

std::vector<Body> FixtureBodies() {
  Counter next;
  std::vector<Body> bodies(2);
  for (Body& b : bodies) {
    b = {next.Small(), next.Small(),  next.Real(),  next.Triple(),
         kOrientation, next.Triple(), next.Triple()};
  }
  return bodies;
}

WorldScene FixtureScene() {
  Counter next;
  WorldScene m;
  m.revision = next.Big();
  m.needs = kNeedMovingBodies | kNeedFriction;
  m.left_out = kNeedDrag;
  m.gravity = next.Triple();
  m.name = Text<64>("fixture");
  for (const std::uint32_t colliders : {1u, 0u, 2u}) {
    const std::uint32_t body = next.Small();
    m.bodies.push_back({body, next.Small(), colliders % 2, colliders, Text<64>("box::link")});
  }
  for (const ShapeType shape : {ShapeType::kBox, ShapeType::kMesh, ShapeType::kCapsule}) {
    m.colliders.push_back({shape,
                           0,
                           {next.Real(), next.Real(), next.Real()},
                           next.Triple(),
                           kOrientation,
                           {0.125, 0.25, 0.5, 1}});
  }
  m.meshes.resize(1);
  for (auto& byte : m.meshes[0].sha256) byte = static_cast<std::uint8_t>(next.Small());
  m.meshes[0].path = Text<224>("meshes/fixture.stl");
  return m;
}

}  // namespace rikiseki::protocol::test
