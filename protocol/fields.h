// The one list of what travels, in order: the encoder, the decoder, and the layout fingerprint all
// walk it, so they cannot disagree. Private to codec.cpp and layout.h; SPEC.md section 6 is the
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

}  // namespace rikiseki::protocol
