// SPDX-License-Identifier: MIT
#include "world_server/coupling/ledger_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/impulse_units.h"

namespace rikiseki::world {
namespace {

using protocol::DiscardReason;
using protocol::ImpulseUnits;
using protocol::Minus;
using protocol::Plus;

// No finger reaches farther from the world origin: bounds hostile angular totals through the gap
// rule.
constexpr double kLongestLever = 10.0;  // m

// A message that covers more is damaged or hostile.
constexpr std::uint64_t kLongestTickNs = 10'000'000'000;

// What stays within an int64 of impulse units with room to spare, whatever the configuration says.
constexpr double kLargestCountable = 4e6;  // N s, N m s

Vec3 InSi(const ImpulseUnits& units) {
  return ToVec3(protocol::InSi(units));
}

}  // namespace

ImpulseUnits LedgerBooks::TotalDiscarded() const {
  ImpulseUnits sum{};
  for (const ImpulseUnits& units : discarded) sum = Plus(sum, units);
  return sum;
}

bool LedgerReader::KnownChannel::Is(const protocol::Channel& channel) const {
  return body == channel.body && generation == channel.generation && pointer == channel.pointer &&
         opened_tick == channel.opened_tick;
}

LedgerReader::LedgerReader(std::uint64_t own_epoch, protocol::Coupling coupling,
                           double largest_impulse_ns)
    : own_epoch_(own_epoch), coupling_(coupling), largest_impulse_ns_(largest_impulse_ns) {}

void LedgerReader::SetBodies(std::vector<BodyTag> bodies) {
  const auto reason = static_cast<std::size_t>(DiscardReason::kUnknownBody);
  const auto stays = [&](std::size_t body) {
    return body < bodies.size() && bodies[body].movable && bodies_[body].movable &&
           bodies[body].generation == bodies_[body].generation;
  };
  for (std::size_t body = 0; body < owed_.size(); ++body) {
    if (stays(body)) continue;
    const OwedUnits gone = std::exchange(owed_[body], {});
    life_books_.discarded[reason] = Plus(life_books_.discarded[reason], gone.impulse);
    epoch_books_.discarded[reason] =
        Plus(epoch_books_.discarded[reason], Minus(gone.impulse, gone.impulse_before));
  }
  std::size_t kept = 0;
  std::size_t i = 0;
  for (ReplayTick& tick : replay_.ticks) {
    for (; i < tick.end; ++i) {
      if (stays(replay_.impulses[i].body)) replay_.impulses[kept++] = replay_.impulses[i];
    }
    tick.end = kept;
  }
  replay_.impulses.resize(kept);
  bodies_ = std::move(bodies);
  owed_.resize(bodies_.size());
}

void LedgerReader::BeginEpoch(std::uint64_t epoch) {
  epoch_ = epoch;
  has_baseline_ = false;
  known_.clear();
  fingers_.fill(std::nullopt);
  epoch_books_ = {};
  for (OwedUnits& body : owed_) body.impulse_before = body.impulse;
}

void LedgerReader::Discard(const ImpulseUnits& impulse, DiscardReason reason) {
  for (LedgerBooks* books : {&epoch_books_, &life_books_}) {
    ImpulseUnits& sum = books->discarded[static_cast<std::size_t>(reason)];
    sum = Plus(sum, impulse);
  }
}

std::vector<LedgerReader::Increment> LedgerReader::IncrementsOf(const protocol::HapticTick& tick,
                                                                std::uint64_t ticks,
                                                                double length_s) {
  const std::size_t count = std::min(tick.channel_count, protocol::kMaxChannels);
  std::vector<KnownChannel> present;
  std::vector<Increment> increments;
  const double held_s = static_cast<double>(ticks) * static_cast<double>(tick.period_ns) * 1e-9;
  Fingers fingers;
  for (const protocol::Pointer& pointer :
       std::span(tick.pointers).first(std::min(tick.pointer_count, protocol::kMaxPointers))) {
    if (pointer.pointer < fingers.size()) fingers[pointer.pointer] = ToVec3(pointer.position);
  }
  for (const protocol::Channel& channel : std::span(tick.channels).first(count)) {
    const auto is_same = [&](const KnownChannel& known) { return known.Is(channel); };
    if (std::any_of(present.begin(), present.end(), is_same)) continue;  // said twice: once counts
    KnownChannel now{.body = channel.body,
                     .generation = channel.generation,
                     .pointer = channel.pointer,
                     .opened_tick = channel.opened_tick,
                     .impulse = channel.impulse,
                     .angular_impulse = channel.angular_impulse,
                     .first_moment = ToVec3(channel.first_moment),
                     .angular_first_moment = ToVec3(channel.angular_first_moment)};

    KnownChannel before = now;
    const auto known = std::find_if(known_.begin(), known_.end(), is_same);
    if (known != known_.end()) {
      before = *known;
    } else if (has_baseline_ && channel.opened_tick > last_tick_) {
      before.impulse = before.angular_impulse = {};
      before.first_moment = before.angular_first_moment = Vec3::Zero();
    }  // else it is part of the baseline, or its history is unknown: it counts from here
    const ImpulseUnits impulse = Minus(now.impulse, before.impulse);
    if (held_s > 0) now.force = InSi(impulse) / held_s;
    if (tick.stiffness > 0) now.spring_j = 0.5 * now.force.squaredNorm() / tick.stiffness;
    double work_j = 0;
    if (now.pointer < fingers.size() && fingers[now.pointer] && fingers_[now.pointer]) {
      // What was lost between the two is in the sum of this one.
      const Vec3& force = ticks > 1 ? now.force : before.force;
      work_j = force.dot(*fingers[now.pointer] - *fingers_[now.pointer]);
    }
    present.push_back(now);
    increments.push_back(
        {.body = channel.body,
         .generation = channel.generation,
         .impulse = impulse,
         .angular_impulse = Minus(now.angular_impulse, before.angular_impulse),
         .first_moment = now.first_moment - before.first_moment - length_s * InSi(before.impulse),
         .angular_first_moment = now.angular_first_moment - before.angular_first_moment -
                                 length_s * InSi(before.angular_impulse),
         .point = ToVec3(channel.contact_point),
         .work_j = work_j});
  }
  known_ = std::move(present);
  fingers_ = fingers;
  return increments;
}

bool LedgerReader::CanMove(std::uint32_t body, std::uint32_t generation) const {
  return body < bodies_.size() && bodies_[body].movable && bodies_[body].generation == generation;
}

bool LedgerReader::Consume(const protocol::HapticTick& tick) {
  if (has_baseline_ && tick.tick <= last_tick_) return false;
  const std::uint64_t ticks = has_baseline_ ? tick.tick - last_tick_ : 1;
  const std::uint64_t length_ns = !has_baseline_ ? 0
                                  : ticks > 1    ? tick.start_ns - last_start_ns_
                                                 : tick.previous_duration_ns;
  const double length_s = static_cast<double>(std::min(length_ns, kLongestTickNs)) * 1e-9;
  const std::vector<Increment> increments = IncrementsOf(tick, ticks, length_s);
  if (!has_baseline_) {
    has_baseline_ = true;
    baseline_tick_ = tick.tick;
  }
  last_tick_ = tick.tick;
  last_start_ns_ = tick.start_ns;
  const bool replays = coupling_ == protocol::Coupling::kLocal;
  if (replays) {
    replay_.ticks.push_back({.length_s = length_s, .ticks = ticks, .end = replay_.impulses.size()});
  }

  const bool by_position = coupling_ == protocol::Coupling::kPosition;
  const bool foreign = own_epoch_ != 0 && tick.world_epoch != own_epoch_;
  if (by_position || foreign) {
    for (const Increment& increment : increments) {
      Discard(increment.impulse,
              by_position ? DiscardReason::kCoupling : DiscardReason::kForeignWorld);
    }
    return true;
  }

  for (const Increment& increment : increments) {
    if (!CanMove(increment.body, increment.generation)) continue;
    consumed_ns_ += InSi(increment.impulse).norm();
    consumed_nms_ += InSi(increment.angular_impulse).norm();
  }
  const bool gap = consumed_ns_ > std::min(largest_impulse_ns_, kLargestCountable) ||
                   consumed_nms_ > std::min(largest_impulse_ns_ * kLongestLever, kLargestCountable);
  for (const Increment& increment : increments) {
    if (!CanMove(increment.body, increment.generation)) {
      Discard(increment.impulse, DiscardReason::kUnknownBody);
    } else if (gap) {
      Discard(increment.impulse, DiscardReason::kGap);
    } else {
      OwedUnits& owed = owed_[increment.body];
      owed.impulse = Plus(owed.impulse, increment.impulse);
      owed.angular_impulse = Plus(owed.angular_impulse, increment.angular_impulse);
      owed.work_j += increment.work_j;
      const bool nothing =
          increment.impulse == ImpulseUnits{} && increment.angular_impulse == ImpulseUnits{};
      if (!replays || nothing) continue;
      replay_.impulses.push_back({.body = increment.body,
                                  .impulse = InSi(increment.impulse),
                                  .angular_impulse = InSi(increment.angular_impulse),
                                  .first_moment = increment.first_moment,
                                  .angular_first_moment = increment.angular_first_moment,
                                  .point = increment.point});
    }
  }
  if (replays) replay_.ticks.back().end = replay_.impulses.size();
  return true;
}

std::span<const OwedPush> LedgerReader::Take() {
  taken_.clear();
  ImpulseUnits sum{}, sum_before{};
  for (std::size_t body = 0; body < owed_.size(); ++body) {
    const OwedUnits owed = std::exchange(owed_[body], {});
    sum = Plus(sum, owed.impulse);
    sum_before = Plus(sum_before, owed.impulse_before);
    if (owed.impulse == ImpulseUnits{} && owed.angular_impulse == ImpulseUnits{}) continue;
    taken_.push_back({.push = {.body = bodies_[body].place,
                               .impulse = InSi(owed.impulse),
                               .angular_impulse = InSi(owed.angular_impulse)},
                      .work_j = owed.work_j,
                      .spring_j = owed.spring_j});
  }
  life_books_.applied = Plus(life_books_.applied, sum);
  epoch_books_.applied = Plus(epoch_books_.applied, Minus(sum, sum_before));
  for (const KnownChannel& held : known_) {
    if (CanMove(held.body, held.generation)) owed_[held.body].spring_j += held.spring_j;
  }
  consumed_ns_ = consumed_nms_ = 0;
  std::swap(taken_replay_, replay_);
  for (ReplayImpulse& push : taken_replay_.impulses) push.body = bodies_[push.body].place;
  replay_.ticks.clear();
  replay_.impulses.clear();
  return taken_;
}

void LedgerReader::GiveBack(const Vec3& impulse) {
  ImpulseUnits units{};
  for (std::size_t i = 0; i < units.size(); ++i) {
    const double exact = impulse[static_cast<Eigen::Index>(i)] / protocol::kImpulseUnit;
    if (std::abs(exact) <= kLargestCountable / protocol::kImpulseUnit) {
      units[i] = std::llround(exact);
    }
  }
  for (LedgerBooks* books : {&epoch_books_, &life_books_}) {
    books->applied = Minus(books->applied, units);
  }
  Discard(units, DiscardReason::kGap);
}

}  // namespace rikiseki::world
