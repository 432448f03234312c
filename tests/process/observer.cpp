// SPDX-License-Identifier: MIT
#include "tests/process/observer.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>

#include "common/histogram.h"
#include "protocol/stream.h"

namespace rikiseki::test {
namespace {

using Clock = std::chrono::steady_clock;

// What the channels of `now` grew by since `before`: one that was not there counts from zero.
protocol::ImpulseUnits Growth(const protocol::HapticTick& now, const protocol::HapticTick& before) {
  protocol::ImpulseUnits growth{};
  for (std::uint32_t i = 0; i < now.channel_count; ++i) {
    const protocol::Channel& channel = now.channels[i];
    protocol::ImpulseUnits earlier{};
    for (std::uint32_t j = 0; j < before.channel_count; ++j) {
      const protocol::Channel& other = before.channels[j];
      if (other.body == channel.body && other.generation == channel.generation &&
          other.pointer == channel.pointer && other.opened_tick == channel.opened_tick) {
        earlier = other.impulse;
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis)
      growth[axis] += channel.impulse[axis] - earlier[axis];
  }
  return growth;
}

template <typename Message>
Message ReadNewest(const protocol::PeerView& view) {
  auto reader = view.Reader<Message>();
  Message message;
  REQUIRE(Eventually([&] { return reader.ReadLatest(message) == protocol::ReadStatus::kFresh; }));
  return message;
}

}  // namespace

bool Eventually(const std::function<bool()>& condition, double seconds) {
  const auto limit = Clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (Clock::now() > limit) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

std::unique_ptr<protocol::PeerView> Observe(const std::string& instance, protocol::Role role,
                                            double seconds) {
  protocol::AttachResult result;
  const bool attached = Eventually(
      [&] {
        result =
            protocol::Attach({.instance = instance, .role = role, .required = {}, .owners = {}});
        return result.status == protocol::AttachStatus::kAttached;
      },
      seconds);
  INFO(result.text);
  REQUIRE(attached);
  return std::move(result.view);
}

TickWatch::TickWatch(const std::string& instance, double slew_limit_n_per_s)
    : view_(Observe(instance, protocol::Role::kHaptic)), slew_limit_(slew_limit_n_per_s) {
  thread_ = std::thread([this] { Run(); });
}

TickWatch::~TickWatch() {
  stop_ = true;
  thread_.join();
}

void TickWatch::Run() {
  auto reader = view_->Reader<protocol::HapticTick>();
  protocol::HapticTick tick;
  protocol::HapticTick tick_before;
  protocol::Vector before{};
  protocol::Vector place_before{};
  double work_j = 0;
  protocol::ImpulseUnits displayed{};
  std::uint64_t number_before = 0;
  while (!stop_) {
    const protocol::ReadStatus status = reader.ReadNext(tick);
    if (status != protocol::ReadStatus::kFresh) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      continue;
    }
    lost_ = reader.ring().lost();
    const protocol::Vector& force = tick.pointers[0].force;
    const double magnitude = std::hypot(force[0], force[1], force[2]);
    if (!std::isfinite(magnitude)) finite_ = false;
    worst_over_cap_ = std::max(worst_over_cap_.load(), magnitude - tick.force_cap);
    if (number_before != 0 && reader.received().number == number_before + 1) {
      const double step =
          std::hypot(force[0] - before[0], force[1] - before[1], force[2] - before[2]);
      const double allowed = slew_limit_ * static_cast<double>(tick.period_ns) * 1e-9;
      const bool stopped = tick.pointers[0].reason == protocol::ForceReason::kEmergencyStop;
      const protocol::Vector& place = tick.pointers[0].position;
      for (std::size_t i = 0; i < 3; ++i) work_j -= before[i] * (place[i] - place_before[i]);
      largest_work_ = std::max(largest_work_.load(), work_j);
      if (!stopped) worst_over_slew_ = std::max(worst_over_slew_.load(), step - allowed);
    }
    place_before = tick.pointers[0].position;
    number_before = reader.received().number;
    before = force;
    const protocol::ImpulseUnits growth = Growth(tick, tick_before);
    for (std::size_t axis = 0; axis < 3; ++axis) displayed[axis] += growth[axis];
    tick_before = tick;
    const std::lock_guard lock(mutex_);
    ticks_.push_back({.tick = tick.tick,
                      .start_ns = tick.start_ns,
                      .world_frame = tick.world_frame,
                      .force = magnitude,
                      .force_x = force[0],
                      .finger_x = tick.pointers[0].position[0],
                      .reason = tick.pointers[0].reason,
                      .displayed = displayed});
  }
}

WatchedTick TickWatch::Latest() const {
  const std::lock_guard lock(mutex_);
  return ticks_.empty() ? WatchedTick{} : ticks_.back();
}

std::vector<WatchedTick> TickWatch::All() const {
  const std::lock_guard lock(mutex_);
  return ticks_;
}

protocol::HapticHealth ReadHapticHealth(const protocol::PeerView& view) {
  return ReadNewest<protocol::HapticHealth>(view);
}

protocol::WorldHealth ReadWorldHealth(const protocol::PeerView& view) {
  return ReadNewest<protocol::WorldHealth>(view);
}

protocol::WorldFrame ReadWorldFrame(const protocol::PeerView& view) {
  return ReadNewest<protocol::WorldFrame>(view);
}

std::uint64_t Disturbances(const protocol::PeerView& haptic, const protocol::PeerView& world) {
  const protocol::WorldHealth health = ReadWorldHealth(world);
  std::uint64_t late = health.missed;
  const std::size_t first = HistogramBucket(static_cast<std::int64_t>(health.period_ns / 10));
  for (std::size_t i = first; i < health.lateness.size(); ++i) late += health.lateness[i];
  return late + ReadHapticHealth(haptic).missed;
}

protocol::Body ReadMovingBody(const protocol::PeerView& view) {
  protocol::BodiesReader reader(view.Stream(protocol::StreamType::kWorldBodies));
  REQUIRE(Eventually([&] { return reader.ReadLatest() == protocol::ReadStatus::kFresh; }));
  for (const protocol::Body& body : reader.bodies()) {
    if (body.mass > 0) return body;
  }
  FAIL("no body can move");
  return {};
}

double Norm(const protocol::Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}

double Norm(const protocol::ImpulseUnits& units) {
  return protocol::kImpulseUnit * std::hypot(static_cast<double>(units[0]),
                                             static_cast<double>(units[1]),
                                             static_cast<double>(units[2]));
}

void CheckSafe(const TickWatch& watch) {
  CHECK(watch.lost() == 0);
  CHECK(watch.finite());
  CHECK(watch.worst_over_cap() <= 1e-9);
  CHECK(watch.worst_over_slew() <= 1e-9);
}

protocol::Books SettledBooks(const protocol::PeerView& haptic, Pushed pushed) {
  protocol::Books books;
  const auto any = [&] {
    const bool on_ground = pushed == Pushed::kFixed && Norm(books.ground) > 0;
    return on_ground || Norm(books.displayed) > 0;
  };
  CHECK(Eventually([&] {
    books = ReadHapticHealth(haptic).books;
    return any() && books.displayed == protocol::Plus(books.covered, books.peer_lost);
  }));
  CHECK(books.covered == protocol::Plus(books.applied, books.discarded));
  CHECK(any());
  return books;
}

}  // namespace rikiseki::test
