// SPDX-License-Identifier: MIT
#include "haptic_server/render/local_bodies.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

constexpr double kStiff = 1;        // k T^2/M + 2 d T/M, numerics section 4
constexpr double kUnit = 1e-6;      // how far from 1 the length of a unit vector may be
constexpr double kFarthest = 1e6;   // m, m/s, rad/s: beyond, a copy has come apart
constexpr double kNoDepth = 1e-15;  // m: no direction
constexpr double kLightest = 1e-9;  // kg; heaviest likewise: of the wire
constexpr double kHeaviest = 1e9;

// What a step may cost: the world's substeps are not followed below this length [s], nor is a tick
// of many times its period divided into more substeps than so many whole ones have.
constexpr double kShortestSubstep = 1e-4;
constexpr int kLongestTick = 8;

Mat3 ToInertia(const std::array<double, 6>& i) {
  Mat3 inertia;
  inertia << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
  return inertia;
}

bool Bounded(const Vec3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() <= kFarthest;
}

}  // namespace

LocalBodies::LocalBodies(std::int64_t period_ns, std::uint64_t history_ticks,
                         std::uint64_t own_epoch, PositionRule rule)
    : period_s_(Seconds(period_ns)),
      own_epoch_(own_epoch),
      rule_(rule),
      history_(std::bit_ceil(std::max<std::uint64_t>(history_ticks, 2))) {}

std::size_t LocalBodies::Copies::Place(std::uint32_t body,
                                       std::uint32_t generation) const noexcept {
  std::size_t i = 0;
  while (i < body_count && (identities[i].body != body || identities[i].generation != generation)) {
    ++i;
  }
  return i;
}

bool LocalBodies::Copies::Sound() const noexcept {
  return std::all_of(bodies.begin(), bodies.begin() + static_cast<std::ptrdiff_t>(body_count),
                     [](const StepBody& body) {
                       return Bounded(body.state.pose.position) && Bounded(body.state.velocity) &&
                              Bounded(body.state.angular_velocity) &&
                              body.state.pose.orientation.coeffs().allFinite();
                     });
}

// What steps can be made of.
bool LocalBodies::Copies::Usable() const noexcept {
  const auto body_end = bodies.begin() + static_cast<std::ptrdiff_t>(body_count);
  const auto contact_end = contacts.begin() + static_cast<std::ptrdiff_t>(contact_count);
  return Sound() &&
         std::all_of(bodies.begin(), body_end,
                     [](const StepBody& body) {
                       const BodyInertia& inertia = body.inertia;
                       return inertia.mass_kg >= kLightest && inertia.mass_kg <= kHeaviest &&
                              inertia.inertia_B.diagonal().minCoeff() > 0 &&
                              inertia.inertia_B.determinant() > 0 &&
                              inertia.inverse_B.allFinite() && Bounded(body.acceleration) &&
                              Bounded(body.angular_acceleration) &&
                              std::abs(body.state.pose.orientation.norm() - 1) < kUnit;
                     }) &&
         std::all_of(contacts.begin(), contact_end, [](const StepContact& contact) {
           return Bounded(contact.p_B) && Bounded(contact.point) && Bounded(contact.velocity) &&
                  std::abs(contact.normal.norm() - 1) < kUnit && contact.friction >= 0 &&
                  contact.friction <= kFarthest && std::isfinite(contact.normal_impulse);
         });
}

void LocalBodies::Load(const protocol::WorldFrame& frame, Copies& copies) const noexcept {
  copies.body_count = std::min<std::size_t>(frame.local_body_count, kMaxStepBodies);
  copies.contact_count = 0;
  const double world_substep_s = static_cast<double>(frame.local_substep_ns) * 1e-9;
  copies.longest_substep_s = std::max(world_substep_s, kShortestSubstep);
  for (std::size_t i = 0; i < copies.body_count; ++i) {
    const protocol::LocalBody& from = frame.local_bodies[i];
    copies.identities[i] = {from.body, from.generation};
    copies.coasts[i] = false;
    StepBody& to = copies.bodies[i];
    to.state = {.pose = {ToVec3(from.position), ToQuat(from.orientation)},
                .velocity = ToVec3(from.velocity),
                .angular_velocity = ToVec3(from.angular_velocity)};
    to.inertia = BodyInertia::Of(from.mass, ToInertia(from.inertia));
    to.acceleration = ToVec3(from.acceleration);
    to.angular_acceleration = ToVec3(from.angular_acceleration);
  }
  // Impulses of the world's substep, for a step of ours.
  const double step_s = period_s_ / SubstepCount(period_s_, copies.longest_substep_s);
  const double warmth = world_substep_s > 0 ? step_s / world_substep_s : 0;
  for (std::size_t i = 0; i < copies.body_count; ++i) {
    const protocol::LocalBody& from = frame.local_bodies[i];
    const Pose& pose_WB = copies.bodies[i].state.pose;
    const std::size_t count =
        std::min<std::size_t>(from.contact_count, protocol::kMaxContactPlanes);
    for (const protocol::ContactPlane& plane : std::span(from.contacts).first(count)) {
      StepContact& to = copies.contacts[copies.contact_count++];
      const Vec3 normal = ToVec3(plane.normal);
      to = {};
      to.body = i;
      to.p_B = ToVec3(plane.point);
      to.radius = plane.radius;
      to.friction = plane.friction;
      to.normal_impulse = std::max(0.0, warmth * normal.dot(ToVec3(plane.impulse)));
      to.normal = normal;
      to.point = pose_WB * to.p_B - (to.radius + plane.gap) * normal;
      const std::size_t other = copies.Place(plane.other_body, plane.other_generation);
      if (other < copies.body_count) {
        const Pose pose_OW = copies.bodies[other].state.pose.Inverse();
        to.other = other;
        to.point = pose_OW * to.point;
        to.normal = pose_OW.orientation * normal;
      } else {
        to.velocity = ToVec3(plane.other_velocity);
      }
    }
  }
}

void LocalBodies::Receive(const protocol::WorldFrame& frame, std::uint64_t tick) noexcept {
  if (frame.local_body_count == 0) return Clear();
  const bool knows_us =
      frame.acked_epoch != 0 && (own_epoch_ == 0 || frame.acked_epoch == own_epoch_);
  const std::uint64_t next = knows_us ? frame.acked_tick + 1 : tick;
  if (next > tick || tick - next >= history_.size()) return Clear();  // forgotten by then
  // Where frames come so fast that none would be caught up with, the one that is nearer goes on.
  if (catching_up_ && next_replay_ > next) return;
  Load(frame, scratch_);
  if (!scratch_.Usable()) return Clear();
  arriving_ = scratch_;
  next_replay_ = next;
  const auto behind = static_cast<std::int64_t>(tick - next);
  const std::int64_t ticks_per_frame = std::max<std::int64_t>(
      1, std::llround(static_cast<double>(frame.period_ns) * 1e-9 / period_s_));
  replay_per_tick_ = std::max(kReplayPerTick, 2 * behind / ticks_per_frame + 2);
  catching_up_ = true;
  LetIn(arriving_, static_cast<double>(behind) * period_s_);
  if (next_replay_ == tick) TakeOver();
}

// Bodies that have no copy yet are shown where their velocity has brought them since the frame, and
// coast until it is caught up with.
void LocalBodies::LetIn(const Copies& arriving, double age_s) noexcept {
  for (std::size_t i = 0; i < arriving.body_count; ++i) {
    const Identity& identity = arriving.identities[i];
    if (live_.Place(identity.body, identity.generation) < live_.body_count) continue;
    if (live_.body_count == kMaxStepBodies) return;
    live_.identities[live_.body_count] = identity;
    live_.coasts[live_.body_count] = true;
    StepBody& body = live_.bodies[live_.body_count++];
    body = arriving.bodies[i];
    body.acceleration = body.angular_acceleration = Vec3::Zero();
    body.state.pose.position += age_s * body.state.velocity;
    AdvanceRotation(body.inertia, age_s, body.state);
    live_.longest_substep_s = arriving.longest_substep_s;
  }
}

void LocalBodies::Clear() noexcept {
  live_.body_count = live_.contact_count = 0;
  catching_up_ = false;
}

const BodyState* LocalBodies::Find(std::uint32_t body, std::uint32_t generation) const noexcept {
  const std::size_t place = live_.Place(body, generation);
  return place < live_.body_count ? &live_.bodies[place].state : nullptr;
}

void LocalBodies::SolveStiff(std::span<BodyShare> shares) noexcept {
  if (live_.body_count == 0) return;
  std::array<StepSpring, kMaxStepSprings> springs;
  std::array<BodyShare*, kMaxStepSprings> stiff;
  std::size_t count = 0;
  for (BodyShare& share : shares) {
    const std::size_t place = live_.Place(share.body, share.generation);
    const double depth = share.displacement.norm();
    if (place == live_.body_count || !(depth > kNoDepth) || count == kMaxStepSprings) continue;
    const StepBody& body = live_.bodies[place];
    const Vec3 normal = share.displacement / depth;
    const double mobility =
        InverseEffectiveMass(body.inertia, body.state.pose, share.point, normal);
    const double gain = period_s_ * (period_s_ * share.stiffness + share.damping);
    if (!(mobility * (gain + period_s_ * share.damping) >= kStiff)) continue;
    stiff[count] = &share;
    springs[count++] = {.body = place,
                        .point_W = share.point,
                        .normal = normal,
                        .base_ns = period_s_ * share.stiffness * depth,
                        .per_speed_kg = gain};
  }
  if (count == 0) return;

  scratch_ = live_;
  for (const BodyShare& share : shares) {
    const std::size_t place = live_.Place(share.body, share.generation);
    const auto end = stiff.begin() + static_cast<std::ptrdiff_t>(count);
    if (place == live_.body_count || std::find(stiff.begin(), end, &share) != end) continue;
    StepBody& body = scratch_.bodies[place];
    const Vec3 impulse = -period_s_ * share.force;
    const Vec3 arm = share.point - body.state.pose.position;
    ApplyImpulse(body.inertia, impulse, arm.cross(impulse), body.state);
  }
  SolveVelocities(std::span(scratch_.bodies).first(scratch_.body_count),
                  std::span(scratch_.contacts).first(scratch_.contact_count),
                  std::span(springs).first(count), period_s_);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3& normal = springs[i].normal;
    Vec3& force = stiff[i]->force;
    force += (springs[i].impulse_ns / period_s_ - force.dot(normal)) * normal;
  }
}

void LocalBodies::Advance(Copies& copies, const TickRecord& record) noexcept {
  for (const BodyImpulse& push : std::span(record.impulses).first(record.count)) {
    const std::size_t place = copies.Place(push.body, push.generation);
    if (place == copies.body_count) continue;
    StepBody& body = copies.bodies[place];
    ApplyImpulse(body.inertia, push.impulse,
                 push.angular_impulse - body.state.pose.position.cross(push.impulse), body.state);
  }
  if (!(record.length_s > 0)) return;
  const int substeps = std::min(SubstepCount(record.length_s, copies.longest_substep_s),
                                kLongestTick * SubstepCount(period_s_, copies.longest_substep_s));
  for (int i = 0; i < substeps; ++i) {
    StepBodies(std::span(copies.bodies).first(copies.body_count),
               std::span(copies.contacts).first(copies.contact_count), record.length_s / substeps,
               rule_);
  }
}

void LocalBodies::Step(std::uint64_t tick, std::span<const BodyImpulse> impulses,
                       double length_s) noexcept {
  TickRecord& record = history_[tick & (history_.size() - 1)];
  record.length_s = length_s;
  record.count = std::min(impulses.size(), kMaxTickImpulses);
  std::copy_n(impulses.begin(), record.count, record.impulses.begin());
  if (live_.body_count == 0 && !catching_up_) return;
  Advance(live_, record);
  if (catching_up_) CatchUp(tick);
  if (!live_.Sound()) Clear();
}

void LocalBodies::CatchUp(std::uint64_t tick) noexcept {
  for (std::int64_t i = 0; i < replay_per_tick_ && next_replay_ <= tick; ++i) {
    Advance(arriving_, history_[next_replay_ & (history_.size() - 1)]);
    ++next_replay_;
  }
  if (next_replay_ > tick) TakeOver();
}

void LocalBodies::TakeOver() noexcept {
  double jump = 0;
  bool known = false;
  for (std::size_t i = 0; i < arriving_.body_count; ++i) {
    const Identity& identity = arriving_.identities[i];
    const std::size_t place = live_.Place(identity.body, identity.generation);
    if (place == live_.body_count || live_.coasts[place]) continue;
    known = true;
    jump = std::max(
        jump,
        (arriving_.bodies[i].state.pose.position - live_.bodies[place].state.pose.position).norm());
  }
  if (known) {
    ++reconciliation_.frames;
    reconciliation_.newest_jump = jump;
    reconciliation_.largest_jump = std::max(reconciliation_.largest_jump, jump);
  }
  live_ = arriving_;
  catching_up_ = false;
}

}  // namespace rikiseki::haptic
