// SPDX-License-Identifier: MIT
#include "tests/process/storm_watch.h"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include "protocol/codec.h"
#include "protocol/shared_object.h"

namespace rikiseki::test {

using protocol::ImpulseUnits;
using protocol::ReadStatus;
using protocol::Role;

ImpulseUnits operator+(const ImpulseUnits& a, const ImpulseUnits& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
ImpulseUnits operator-(const ImpulseUnits& a, const ImpulseUnits& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

namespace {

// What the channels of `now` grew by since `before`: one that was not there counts from zero.
ImpulseUnits Growth(const protocol::HapticTick& now, const protocol::HapticTick& before) {
  ImpulseUnits growth{};
  const auto earlier = std::span(before.channels).first(before.channel_count);
  for (const protocol::Channel& channel : std::span(now.channels).first(now.channel_count)) {
    growth = growth + channel.impulse;
    for (const protocol::Channel& other : earlier) {
      if (other.body == channel.body && other.generation == channel.generation &&
          other.pointer == channel.pointer && other.opened_tick == channel.opened_tick) {
        growth = growth - other.impulse;
      }
    }
  }
  return growth;
}

}  // namespace

struct StormWatch::HapticReader {
  HapticReader(std::unique_ptr<protocol::PeerView> attached, HapticHistory& kept)
      : view(std::move(attached)),
        history(kept),
        ticks(view->Reader<protocol::HapticTick>()),
        healths(view->Reader<protocol::HapticHealth>()) {}

  void Read() {
    while (ticks.ReadNext(tick) == ReadStatus::kFresh) {
      const ImpulseUnits before =
          history.ticks.empty() ? ImpulseUnits{} : history.ticks.back().delivered;
      if (tick.tick != history.ticks.size()) ++history.lost;
      history.force_cap = tick.force_cap;
      history.ticks.push_back({.start_ns = tick.start_ns,
                               .previous_duration_ns = tick.previous_duration_ns,
                               .world_epoch = tick.world_epoch,
                               .world_frame = tick.world_frame,
                               .force = tick.pointers[0].force,
                               .reason = tick.pointers[0].reason,
                               .delivered = before + Growth(tick, tick_before),
                               .ground = tick.ground.impulse});
      tick_before = tick;
    }
    protocol::HapticHealth health;
    if (healths.ReadLatest(health) == ReadStatus::kFresh) {
      history.books.push_back({.ticks = health.ticks, .books = health.books});
    }
    history.lost += ticks.rejected() + healths.rejected();
  }

  double Force() const {
    const protocol::Vector& force = tick_before.pointers[0].force;
    return std::hypot(force[0], force[1], force[2]);
  }

  std::unique_ptr<protocol::PeerView> view;
  HapticHistory& history;
  protocol::MessageReader<protocol::HapticTick> ticks;
  protocol::MessageReader<protocol::HapticHealth> healths;
  protocol::HapticTick tick;
  protocol::HapticTick tick_before;
};

struct StormWatch::WorldReader {
  WorldReader(std::unique_ptr<protocol::PeerView> attached, WorldHistory& kept)
      : view(std::move(attached)),
        history(kept),
        frames(view->Reader<protocol::WorldFrame>()),
        healths(view->Reader<protocol::WorldHealth>()),
        bodies(view->Stream(protocol::StreamType::kWorldBodies)),
        body_words(protocol::WorldBodiesBytes(kMostBodies) / 8),
        body_list(kMostBodies) {}

  void Read() {
    while (frames.ReadNext(frame) == ReadStatus::kFresh) {
      if (frame.frame != history.frames.size() + 1) ++history.lost;
      history.frames.push_back(frame);
    }
    protocol::WorldHealth health;
    if (healths.ReadLatest(health) == ReadStatus::kFresh) {
      history.lives.push_back({.frame = health.frames,
                               .lapped = health.lapped,
                               .applied = health.applied,
                               .discarded = health.discarded});
    }
    protocol::Received received;
    while (bodies.ReadNext(body_words, received) == ReadStatus::kFresh) {
      std::uint32_t count = 0;
      if (protocol::Decode(body_words, {received.used_bytes, received.blocks}, std::span(body_list),
                           count) != protocol::DecodeStatus::kOk) {
        ++history.lost;
        continue;
      }
      for (const protocol::Body& body : std::span(body_list).first(count)) {
        if (body.mass <= 0) continue;
        // The n-th message of the bodies belongs to frame n: both are published once per world
        // tick.
        history.blocks.push_back({.frame = received.number,
                                  .generation = body.generation,
                                  .mass = body.mass,
                                  .position = body.position,
                                  .velocity = body.velocity});
      }
    }
    history.lost += frames.rejected() + healths.rejected();
  }

  static constexpr std::uint32_t kMostBodies = 256;
  std::unique_ptr<protocol::PeerView> view;
  WorldHistory& history;
  protocol::MessageReader<protocol::WorldFrame> frames;
  protocol::MessageReader<protocol::WorldHealth> healths;
  protocol::StreamReader bodies;
  protocol::WorldFrame frame;
  std::vector<std::uint64_t> body_words;
  std::vector<protocol::Body> body_list;
};

StormWatch::StormWatch(std::string instance) : instance_(std::move(instance)) {
  thread_ = std::thread([this] { Run(); });
}

StormWatch::~StormWatch() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void StormWatch::Run() {
  // A world's ring holds 0.4 s: where it is allowed, a loaded machine must not make the witness miss it.
  const sched_param priority{.sched_priority = 1};
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
  while (!stop_) {
    {
      const std::lock_guard lock(mutex_);
      Look(Role::kHaptic);
      Look(Role::kWorld);
      ReadAll();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

bool StormWatch::Secure(Role role) {
  const std::lock_guard lock(mutex_);
  Look(role);
  const protocol::ObjectId& seen = role == Role::kHaptic ? seen_haptic_ : seen_world_;
  return protocol::StatObject(protocol::SegmentName(instance_, role)).id == seen;
}

void StormWatch::Finish() {
  stop_ = true;
  thread_.join();
  ReadAll();
  haptic_readers_.clear();
  world_readers_.clear();
}

void StormWatch::Look(Role role) {
  protocol::ObjectId& seen = role == Role::kHaptic ? seen_haptic_ : seen_world_;
  const protocol::ObjectId named = protocol::StatObject(protocol::SegmentName(instance_, role)).id;
  if (named == protocol::ObjectId{} || named == seen) return;
  protocol::AttachResult result =
      protocol::Attach({.instance = instance_, .role = role, .required = {}, .owners = {}});
  if (result.status != protocol::AttachStatus::kAttached) return;
  seen = result.object;
  if (role == Role::kHaptic) {
    HapticHistory& history = haptics_.emplace_back();
    history.epoch = result.view->epoch();
    history.period_ns = result.view->PeriodNs(protocol::StreamType::kHapticTick);
    haptic_readers_.push_back(std::make_unique<HapticReader>(std::move(result.view), history));
  } else {
    WorldHistory& history = worlds_.emplace_back();
    history.epoch = result.view->epoch();
    world_readers_.push_back(std::make_unique<WorldReader>(std::move(result.view), history));
  }
}

void StormWatch::ReadAll() {
  double force = 0;
  // First asked whether the owner lives, then read: what a dead one wrote is then all there.
  std::erase_if(haptic_readers_, [&](const auto& reader) {
    const bool alive = reader->view->OwnerAlive();
    reader->Read();
    if (alive) force = reader->Force();
    return !alive;
  });
  std::erase_if(world_readers_, [](const auto& reader) {
    const bool alive = reader->view->OwnerAlive();
    reader->Read();
    return !alive;
  });
  force_ = force;
}

}  // namespace rikiseki::test
