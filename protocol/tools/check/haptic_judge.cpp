// SPDX-License-Identifier: MIT
#include "protocol/tools/check/haptic_judge.h"

#include <algorithm>
#include <cmath>

#include "common/clock.h"
#include "protocol/tools/check/case.h"

namespace rikiseki::protocol::check {
namespace {

constexpr double kNsPerSecond = 1e9;
// Less is rounding of tensions that add up to nothing.
constexpr double kNoForce = 1e-6;  // N

std::string At(const HapticTick& tick) {
  return " at tick " + std::to_string(tick.tick);
}

double Seconds(std::uint64_t ns) {
  return static_cast<double>(ns) / kNsPerSecond;
}

Vector TotalForce(const HapticTick& tick) {
  Vector force{};
  for (std::uint32_t i = 0; i < tick.pointer_count; ++i) force = Sum(force, tick.pointers[i].force);
  return force;
}

ImpulseUnits GrowthOf(const Totals& before, const Channel& channel,
                      const ImpulseUnits Channel::*which) {
  const auto known = before.find(KeyOf(channel));
  return Minus(channel.*which, known == before.end() ? ImpulseUnits{} : known->second.*which);
}

bool SameBodies(std::span<const Plane> a, std::span<const Plane> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Plane& p, const Plane& q) {
    return p.body == q.body && p.generation == q.generation && p.pointer == q.pointer;
  });
}

}  // namespace

void HapticJudge::FramePublished(std::uint64_t epoch, std::uint64_t number,
                                 std::uint64_t acked_tick, std::span<const Plane> planes) {
  std::uint64_t& newest = newest_frame_[epoch];
  newest = std::max(newest, number);
  if (acked_tick > 0) {
    acked_tick_ = std::max(acked_tick_, acked_tick);
    any_ack_ = true;
  }
  if (epoch != shown_epoch_) {
    shown_.clear();
    was_shown_.clear();
    shown_epoch_ = epoch;
  }
  for (const Plane& plane : planes) {
    if (poisoned_bodies_.count(plane.body) != 0) return;  // nobody may take this one for shown
  }
  for (const Plane& plane : planes) {
    was_shown_.insert({plane.body, plane.generation, plane.pointer});
  }
  Shown shown{{planes.begin(), planes.end()}, 0};
  const auto before = shown_.find(number - 1);
  if (before != shown_.end() && SameBodies(before->second.planes, planes)) {
    shown.unchanged = before->second.unchanged + 1;
  }
  shown_[number] = std::move(shown);
}

void HapticJudge::Tick(const HapticTick& tick, const Received& received) {
  const bool consecutive = any_ && received.number == number_ + 1;
  Sequence(tick, received);
  Frames(tick);
  Forces(tick, consecutive);
  Channels(tick, consecutive);
  totals_ = TotalsOf(tick);
  newest_ = tick;
  number_ = received.number;
  any_ = true;
  const Pointer pointer = tick.pointer_count > 0 ? tick.pointers[0] : Pointer{};
  seen_.push_back({.tick = tick.tick,
                   .start_ns = static_cast<std::int64_t>(tick.start_ns),
                   .period_ns = static_cast<std::int64_t>(tick.period_ns),
                   .duration_ns = static_cast<std::int64_t>(tick.previous_duration_ns),
                   .world_epoch = tick.world_epoch,
                   .world_frame = tick.world_frame,
                   .reason = pointer.reason,
                   .position = pointer.position,
                   .force = pointer.force,
                   .radius = pointer.radius});
}

void HapticJudge::Sequence(const HapticTick& tick, const Received& received) {
  monitor_.Judge(kTickNumbers, tick.tick + 1 == received.number, [&] {
    return "message " + std::to_string(received.number) + " carries tick " +
           std::to_string(tick.tick) + ": one message for every tick, from 0";
  });
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  monitor_.Judge(kStamps, received.stamp_ns >= stamp_ns_ && received.stamp_ns <= now, [&] {
    return "stamp_ns " + std::to_string(received.stamp_ns) + " after " + std::to_string(stamp_ns_) +
           ", at " + std::to_string(now) + At(tick);
  });
  stamp_ns_ = received.stamp_ns;
  if (!any_ || received.number != number_ + 1) return;
  monitor_.Judge(kDuration, tick.start_ns - newest_.start_ns == tick.previous_duration_ns, [&] {
    return "start_ns grew by " + std::to_string(tick.start_ns - newest_.start_ns) +
           ", previous_duration_ns is " + std::to_string(tick.previous_duration_ns) + At(tick);
  });
}

void HapticJudge::Frames(const HapticTick& tick) {
  if (tick.world_epoch == 0) return;
  const auto newest = newest_frame_.find(tick.world_epoch);
  // Before the kit came there may have been another world.
  if (newest == newest_frame_.end() && seen_.empty()) return;
  const bool known =
      newest != newest_frame_.end() || (any_ && newest_.world_epoch == tick.world_epoch);
  const bool published = newest == newest_frame_.end() || tick.world_frame <= newest->second;
  const bool forward =
      !any_ || newest_.world_epoch != tick.world_epoch || tick.world_frame >= newest_.world_frame;
  const bool epoch_forward = !any_ || tick.world_epoch >= newest_.world_epoch;
  monitor_.Judge(kNames, known && published && forward && epoch_forward, [&] {
    return "names frame " + std::to_string(tick.world_frame) + " of epoch " +
           std::to_string(tick.world_epoch) +
           (!known       ? ", which is no epoch of a world that was ready"
            : !published ? ", which was not published yet"
                         : ", older than what was displayed before") +
           At(tick);
  });
  bool poisoned = poison_.count({tick.world_epoch, tick.world_frame}) != 0;
  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    poisoned = poisoned || poisoned_bodies_.count(tick.channels[i].body) != 0;
  }
  if (poison_.empty() && poisoned_bodies_.empty()) return;
  monitor_.Judge(kNeverShown, !poisoned,
                 [&] { return "displays a frame that had to be left alone" + At(tick); });
}

void HapticJudge::Forces(const HapticTick& tick, bool consecutive) {
  for (std::uint32_t i = 0; i < tick.pointer_count; ++i) {
    const double force = Norm(tick.pointers[i].force);
    monitor_.Judge(kCap, force <= tick.force_cap * (1 + 1e-9), [&] {
      return Num(force) + " N displayed, force_cap is " + Num(tick.force_cap) + At(tick);
    });
  }
  if (tick.world_epoch == 0) {
    monitor_.Judge(kNoWorld, Norm(TotalForce(tick)) <= kNoForce, [&] {
      return Num(Norm(TotalForce(tick))) + " N displayed without a world" + At(tick);
    });
  }
  const bool stopped =
      tick.pointer_count > 0 && tick.pointers[0].reason == ForceReason::kEmergencyStop;
  if (consecutive && slew_limit_ > 0 && !stopped) {
    const double step = Norm(Difference(TotalForce(tick), TotalForce(newest_)));
    const double most = slew_limit_ * Seconds(tick.period_ns) * (1 + 1e-9) + kNoForce;
    monitor_.Judge(kSlew, step <= most, [&] {
      return "the force steps by " + Num(step) + " N, the slew limit allows " + Num(most) +
             At(tick);
    });
  }
  // 7.3, over all that the device displayed: every channel and the ground.
  if (!consecutive) {
    exact_.reset();
    return;
  }
  const Totals totals = TotalsOf(tick);
  const ImpulseUnits grown =
      Plus(Growth(totals_, totals), Minus(tick.ground.impulse, newest_.ground.impulse));
  const double nominal = Seconds(tick.period_ns);
  const double correction = Seconds(tick.previous_duration_ns) - Seconds(newest_.period_ns);
  const Vector now = TotalForce(tick);
  const Vector before = TotalForce(newest_);
  // Each channel and the ground round by themselves, half a unit each way at both ends.
  const double rounding = 2.0 + tick.channel_count;
  std::array<double, 3> expected{};
  double worst = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    expected[i] = (-now[i] * nominal - before[i] * correction) / kImpulseUnit;
    const double slack = rounding + 1e-9 * std::abs(expected[i]);
    worst = std::max(worst, std::abs(static_cast<double>(grown[i]) - expected[i]) - slack);
  }
  monitor_.Judge(kImpulse, worst <= 0, [&] {
    return "channels and ground grew by " + Text(grown) + " units, -force times time is (" +
           Num(expected[0]) + ", " + Num(expected[1]) + ", " + Num(expected[2]) + ")" + At(tick);
  });

  if (!exact_) {
    exact_.emplace();
    booked_ = {};
  }
  booked_ = Plus(booked_, grown);
  double drift = 0;
  double scale = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    (*exact_)[i] += static_cast<long double>(expected[i]);
    drift = std::max(
        drift, std::abs(static_cast<double>(static_cast<long double>(booked_[i]) - (*exact_)[i])));
    scale = std::max(scale, std::abs(static_cast<double>((*exact_)[i])));
  }
  // As many channels as there may be were opened and closed in between; 1e-12 is the doubles' own.
  monitor_.Judge(kDrift, drift <= 64 + 1e-10 * scale, [&] {
    return "totals are " + Num(drift) + " units off after " + std::to_string(seen_.size()) +
           " ticks";
  });
}

void HapticJudge::Channels(const HapticTick& tick, bool consecutive) {
  const double nominal = Seconds(tick.period_ns);
  const double correction =
      any_ ? Seconds(tick.previous_duration_ns) - Seconds(newest_.period_ns) : 0;
  const ImpulseUnits ground = Minus(tick.ground.impulse, newest_.ground.impulse);

  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    const Channel& channel = tick.channels[i];
    const auto before = totals_.find(KeyOf(channel));
    const bool is_new = before == totals_.end();
    if (is_new && consecutive) {
      // One tick of the whole force is the most that a channel can hold at its birth.
      const double most =
          (Norm(TotalForce(tick)) * nominal + 1e-9 * tick.force_cap) / kImpulseUnit + 2;
      monitor_.Judge(kOpens, channel.opened_tick <= tick.tick && Largest(channel.impulse) <= most,
                     [&] {
                       return "a channel for body " + std::to_string(channel.body) +
                              " appears with opened_tick " + std::to_string(channel.opened_tick) +
                              " and " + Text(channel.impulse) + " units" + At(tick);
                     });
    }
    if (channel.state == ChannelState::kClosed) {
      if (closed_at_.count(KeyOf(channel)) == 0) closed_at_[KeyOf(channel)] = tick.tick;
    } else {
      closed_at_.erase(KeyOf(channel));
    }
    if (!consecutive) continue;

    // First moments follow from J alone.
    const Vector zero{};
    const Channel& old = is_new ? Channel{} : before->second;
    const Vector& moment_before = is_new ? zero : old.first_moment;
    double moment_error = 0;
    double moment_scale = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double j_now = static_cast<double>(channel.impulse[axis]) * kImpulseUnit;
      const double j_before = static_cast<double>(old.impulse[axis]) * kImpulseUnit;
      const double expected = moment_before[axis] + j_now * nominal + j_before * correction;
      moment_error = std::max(moment_error, std::abs(channel.first_moment[axis] - expected));
      moment_scale = std::max(moment_scale, std::abs(expected));
    }
    monitor_.Judge(kFirstMoments, moment_error <= 1e-15 + 1e-9 * moment_scale, [&] {
      return "first_moment is " + Num(moment_error) + " N s^2 off" + At(tick);
    });

    // The moment of what the channel got in this tick and of the correction of the tick before. With
    // one channel and nothing for the ground, its share is the whole force.
    const ImpulseUnits grown = GrowthOf(totals_, channel, &Channel::impulse);
    if (tick.channel_count != 1 || Largest(grown) < 1e3) continue;
    if (newest_.channel_count > 1 || (newest_.channel_count == 1 && is_new)) continue;
    if (Largest(ground) > 1e-3 * Largest(grown)) continue;
    const Vector paid = Scaled(TotalForce(tick), -nominal / kImpulseUnit);
    const Vector late = Scaled(TotalForce(newest_), -correction / kImpulseUnit);
    const Vector expected = Sum(Cross(channel.contact_point, paid),
                                Cross(is_new ? channel.contact_point : old.contact_point, late));
    const ImpulseUnits turned = GrowthOf(totals_, channel, &Channel::angular_impulse);
    double worst = 0;
    const double lever = Norm(channel.contact_point) + (is_new ? 0 : Norm(old.contact_point));
    const double slack = 3 + lever * (2 + 2 * Largest(ground)) + 1e-9 * Norm(expected);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      worst = std::max(worst, std::abs(static_cast<double>(turned[axis]) - expected[axis]));
    }
    monitor_.Judge(kMoment, worst <= slack, [&] {
      return "L grew by " + Text(turned) + ", contact_point x impulse is (" + Num(expected[0]) +
             ", " + Num(expected[1]) + ", " + Num(expected[2]) + ")" + At(tick);
    });
    const Pointer& pointer = tick.pointers[0];
    const double distance = Norm(Difference(channel.contact_point, pointer.position));
    // On the finger's sphere or, for a proxy, on the surface that it is kept out of.
    monitor_.Judge(kContactPoint, distance <= 2 * pointer.radius + 0.02, [&] {
      return "contact_point is " + Num(distance) + " m away from a finger of radius " +
             Num(pointer.radius) + At(tick);
    });
  }

  // Channels that went.
  for (const auto& total : totals_) {
    const auto& key = total.first;
    const auto same = [&](const Channel& channel) { return KeyOf(channel) == key; };
    const auto end = tick.channels.begin() + tick.channel_count;
    if (!consecutive || std::any_of(tick.channels.begin(), end, same)) continue;
    const auto closed = closed_at_.find(key);
    const bool other_world = tick.world_epoch != newest_.world_epoch && tick.world_epoch != 0;
    const bool acked = closed != closed_at_.end() && any_ack_ && closed->second <= acked_tick_;
    monitor_.Judge(kFreed, other_world || acked, [&] {
      return "the channel of body " + std::to_string(std::get<0>(key)) +
             (closed == closed_at_.end() ? " vanished without having been closed"
                                         : " was closed by tick " + std::to_string(closed->second) +
                                               " and freed when only tick " +
                                               std::to_string(acked_tick_) + " was acknowledged") +
             At(tick);
    });
    closed_at_.erase(key);
  }

  // A displayed contact has a channel: where the frame displayed, and those around it, have one body.
  const auto shown = shown_.find(tick.world_frame);
  if (tick.world_epoch != shown_epoch_ || shown == shown_.end()) return;
  const std::vector<Plane>& planes = shown->second.planes;
  if (planes.size() != 1 || shown->second.unchanged < 2 || tick.pointer_count == 0) return;
  if (planes[0].inverse_mass == 0) return;  // ground's
  if (Norm(TotalForce(tick)) < 0.01) return;
  // The world that we play was held up for so long that it counts as lost: what brakes the finger then is no
  // contact, and ground's.
  if (tick.pointers[0].reason == ForceReason::kWorldLost) return;
  // One that vanished while it was pressed may fade (6.2, recovery): its own channel grows by that.
  const auto fits = [&](const Channel& channel) {
    const bool is_shown = channel.body == planes[0].body &&
                          channel.generation == planes[0].generation &&
                          channel.pointer == planes[0].pointer;
    return is_shown ||
           (was_shown_.count({channel.body, channel.generation, channel.pointer}) != 0 &&
            Largest(GrowthOf(totals_, channel, &Channel::impulse)) > 0);
  };
  const auto end = tick.channels.begin() + tick.channel_count;
  const bool has = std::any_of(tick.channels.begin(), end, fits);
  monitor_.Judge(kHasChannel, has, [&] {
    return Num(Norm(TotalForce(tick))) + " N displayed against body " +
           std::to_string(planes[0].body) + " without a channel" + At(tick);
  });
}

}  // namespace rikiseki::protocol::check
