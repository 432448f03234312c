// SPDX-License-Identifier: MIT
#include "haptic_server/render/ledger.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

constexpr double kUnitsPerNewtonSecond = 1 / protocol::kImpulseUnit;
constexpr double kLargestUnits = 4e18;  // per call: int64 holds 9.2e18

using protocol::Minus;
using protocol::Plus;

Vec3 InNewtonSeconds(const protocol::ImpulseUnits& units) {
  return ToVec3(protocol::InSi(units));
}

// How much of the wanted force was displayed, 0..1.
double DisplayedFraction(const Vec3& displayed, const Vec3& wanted) {
  const double largest = wanted.cwiseAbs().maxCoeff();
  if (!(largest > 1e-12) || !wanted.allFinite()) return 0;  // below a piconewton: no direction
  const Vec3 direction = wanted / largest;
  return std::clamp(displayed.dot(direction) / direction.squaredNorm() / largest, 0.0, 1.0);
}

}  // namespace

protocol::ImpulseUnits ImpulseQuantizer::Add(const Vec3& impulse) noexcept {
  protocol::ImpulseUnits units;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    double exact = impulse[axis] * kUnitsPerNewtonSecond + remainder_[axis];
    if (std::isnan(exact)) exact = 0;
    units[i] = std::llrint(std::clamp(exact, -kLargestUnits, kLargestUnits));
    remainder_[axis] = std::clamp(exact - static_cast<double>(units[i]), -0.5, 0.5);
  }
  return units;
}

Ledger::Ledger(std::int64_t period_ns, std::uint64_t history_ticks, std::uint64_t own_epoch)
    : period_s_(Seconds(period_ns)),
      own_epoch_(own_epoch),
      history_(std::bit_ceil(std::max<std::uint64_t>(history_ticks, 2))) {}

bool Ledger::Lookup(std::uint64_t tick, protocol::ImpulseUnits& displayed) const noexcept {
  if (tick >= ticks_ || ticks_ - tick > history_.size()) return false;
  displayed = history_[tick & (history_.size() - 1)];
  return true;
}

void Ledger::Receive(std::uint64_t world_epoch, const protocol::WorldFrame& frame) noexcept {
  if (frame.acked_epoch == 0 || (own_epoch_ != 0 && frame.acked_epoch != own_epoch_)) return;
  protocol::ImpulseUnits displayed{};
  if (frame.acked_tick < acked_tick_ || !Lookup(frame.acked_tick, displayed)) return;

  if (world_epoch != world_epoch_ || frame.baseline_tick != world_baseline_) {
    protocol::ImpulseUnits baseline{};
    if (frame.baseline_tick >= acked_tick_ && frame.baseline_tick <= frame.acked_tick &&
        Lookup(frame.baseline_tick, baseline)) {
      world_applied_ = world_discarded_ = {};
    } else {  // its beginning is out of sight: count from here
      baseline = displayed;
      world_applied_ = frame.applied;
      world_discarded_ = frame.discarded;
    }
    books_.peer_lost = Plus(books_.peer_lost, Minus(baseline, acked_));
    acked_ = baseline;
    world_epoch_ = world_epoch;
    world_baseline_ = frame.baseline_tick;
  }
  books_.covered = Plus(books_.covered, Minus(displayed, acked_));
  books_.applied = Plus(books_.applied, Minus(frame.applied, world_applied_));
  books_.discarded = Plus(books_.discarded, Minus(frame.discarded, world_discarded_));
  acked_ = displayed;
  acked_tick_ = frame.acked_tick;
  world_applied_ = frame.applied;
  world_discarded_ = frame.discarded;
  for (Account& account : accounts_) {
    if (account.used && account.channel.state == protocol::ChannelState::kClosed &&
        account.closed_tick <= acked_tick_) {
      account.used = false;
    }
  }
}

void Ledger::BeginWorld(std::uint64_t world_epoch) noexcept {
  if (world_epoch == world_epoch_) return;
  for (Account& account : accounts_) account.used = false;
}

Ledger::Account* Ledger::Find(std::uint32_t body, std::uint32_t generation,
                              std::uint32_t pointer) noexcept {
  for (Account& account : accounts_) {
    if (account.used && account.channel.body == body && account.channel.generation == generation &&
        account.channel.pointer == pointer) {
      return &account;
    }
  }
  return nullptr;
}

bool Ledger::Open(std::uint32_t body, std::uint32_t generation, std::uint32_t pointer,
                  std::uint64_t tick) noexcept {
  Account* account = Find(body, generation, pointer);
  if (account != nullptr) {
    account->channel.state = protocol::ChannelState::kOpen;
    return true;
  }
  const auto free = std::find_if(accounts_.begin(), accounts_.end(),
                                 [](const Account& other) { return !other.used; });
  if (free == accounts_.end()) return false;
  *free = {};
  free->used = true;
  free->channel.body = body;
  free->channel.generation = generation;
  free->channel.pointer = pointer;
  free->channel.opened_tick = tick;
  return true;
}

void Ledger::Close(Account& account, std::uint64_t tick) noexcept {
  account.channel.state = protocol::ChannelState::kClosed;
  account.closed_tick = tick;
}

// Books `force` [N, on the body] for a nominal period, and corrects what was booked for the tick
// before by `correction_s`, which that one lasted longer.
void Ledger::Pay(Account& account, const Vec3& force, const Vec3& point,
                 double correction_s) noexcept {
  protocol::Channel& channel = account.channel;
  const Vec3 now = force * period_s_;
  const Vec3 late = account.force * correction_s;
  const Vec3 before = InNewtonSeconds(channel.impulse);
  const Vec3 angular_before = InNewtonSeconds(channel.angular_impulse);
  channel.impulse = Plus(channel.impulse, account.linear.Add(now + late));
  channel.angular_impulse = Plus(channel.angular_impulse,
                                 account.angular.Add(point.cross(now) + account.point.cross(late)));
  const Vec3 after = InNewtonSeconds(channel.impulse);
  const Vec3 angular_after = InNewtonSeconds(channel.angular_impulse);
  channel.first_moment =
      ToArray(ToVec3(channel.first_moment) + before * correction_s + after * period_s_);
  channel.angular_first_moment = ToArray(ToVec3(channel.angular_first_moment) +
                                         angular_before * correction_s + angular_after * period_s_);
  account.force = force;
  account.point = point;
}

void Ledger::Book(const Entry& entry) noexcept {
  const double correction_s = ticks_ == 0 ? 0 : Seconds(entry.previous_duration_ns) - period_s_;
  Vec3 wanted = Vec3::Zero();
  for (const BodyShare& share : entry.wanted) wanted += share.force;
  const double fraction = DisplayedFraction(entry.displayed - entry.for_ground, wanted);

  Vec3 to_bodies = Vec3::Zero();
  protocol::ImpulseUnits booked{};
  booked_count_ = 0;
  for (Account& account : accounts_) {
    if (!account.used) continue;
    Vec3 force = Vec3::Zero();
    Vec3 point = account.point;
    for (const BodyShare& share : entry.wanted) {
      if (!share.fixed && share.body == account.channel.body &&
          share.generation == account.channel.generation &&
          entry.pointer == account.channel.pointer) {
        force = -fraction * share.force;
        const double size = force.stableNorm();
        if (size > entry.largest_share) force *= entry.largest_share / size;
        point = share.point;
        account.channel.contact_point = ToArray(point);
      }
    }
    const protocol::ImpulseUnits before = account.channel.impulse;
    const protocol::ImpulseUnits angular_before = account.channel.angular_impulse;
    Pay(account, force, point, correction_s);
    const protocol::ImpulseUnits added = Minus(account.channel.impulse, before);
    booked = Plus(booked, added);
    to_bodies += force;
    if (added != protocol::ImpulseUnits{} && booked_count_ < kMaxTickImpulses) {
      booked_[booked_count_++] = {
          account.channel.body, account.channel.generation, InNewtonSeconds(added),
          InNewtonSeconds(Minus(account.channel.angular_impulse, angular_before))};
    }
  }

  const protocol::ImpulseUnits total =
      total_quantizer_.Add(-entry.displayed * period_s_ + total_force_ * correction_s);
  const protocol::ImpulseUnits to_ground = Minus(total, booked);
  Vec3 rest = -entry.displayed - to_bodies;  // without the fixed bodies' part it is nobody's
  Vec3 ground_moment = Vec3::Zero();
  for (const BodyShare& share : entry.wanted) {
    if (!share.fixed) continue;
    const Vec3 force = -fraction * share.force;
    rest -= force;
    ground_moment += share.point.cross(force);
  }
  ground_moment += entry.finger.cross(rest);
  ground_.impulse = Plus(ground_.impulse, to_ground);
  ground_.angular_impulse =
      Plus(ground_.angular_impulse,
           ground_angular_.Add(ground_moment * period_s_ + ground_moment_ * correction_s));
  total_force_ = -entry.displayed;
  ground_moment_ = ground_moment;

  books_.displayed = Plus(books_.displayed, booked);
  books_.ground = ground_.impulse;
  history_[ticks_ & (history_.size() - 1)] = books_.displayed;
  ++ticks_;
}

void Ledger::Write(protocol::HapticTick& message) const noexcept {
  message.channel_count = 0;
  for (const Account& account : accounts_) {
    if (account.used) message.channels[message.channel_count++] = account.channel;
  }
  message.ground = ground_;
}

}  // namespace rikiseki::haptic
