// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/version.h"
#include "tests/protocol/check_mutants.h"
#include "tests/protocol/check_mutants_common.h"

namespace rikiseki::protocol::test {
namespace {

using check::Difference;
using check::Growth;
using check::Largest;
using check::Totals;
using check::TotalsOf;

constexpr std::int64_t kPeriodNs = 20'000'000;
constexpr double kHalf = 0.03;        // m, of the box at the origin
constexpr double kReach = 0.05;       // m, how near a finger must be for a plane
constexpr double kMass = 1;           // kg
constexpr double kLargestTick = 1.0;  // N s: 10 N times 100 ms
constexpr double kApart = 0.1;        // m
constexpr std::uint32_t kFloor = 0;
constexpr std::uint32_t kBody = 1;
constexpr std::uint32_t kNeighbour = 2;
constexpr std::uint32_t kGeneration = 1;

struct World {
  World(const std::string& name, WorldFault with) : instance(name), fault(with) {
    segment = std::make_unique<check::PlayedSegment>(
        check::SegmentScript{.instance = instance,
                             .role = Role::kWorld,
                             .streams = WorldStreams(kPeriodNs, 4, 100'000'000),
                             .epoch = static_cast<std::uint64_t>(MonotonicNow()),
                             .state = SegmentState::kReady,
                             .alter = {}});
    frames = check::RawWriter(segment->RingOf(StreamType::kWorldFrame));
    healths = check::RawWriter(segment->RingOf(StreamType::kWorldHealth));
    bodies = check::RawWriter(segment->RingOf(StreamType::kWorldBodies));
  }

  void Tick(std::int64_t now);
  void LookForHaptic();
  bool Consume();
  void Drain();
  void Take(const HapticTick& tick);
  void Publish();
  void AddLocalBodies(WorldFrame& message);
  void PublishBodies();

  const std::string instance;
  const WorldFault fault;
  std::unique_ptr<check::PlayedSegment> segment;
  check::RawWriter frames, healths, bodies;

  std::unique_ptr<PeerView> view, next;
  std::unique_ptr<check::RawView> careless;
  std::uint64_t careless_cursor = 0;
  MessageReader<HapticTick> reader;
  ObjectId refused;
  std::uint64_t rejected = 0, lapped_before = 0;

  std::uint64_t epoch = 0, last_tick = 0, baseline_tick = 0;
  bool has_baseline = false;
  bool heard = false;  // in this frame
  Totals totals;
  ImpulseUnits applied{}, discarded{}, owed{};
  double owed_ns = 0;
  Vector finger{1, 0, 0};
  double velocity = 0;
  std::uint64_t frame = 0;
};

void World::LookForHaptic() {
  if (view != nullptr && !view->gone() && (!view->OwnerAlive() || !view->IsCurrent())) {
    view->MarkGone();
  }
  const bool attached =
      (view != nullptr && !view->gone() && view->State() != SegmentState::kClosed) ||
      next != nullptr;
  const ObjectId named = StatObject(SegmentName(instance, Role::kHaptic)).id;
  if (attached || named == ObjectId{} || named == refused) return;
  AttachResult result = Attach({.instance = instance,
                                .role = Role::kHaptic,
                                .required = {{StreamType::kHapticTick}},
                                .owners = {}});
  if (result.status == AttachStatus::kIncompatible) {
    refused = result.object;
    if (fault == WorldFault::kIgnoresHash) {
      careless = std::make_unique<check::RawView>(instance, Role::kHaptic);
      reader =
          MessageReader<HapticTick>(StreamReader(careless->RingOf(careless->header().stream[0])));
      epoch = careless->header().epoch;
      has_baseline = false;
      totals.clear();
      applied = discarded = {};
    }
  }
  if (result.status != AttachStatus::kAttached) return;
  if (fault == WorldFault::kRefusesMinor && result.view->header().version_minor != kVersionMinor) {
    refused = result.object;
    return;
  }
  next = std::move(result.view);
}

void World::Take(const HapticTick& tick) {
  if (has_baseline && tick.tick <= last_tick) return;
  heard = true;
  const Totals now = TotalsOf(tick);
  finger = tick.pointer_count > 0 ? tick.pointers[0].position : Vector{1, 0, 0};
  if (!has_baseline) {
    has_baseline = true;
    baseline_tick = tick.tick;
    if (fault != WorldFault::kNoBaseline) totals = now;
  }
  ImpulseUnits good{};
  ImpulseUnits bad{};
  for (const auto& [key, channel] : now) {
    const auto known = totals.find(key);
    ImpulseUnits before{};
    if (known != totals.end())
      before = known->second.impulse;
    else if (std::get<3>(key) <= last_tick && fault != WorldFault::kNoBaseline)
      before = channel.impulse;
    const ImpulseUnits grown = Minus(channel.impulse, before);
    const bool mine = tick.world_epoch == segment->epoch() || fault == WorldFault::kTakesForeign;
    const bool body_known = (channel.body == kBody && channel.generation == kGeneration) ||
                            fault == WorldFault::kTakesUnknownBodies;
    (mine && body_known ? good : bad) = Plus(mine && body_known ? good : bad, grown);
  }
  owed_ns += Largest(good) * kImpulseUnit;
  if (owed_ns > kLargestTick && fault != WorldFault::kNoGapRule) {
    bad = Plus(bad, good);
    good = {};
  }
  owed = Plus(owed, good);
  discarded = Plus(discarded, bad);
  totals = now;
  last_tick = tick.tick;
}

bool World::Consume() {
  HapticTick tick;
  const bool by_itself = fault == WorldFault::kNoSecondLook || fault == WorldFault::kNeverDetaches;
  if (by_itself && view != nullptr) {
    if (careless == nullptr || careless->header().epoch != view->epoch()) return false;
    const Ring ring = careless->RingOf(careless->header().stream[0]);
    const std::uint64_t newest =
        std::atomic_ref<std::uint64_t>(*ring.published).load(std::memory_order_acquire);
    if (newest <= careless_cursor) return false;
    if (newest - careless_cursor > ring.slot_count - 2) {
      careless_cursor = newest - ring.slot_count / 2;
    }
    ++careless_cursor;
    if (ReadCarelessly(ring, careless_cursor,
                       Looks{.first = true, .second = fault != WorldFault::kNoSecondLook}, tick)) {
      Take(tick);
    }
    return true;
  }
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  const ReadStatus status = reader.ReadNext(tick, fault == WorldFault::kNoClock ? kNoClock : now);
  if (status == ReadStatus::kFresh) {
    Take(tick);
    return true;
  }
  if (status != ReadStatus::kRejected) return false;
  ++rejected;
  segment->CountRejected(rejected);
  if (fault == WorldFault::kTakesNonsense) last_tick = reader.received().number - 1;
  return true;
}

void World::Drain() {
  while (Consume()) {
  }
  if (reader.hopeless() && view != nullptr) {
    refused = view->object();
    view->MarkGone();
  }
}

void World::Tick(std::int64_t) {
  heard = false;
  LookForHaptic();
  const bool turn = next != nullptr;
  if (!turn || fault != WorldFault::kForgetsOldSegment) Drain();
  if (fault == WorldFault::kAppliesTwice) applied = Plus(applied, owed);
  if (fault != WorldFault::kAcksAhead) applied = Plus(applied, owed);
  const double impulse = static_cast<double>(owed[0]) * kImpulseUnit;
  velocity = 0.5 * velocity + (fault == WorldFault::kWrongDirection ? -impulse : impulse) / kMass;
  owed = {};
  owed_ns = 0;
  if (fault != WorldFault::kWaitsForHaptic || heard) Publish();
  if (!turn) return;
  lapped_before += reader.ring().lost();
  view = std::move(next);
  reader = view->Reader<HapticTick>();
  careless.reset();
  careless_cursor = 0;
  if (fault == WorldFault::kNoSecondLook || fault == WorldFault::kNeverDetaches) {
    careless = MapCarelessly(instance, Role::kHaptic);
  }
  epoch = view->epoch();
  has_baseline = false;
  last_tick = 0;
  totals.clear();
  applied = discarded = {};
}

void World::Publish() {
  WorldFrame message;
  message.frame = ++frame;
  if (fault == WorldFault::kFrameNumbers && frame % 10 == 0) message.frame -= 2;
  message.world_time_ns = frame * kPeriodNs;
  message.period_ns = kPeriodNs;
  message.acked_epoch = has_baseline ? epoch : 0;
  message.acked_tick = has_baseline ? last_tick : 0;
  message.baseline_tick = has_baseline ? baseline_tick : 0;
  message.applied = has_baseline ? applied : ImpulseUnits{};
  message.discarded = has_baseline ? discarded : ImpulseUnits{};
  // The face that the finger is furthest in front of.
  std::size_t axis = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    if (std::abs(finger[i]) > std::abs(finger[axis])) axis = i;
  }
  if (std::abs(finger[axis]) < kHalf + 0.01 + kReach) {
    Plane plane;
    plane.body = kBody;
    plane.generation = kGeneration;
    plane.feature = static_cast<std::uint32_t>(axis);
    const double side = finger[axis] < 0 ? -1 : 1;
    plane.point = finger;
    plane.point[axis] = side * kHalf;
    plane.normal[axis] = fault == WorldFault::kNormalInverted  ? -side
                         : fault == WorldFault::kNormalNotUnit ? 0.5 * side
                                                               : side;
    plane.inverse_mass = fault == WorldFault::kSaysFixed ? 0 : 1 / kMass;
    message.planes[0] = plane;
    message.plane_count = 1;
    AddLocalBodies(message);
  }
  PublishMessage(frames, message, fault == WorldFault::kPublishBeforeWrite);
  if (fault != WorldFault::kNoHeartbeat) {
    segment->Heartbeat(frame, static_cast<std::uint64_t>(MonotonicNow()));
  }
  WorldHealth health;
  health.frames = frame;
  health.period_ns = kPeriodNs;
  health.lapped = lapped_before + reader.ring().lost();
  health.peer_state = heard ? PeerState::kLive : PeerState::kLost;
  health.peer_epoch = epoch;
  health.coupling = message.coupling;
  health.applied = applied;
  PublishMessage(healths, health, false);
  PublishBodies();
}

/// The box on a floor, and a neighbour.
void World::AddLocalBodies(WorldFrame& message) {
  message.coupling = Coupling::kLocal;
  message.local_body_count = 2;
  message.local_substep_ns = 1'000'000;
  const auto fill = [&](std::uint32_t i, std::uint32_t number, std::uint32_t other) {
    LocalBody& body = message.local_bodies[i];
    body.body = number;
    body.generation = kGeneration;
    body.mass = kMass;
    body.position = {0, i * kApart, 0};
    body.contact_count = 1;
    ContactPlane& contact = body.contacts[0];
    contact.other_body = other;
    contact.other_generation = kGeneration;
    contact.normal = {0, 0, 1};
    contact.impulse = {0, 0, 0.01};
    contact.gap = fault == WorldFault::kRestsDeep ? -0.001 : 0;
  };
  fill(0, kBody, fault == WorldFault::kContactTwice ? kNeighbour : kFloor);
  fill(1, kNeighbour, kBody);
  message.local_bodies[0].velocity = {velocity, 0, 0};
  if (fault == WorldFault::kLocalInstead) message.local_bodies[1].position[0] = 0.01;
}

void World::PublishBodies() {
  Body body;
  body.body = kBody;
  body.generation = kGeneration;
  body.mass = kMass;
  body.velocity = {velocity, 0, 0};
  Body neighbour = body;
  neighbour.body = kNeighbour;
  neighbour.position = {0, kApart, 0};
  neighbour.velocity = {};
  const std::array<Body, 2> both{body, neighbour};
  std::vector<std::uint64_t> words(WorldBodiesBytes(2) / 8);
  const Encoded shape = Encode(std::span<const Body>(both), words);
  bodies.Publish(words, shape, static_cast<std::uint64_t>(MonotonicNow()));
}

}  // namespace

MiniWorld::MiniWorld(const std::string& instance, WorldFault fault)
    : instance_(instance), fault_(fault), thread_([this] { Run(); }) {}

MiniWorld::~MiniWorld() {
  stop_ = true;
  thread_.join();
}

void MiniWorld::Run() {
  World world(instance_, fault_);
  std::int64_t next = MonotonicNow();
  while (!stop_) {
    world.Tick(MonotonicNow());
    next = std::max(next + kPeriodNs, MonotonicNow());
    SleepUntil(next);
  }
  world.segment->Close();
}

}  // namespace rikiseki::protocol::test
