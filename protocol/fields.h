// SPDX-License-Identifier: MIT
// The one list of what travels, in order: the encoder, the decoder, and the layout fingerprint all
// walk it, so they cannot disagree. Private to the codec and layout.h; SPEC.md section 6 is the
// same as prose.
//
// An archive is called as archive(name, value) for integers, enumerators, doubles and arrays of
// them. A record is a multiple of 8 bytes, so that each starts on a word.
#pragma once

#include "protocol/messages.h"

namespace rikiseki::protocol {

template <typename Archive, typename Message>
constexpr void HapticTickHead(Archive& archive, Message& m) {
  archive("tick", m.tick);
  archive("start_ns", m.start_ns);
  archive("period_ns", m.period_ns);
  archive("previous_duration_ns", m.previous_duration_ns);
  archive("world_epoch", m.world_epoch);
  archive("world_frame", m.world_frame);
  archive("stiffness", m.stiffness);
  archive("damping", m.damping);
  archive("force_cap", m.force_cap);
  archive("pointer_count", m.pointer_count);
  archive("channel_count", m.channel_count);
}

template <typename Archive, typename P>
constexpr void PointerFields(Archive& archive, P& p) {
  archive("pointer", p.pointer);
  archive("reason", p.reason);
  archive("radius", p.radius);
  archive("position", p.position);
  archive("velocity", p.velocity);
  archive("force", p.force);
}

template <typename Archive, typename P>
constexpr void PointerRotationFields(Archive& archive, P& p) {
  archive("orientation", p.orientation);
  archive("angular_velocity", p.angular_velocity);
  archive("torque", p.torque);
}

template <typename Archive, typename C>
constexpr void ChannelFields(Archive& archive, C& c) {
  archive("body", c.body);
  archive("generation", c.generation);
  archive("pointer", c.pointer);
  archive("state", c.state);
  archive("opened_tick", c.opened_tick);
  archive("impulse", c.impulse);
  archive("angular_impulse", c.angular_impulse);
  archive("first_moment", c.first_moment);
  archive("angular_first_moment", c.angular_first_moment);
  archive("contact_point", c.contact_point);
}

template <typename Archive, typename G>
constexpr void GroundFields(Archive& archive, G& g) {
  archive("impulse", g.impulse);
  archive("angular_impulse", g.angular_impulse);
}

template <typename Archive, typename Message>
constexpr void WorldFrameHead(Archive& archive, Message& m) {
  archive("frame", m.frame);
  archive("world_time_ns", m.world_time_ns);
  archive("period_ns", m.period_ns);
  archive("acked_epoch", m.acked_epoch);
  archive("acked_tick", m.acked_tick);
  archive("baseline_tick", m.baseline_tick);
  archive("applied", m.applied);
  archive("discarded", m.discarded);
  archive("coupling", m.coupling);
  archive("plane_count", m.plane_count);
}

template <typename Archive, typename P>
constexpr void PlaneFields(Archive& archive, P& p) {
  archive("pointer", p.pointer);
  archive("body", p.body);
  archive("generation", p.generation);
  archive("feature", p.feature);
  archive("point", p.point);
  archive("normal", p.normal);
}

template <typename Archive, typename P>
constexpr void PlaneSurfaceFields(Archive& archive, P& p) {
  archive("stiffness", p.stiffness);
  archive("damping", p.damping);
}

template <typename Archive, typename P>
constexpr void PlaneVelocityFields(Archive& archive, P& p) {
  archive("velocity", p.velocity);
}

template <typename Archive, typename P>
constexpr void PlaneFrictionFields(Archive& archive, P& p) {
  archive("static_friction", p.static_friction);
  archive("dynamic_friction", p.dynamic_friction);
}

template <typename Archive, typename P>
constexpr void PlaneRecoveryFields(Archive& archive, P& p) {
  archive("recovery_s", p.recovery_s);
}

template <typename Archive, typename P>
constexpr void PlaneMobilityFields(Archive& archive, P& p) {
  archive("inverse_mass", p.inverse_mass);
}

template <typename Archive, typename P>
constexpr void PlaneRoundingFields(Archive& archive, P& p) {
  archive("radius", p.radius);
}

template <typename Archive, typename Message>
constexpr void LocalHeadFields(Archive& archive, Message& m) {
  archive("local_body_count", m.local_body_count);
  archive("reserved", m.local_reserved);
  archive("substep_ns", m.local_substep_ns);
}

template <typename Archive, typename L>
constexpr void LocalBodyFields(Archive& archive, L& b) {
  archive("body", b.body);
  archive("generation", b.generation);
  archive("contact_count", b.contact_count);
  archive("reserved", b.reserved);
  archive("mass", b.mass);
  archive("inertia", b.inertia);
  archive("position", b.position);
  archive("orientation", b.orientation);
  archive("velocity", b.velocity);
  archive("angular_velocity", b.angular_velocity);
  archive("acceleration", b.acceleration);
  archive("angular_acceleration", b.angular_acceleration);
}

template <typename Archive, typename C>
constexpr void ContactPlaneFields(Archive& archive, C& c) {
  archive("other_body", c.other_body);
  archive("other_generation", c.other_generation);
  archive("point", c.point);
  archive("normal", c.normal);
  archive("gap", c.gap);
  archive("friction", c.friction);
  archive("other_velocity", c.other_velocity);
  archive("other_inverse_mass", c.other_inverse_mass);
  archive("impulse", c.impulse);
  archive("radius", c.radius);
}

template <typename Archive, typename S>
constexpr void SchedulingFields(Archive& archive, S& s) {
  archive("scheduling.policy", s.policy);
  archive("scheduling.priority", s.priority);
  archive("scheduling.memory_locked", s.memory_locked);
  archive("scheduling.cpu", s.cpu);
}

template <typename Archive, typename Message>
constexpr void HapticHealthFields(Archive& archive, Message& m) {
  archive("ticks", m.ticks);
  archive("period_ns", m.period_ns);
  archive("missed", m.missed);
  archive("worst_missed_in_a_row", m.worst_missed_in_a_row);
  archive("reason_ticks", m.reason_ticks);
  archive("reason", m.reason);
  archive("peer_state", m.peer_state);
  archive("peer_epoch", m.peer_epoch);
  archive("feature_age_ns", m.feature_age_ns);
  archive("zero_force_after_ns", m.zero_force_after_ns);
  archive("largest_force", m.largest_force);
  archive("largest_force_step", m.largest_force_step);
  archive("slew_limit", m.slew_limit);
  archive("target", m.target);
  SchedulingFields(archive, m.scheduling);
  archive("books.displayed", m.books.displayed);
  archive("books.ground", m.books.ground);
  archive("books.covered", m.books.covered);
  archive("books.applied", m.books.applied);
  archive("books.discarded", m.books.discarded);
  archive("books.peer_lost", m.books.peer_lost);
  archive("minor_faults", m.minor_faults);
  archive("major_faults", m.major_faults);
  archive("device", m.device);
  archive("lateness", m.lateness);
  archive("duration", m.duration);
}

template <typename Archive, typename R>
constexpr void ReconciliationFields(Archive& archive, R& r) {
  archive("frames", r.frames);
  archive("newest_jump", r.newest_jump);
  archive("largest_jump", r.largest_jump);
}

template <typename Archive, typename E>
constexpr void EnergyFields(Archive& archive, E& e) {
  archive("injected", e.injected);
  archive("dissipated", e.dissipated);
  archive("flagged", e.flagged);
  archive("unstable", e.unstable);
  archive("controller", e.controller);
}

template <typename Archive, typename Message>
constexpr void WorldHealthFields(Archive& archive, Message& m) {
  archive("frames", m.frames);
  archive("period_ns", m.period_ns);
  archive("missed", m.missed);
  archive("lapped", m.lapped);
  archive("peer_state", m.peer_state);
  archive("coupling", m.coupling);
  archive("peer_epoch", m.peer_epoch);
  archive("applied", m.applied);
  archive("discarded.gap", m.discarded[0]);
  archive("discarded.coupling", m.discarded[1]);
  archive("discarded.foreign_world", m.discarded[2]);
  archive("discarded.unknown_body", m.discarded[3]);
  archive("penalty_impulse", m.penalty_impulse);
  archive("moving_bodies", m.moving_bodies);
  archive("resets", m.resets);
  SchedulingFields(archive, m.scheduling);
  archive("scene", m.scene);
  archive("lateness", m.lateness);
  archive("duration", m.duration);
}

template <typename Archive, typename Head>
constexpr void WorldBodiesHead(Archive& archive, Head& head) {
  archive("body_count", head.body_count);
  archive("reserved", head.reserved);
}

template <typename Archive, typename B>
constexpr void BodyFields(Archive& archive, B& b) {
  archive("body", b.body);
  archive("generation", b.generation);
  archive("mass", b.mass);
  archive("position", b.position);
  archive("orientation", b.orientation);
  archive("velocity", b.velocity);
  archive("angular_velocity", b.angular_velocity);
}

/// What stands in front of the bodies.
struct WorldBodiesHeadRecord {
  std::uint32_t body_count = 0;
  std::uint32_t reserved = 0;
};

/// What stands in front of the scene's lists: WorldScene without them.
struct WorldSceneHeadRecord {
  std::uint64_t revision = 0;
  std::uint64_t needs = 0;
  std::uint64_t left_out = 0;
  Vector gravity{};
  std::array<char, 64> name{};
  std::uint32_t body_count = 0;
  std::uint32_t collider_count = 0;
};

template <typename Archive, typename Head>
constexpr void WorldSceneHead(Archive& archive, Head& head) {
  archive("revision", head.revision);
  archive("needs", head.needs);
  archive("left_out", head.left_out);
  archive("gravity", head.gravity);
  archive("name", head.name);
  archive("body_count", head.body_count);
  archive("collider_count", head.collider_count);
}

template <typename Archive, typename B>
constexpr void SceneBodyFields(Archive& archive, B& b) {
  archive("body", b.body);
  archive("generation", b.generation);
  archive("fixed", b.fixed);
  archive("collider_count", b.collider_count);
  archive("name", b.name);
}

template <typename Archive, typename C>
constexpr void SceneColliderFields(Archive& archive, C& c) {
  archive("shape", c.shape);
  archive("reserved", c.reserved);
  archive("dimensions", c.dimensions);
  archive("position", c.position);
  archive("orientation", c.orientation);
  archive("colour", c.colour);
}

template <typename Archive, typename M>
constexpr void SceneMeshFields(Archive& archive, M& m) {
  archive("sha256", m.sha256);
  archive("path", m.path);
}

}  // namespace rikiseki::protocol
