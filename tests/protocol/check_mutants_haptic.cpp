// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <map>

#include "protocol/validate.h"
#include "protocol/version.h"
#include "tests/protocol/check_mutants.h"
#include "tests/protocol/check_mutants_common.h"

namespace rikiseki::protocol::test {
namespace {

using check::Cross;
using check::Difference;
using check::Dot;
using check::Norm;
using check::Scaled;
using check::Sum;

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr double kT = 1e-3;             // s
constexpr double kStiffness = 1000;     // N/m
constexpr double kHandStiffness = 500;  // N/m
constexpr double kRadius = 0.01;        // m
constexpr double kCap = 5;              // N
constexpr double kSlew = 5000;          // N/s
constexpr double kSoftTicks = 100;
constexpr double kFadeTicks = 80;
constexpr std::int64_t kLostFloorNs = 250'000'000;

struct Account {
  Channel channel;
  std::array<double, 3> rest{}, angular_rest{};  // of the rounding, in units
  Vector force{}, point{};                       // on the body, of the tick before
  std::uint64_t closed_tick = 0;
};

ImpulseUnits Quantise(const Vector& impulse, std::array<double, 3>& rest) {
  ImpulseUnits units{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double exact = impulse[i] / kImpulseUnit + rest[i];
    units[i] = static_cast<std::int64_t>(std::llround(exact));
    rest[i] = exact - static_cast<double>(units[i]);
  }
  return units;
}

struct Haptic {
  Haptic(const std::string& name, HapticFault with) : instance(name), fault(with) {
    const auto now = static_cast<std::uint64_t>(MonotonicNow());
    const std::vector<StreamSpec> streams = HapticStreams(kPeriodNs, 1024, 10'000'000);
    const auto state =
        fault == HapticFault::kNeverReady ? SegmentState::kInitialising : SegmentState::kReady;
    const std::uint64_t an_hour = 3'600'000'000'000;
    segment = std::make_unique<check::PlayedSegment>(
        check::SegmentScript{.instance = instance,
                             .role = Role::kHaptic,
                             .streams = streams,
                             .epoch = fault == HapticFault::kOldEpoch
                                          ? std::max<std::uint64_t>(now, 2 * an_hour) - an_hour
                                          : now,
                             .state = state,
                             .alter = {}});
    ticks = check::RawWriter(segment->RingOf(StreamType::kHapticTick));
    healths = check::RawWriter(segment->RingOf(StreamType::kHapticHealth));
  }

  void LookForWorld(std::int64_t now);
  bool ReadFrame(WorldFrame& fresh);
  void TakeAck(const WorldFrame& fresh);
  void WatchWorld(std::int64_t now, bool fresh);
  Vector Render();
  void Tick(std::int64_t now);
  void Publish(std::int64_t now, std::int64_t duration);

  const std::string instance;
  const HapticFault fault;
  std::unique_ptr<check::PlayedSegment> segment;
  check::RawWriter ticks, healths;

  // The world.
  std::unique_ptr<PeerView> view;
  std::unique_ptr<check::RawView> raw;       // of a world that had to be refused
  std::unique_ptr<check::RawView> careless;  // of the one that is attached
  std::uint64_t view_epoch = 0;
  MessageReader<WorldFrame> reader;
  std::uint64_t careless_number = 0;
  ObjectId refused;
  std::int64_t next_look = 0;
  int fresh_frames = 0;
  std::int64_t frame_ns = 0;
  std::uint64_t newest_number = 0;
  std::uint64_t rejected = 0;
  bool live = false;
  WorldFrame frame;  // displayed
  std::uint64_t shown_epoch = 0, channel_epoch = 0;

  // The device.
  Vector position{-0.05, 0, 0};
  Vector displayed_force{};
  GroundChannel ground;
  Vector ground_force{};  // on the world
  std::array<double, 3> ground_rest{};
  double gain = 0;

  // The books.
  std::uint64_t tick = 0;
  std::int64_t previous_start = 0;
  std::vector<Account> accounts;
  std::vector<ImpulseUnits> history;
  Books books;
  ImpulseUnits acked{}, world_applied{}, world_discarded{};
  std::uint64_t acked_tick = 0, world_baseline = 0, acking_world = 0;
};

void Haptic::LookForWorld(std::int64_t now) {
  if (now < next_look) return;
  next_look = now + 20'000'000;
  if (view != nullptr && !view->gone() && (!view->OwnerAlive() || !view->IsCurrent())) {
    view->MarkGone();
  }
  const bool attached =
      view != nullptr && !view->gone() &&
      (view->State() == SegmentState::kReady || view->State() == SegmentState::kFaulted);
  if (attached) return;
  const ObjectId named = StatObject(SegmentName(instance, Role::kWorld)).id;
  if (named == ObjectId{} || named == refused) return;
  AttachResult result = Attach({.instance = instance,
                                .role = Role::kWorld,
                                .required = {{StreamType::kWorldFrame}},
                                .owners = {}});
  if (result.status == AttachStatus::kIncompatible) {
    refused = result.object;
    if (fault == HapticFault::kIgnoresHash) {
      raw = std::make_unique<check::RawView>(instance, Role::kWorld);
      reader = MessageReader<WorldFrame>(StreamReader(raw->RingOf(raw->header().stream[0])));
      view.reset();
      view_epoch = raw->header().epoch;
      fresh_frames = 0;
      newest_number = 0;
    }
    return;
  }
  if (result.status != AttachStatus::kAttached) return;
  if (fault == HapticFault::kRefusesMinor && result.view->header().version_minor != kVersionMinor) {
    refused = result.object;
    return;
  }
  raw.reset();
  view = std::move(result.view);
  view_epoch = view->epoch();
  reader = view->Reader<WorldFrame>();
  careless = MapCarelessly(instance, Role::kWorld);
  careless_number = 0;
  fresh_frames = 0;
  newest_number = 0;
}

bool Haptic::ReadFrame(WorldFrame& fresh) {
  if (view == nullptr && raw == nullptr) return false;
  const bool skips_looks =
      fault == HapticFault::kNoFirstLook || fault == HapticFault::kNoSecondLook;
  if (skips_looks && view != nullptr) {
    if (careless == nullptr || careless->header().epoch != view_epoch) return false;
    const Ring ring = careless->RingOf(careless->header().stream[0]);
    const std::uint64_t number =
        std::atomic_ref<std::uint64_t>(*ring.published).load(std::memory_order_acquire);
    if (number <= careless_number) return false;
    const Looks looks{.first = fault != HapticFault::kNoFirstLook, .second = false};
    if (!ReadCarelessly(ring, number, looks, fresh)) return false;
    careless_number = number;
  } else {
    const auto now = static_cast<std::uint64_t>(MonotonicNow());
    const ReadStatus status =
        reader.ReadLatest(fresh, fault == HapticFault::kNoClock ? kNoClock : now);
    if (status == ReadStatus::kRejected) {
      ++rejected;
      segment->CountRejected(rejected);
      if (fault != HapticFault::kTakesNonsense) return false;
      fresh = frame;  // the number of the new one, which stands first in the message
      fresh.frame = newest_number + 1;
    } else if (status != ReadStatus::kFresh) {
      if (reader.hopeless() && view != nullptr) {
        refused = view->object();
        view->MarkGone();
      }
      return false;
    }
  }
  if (fresh.frame <= newest_number) return false;
  newest_number = fresh.frame;
  return true;
}

void Haptic::TakeAck(const WorldFrame& fresh) {
  const bool sound = fresh.acked_epoch == segment->epoch() && fresh.acked_tick < tick &&
                     fresh.acked_tick >= acked_tick;
  if (!sound && fault == HapticFault::kBooksAnyAck) {
    books.applied = Plus(books.applied, Minus(fresh.applied, world_applied));
  }
  if (!sound) return;
  const ImpulseUnits upto = history[fresh.acked_tick];
  if (acking_world != view_epoch || world_baseline != fresh.baseline_tick) {
    if (fresh.baseline_tick < acked_tick && acking_world != view_epoch) return;
    const ImpulseUnits baseline = history[fresh.baseline_tick];
    books.peer_lost = Plus(books.peer_lost, Minus(baseline, acked));
    acked = baseline;
    world_applied = world_discarded = {};
    acking_world = view_epoch;
    world_baseline = fresh.baseline_tick;
  }
  books.covered = Plus(books.covered, Minus(upto, acked));
  books.applied = Plus(books.applied, Minus(fresh.applied, world_applied));
  books.discarded = Plus(books.discarded, Minus(fresh.discarded, world_discarded));
  acked = upto;
  acked_tick = fresh.acked_tick;
  world_applied = fresh.applied;
  world_discarded = fresh.discarded;
  std::erase_if(accounts, [&](const Account& account) {
    return account.channel.state == ChannelState::kClosed && account.closed_tick <= acked_tick;
  });
}

void Haptic::WatchWorld(std::int64_t now, bool fresh) {
  const bool ready =
      raw != nullptr || (view != nullptr && !view->gone() && view->State() == SegmentState::kReady);
  if (fresh) {
    frame_ns = now;
    ++fresh_frames;
  }
  if (fault == HapticFault::kForceForever && live) return;
  if (!ready || now - frame_ns > kLostFloorNs) {
    live = false;
    fresh_frames = 0;
  } else if (fresh_frames >= (fault == HapticFault::kNoThreeFrames ? 1 : 3)) {
    live = true;
  }
}

Vector Haptic::Render() {
  gain = live ? std::min(1.0, gain + 1 / kSoftTicks) : std::max(0.0, gain - 1 / kFadeTicks);
  for (Account& account : accounts) account.force = Vector{};
  ground_force = {};
  Vector wanted{};
  for (std::uint32_t i = 0; i < frame.plane_count && shown_epoch != 0; ++i) {
    const Plane& plane = frame.planes[i];
    const double depth = kRadius - Dot(Difference(position, plane.point), plane.normal);
    if (plane.pointer != 0 || depth <= 0) continue;
    const auto same = [&](const Account& account) {
      return account.channel.body == plane.body && account.channel.generation == plane.generation;
    };
    if (frame.local_body_count > 0 && fault == HapticFault::kLosesLocal) continue;
    const bool fixed = plane.inverse_mass == 0 && fault != HapticFault::kChannelForFixed;
    auto account = std::find_if(accounts.begin(), accounts.end(), same);
    if (!fixed && account == accounts.end()) {
      if (accounts.size() == kMaxChannels) continue;
      accounts.emplace_back();
      account = accounts.end() - 1;
      account->channel.body = plane.body;
      account->channel.generation = plane.generation;
      account->channel.opened_tick = tick;
    }
    const double cap = fault == HapticFault::kOverCap ? 10 * kCap : kCap;
    Vector force = Scaled(plane.normal, gain * std::min(kStiffness * depth, cap));
    // The slew limit, on the way up; on the way down a fade is slower than it.
    const double step = kSlew * kT * 0.9;
    const double before = Norm(displayed_force);
    if (Norm(force) > before + step) force = Scaled(force, (before + step) / Norm(force));
    if (fault == HapticFault::kOverCap) force = Scaled(force, 4);
    if (fault == HapticFault::kPulls) force = Scaled(force, -1);
    wanted = Sum(wanted, force);
    if (fixed) {
      ground_force = Sum(ground_force, Scaled(force, -1));
      continue;
    }
    account->channel.state = ChannelState::kOpen;
    account->channel.contact_point = Sum(position, Scaled(plane.normal, -kRadius));
    account->force = Scaled(force, -1);
  }
  return wanted;
}

void Haptic::Tick(std::int64_t now) {
  const std::int64_t duration = tick == 0 ? 0 : now - previous_start;
  const double correction_s = tick == 0 ? 0 : static_cast<double>(duration) * 1e-9 - kT;
  previous_start = now;
  LookForWorld(now);
  WorldFrame fresh;
  Vector orphan{};
  const bool is_fresh = ReadFrame(fresh);
  if (is_fresh) TakeAck(fresh);
  WatchWorld(now, is_fresh);
  if (is_fresh && live) {
    if (channel_epoch != view_epoch) {
      if (fault != HapticFault::kKeepsChannels) {
        for (const Account& account : accounts) orphan = Sum(orphan, account.force);
        accounts.clear();
      }
      channel_epoch = view_epoch;
    }
    frame = fresh;
    shown_epoch = view_epoch;
  }
  std::map<check::ChannelKey, std::pair<Vector, Vector>> before;
  for (const Account& account : accounts) {
    before[check::KeyOf(account.channel)] = {account.force, account.point};
  }
  // What was displayed for a channel that is free now is corrected for nobody.
  const Vector late = Sum(orphan, ground_force);
  const Vector force = Render();
  ground.impulse =
      Plus(ground.impulse,
           Quantise(Sum(Scaled(late, correction_s), Scaled(ground_force, kT)), ground_rest));
  if (!live && gain <= 0) shown_epoch = 0;
  position = Sum(
      position,
      Scaled(Difference(Sum({-0.05, 0, 0}, Scaled(force, 1 / kHandStiffness)), position), 0.05));
  displayed_force = force;

  for (Account& account : accounts) {
    Channel& channel = account.channel;
    const auto [old_force, old_point] = before[check::KeyOf(channel)];
    if (Norm(account.force) > 0) account.point = channel.contact_point;
    const double late_s = fault == HapticFault::kNominalTime ? 0 : correction_s;
    Vector now_impulse = Scaled(account.force, kT);
    Vector late_impulse = Scaled(old_force, late_s);
    if (fault == HapticFault::kWrongSign) {
      now_impulse = Scaled(now_impulse, -1);
      late_impulse = Scaled(late_impulse, -1);
    }
    const ImpulseUnits grown = Quantise(Sum(now_impulse, late_impulse), account.rest);
    const Vector origin = fault == HapticFault::kMomentAboutFinger ? position : Vector{};
    const ImpulseUnits turned = Quantise(Sum(Cross(Difference(account.point, origin), now_impulse),
                                             Cross(Difference(old_point, origin), late_impulse)),
                                         account.angular_rest);
    const ImpulseUnits impulse_before = channel.impulse;
    if (fault == HapticFault::kIncrements) {
      channel.impulse = grown;
      channel.angular_impulse = turned;
    } else {
      channel.impulse = Plus(channel.impulse, grown);
      channel.angular_impulse = Plus(channel.angular_impulse, turned);
    }
    books.displayed = Plus(books.displayed, grown);
    for (std::size_t i = 0; i < 3; ++i) {
      channel.first_moment[i] +=
          static_cast<double>(channel.impulse[i]) * kImpulseUnit * kT +
          static_cast<double>(impulse_before[i]) * kImpulseUnit * correction_s;
    }
    if (Norm(account.force) == 0 && Norm(old_force) == 0 && channel.state == ChannelState::kOpen) {
      channel.state = ChannelState::kClosed;
      account.closed_tick = tick;
    }
  }
  history.push_back(books.displayed);
  Publish(now, duration);
  if (fault == HapticFault::kFreesEarly) {
    std::erase_if(accounts, [](const Account& account) {
      return account.channel.state == ChannelState::kClosed;
    });
  }
  ++tick;
}

void Haptic::Publish(std::int64_t now, std::int64_t duration) {
  HapticTick message;
  message.tick = tick;
  message.start_ns = static_cast<std::uint64_t>(now);
  message.period_ns = kPeriodNs;
  message.previous_duration_ns = static_cast<std::uint64_t>(duration);
  message.world_epoch = shown_epoch;
  message.world_frame = shown_epoch == 0 ? 0 : frame.frame;
  message.stiffness = kStiffness;
  message.force_cap = kCap;
  message.pointer_count = 1;
  message.pointers[0].radius = kRadius;
  message.pointers[0].position = position;
  message.pointers[0].force = displayed_force;
  message.pointers[0].reason = shown_epoch == 0                  ? ForceReason::kWorldAbsent
                               : Norm(displayed_force) > 0       ? ForceReason::kContact
                               : accounts.size() == kMaxChannels ? ForceReason::kNoChannel
                                                                 : ForceReason::kNoContact;
  message.ground = ground;
  for (const Account& account : accounts) {
    message.channels[message.channel_count++] = account.channel;
  }
  if (fault != HapticFault::kEverySecondTick || tick % 2 == 0) {
    PublishMessage(ticks, message, fault == HapticFault::kPublishBeforeWrite);
  }
  if (fault == HapticFault::kCounterBackwards && tick % 50 == 49) {
    const std::uint64_t number = ticks.published();
    ticks.SetPublished(number - 3);
    SleepUntil(MonotonicNow() + 3'000'000);
    ticks.SetPublished(number);
  }
  if (fault != HapticFault::kNoHeartbeat) {
    segment->Heartbeat(tick, static_cast<std::uint64_t>(MonotonicNow()));
  }
  if (tick % 10 != 0) return;
  HapticHealth health;
  health.ticks = tick + 1;
  health.period_ns = kPeriodNs;
  health.reason = message.pointers[0].reason;
  health.peer_state = live ? PeerState::kLive : PeerState::kAbsent;
  health.peer_epoch = view_epoch;
  health.zero_force_after_ns = 350'000'000;
  health.slew_limit = kSlew;
  health.books = books;
  PublishMessage(healths, health, false);
}

}  // namespace

MiniHaptic::MiniHaptic(const std::string& instance, HapticFault fault)
    : instance_(instance), fault_(fault), thread_([this] { Run(); }) {}

MiniHaptic::~MiniHaptic() {
  stop_ = true;
  thread_.join();
}

void MiniHaptic::Run() {
  Haptic haptic(instance_, fault_);
  std::int64_t next = MonotonicNow();
  while (!stop_) {
    haptic.Tick(MonotonicNow());
    next = std::max(next + kPeriodNs, MonotonicNow());
    SleepUntil(next);
  }
  haptic.segment->Close();
}

}  // namespace rikiseki::protocol::test
