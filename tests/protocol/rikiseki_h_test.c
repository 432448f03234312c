// SPDX-License-Identifier: MIT
/* The C half of rikiseki_h_test: rikiseki.h compiled as C11. */
#include "tests/protocol/rikiseki_h_test.h"

/* Every field that travels, in the order of layout.golden.txt, with the offset that this compiler gives it. */
#define FIELD(record, type, field, kind) \
  { record "." #field ":" kind, offsetof(type, field), sizeof(((type*)0)->field) }
static const struct {
  const char* name;
  size_t offset, bytes;
} kFields[] = {
    FIELD("segment_header", rk_segment_header, magic, "u64"),
    FIELD("segment_header", rk_segment_header, byte_order, "u32"),
    FIELD("segment_header", rk_segment_header, version_major, "u16"),
    FIELD("segment_header", rk_segment_header, version_minor, "u16"),
    FIELD("segment_header", rk_segment_header, layout_hash, "u64"),
    FIELD("segment_header", rk_segment_header, header_bytes, "u32"),
    FIELD("segment_header", rk_segment_header, stream_count, "u32"),
    FIELD("segment_header", rk_segment_header, segment_bytes, "u64"),
    FIELD("segment_header", rk_segment_header, epoch, "u64"),
    FIELD("segment_header", rk_segment_header, role, "u32"),
    FIELD("segment_header", rk_segment_header, writer_pid, "u32"),
    FIELD("segment_header", rk_segment_header, build, "char[64]"),
    FIELD("segment_header", rk_segment_header, state, "u64"),
    FIELD("segment_header", rk_segment_header, heartbeat_ns, "u64"),
    FIELD("segment_header", rk_segment_header, tick, "u64"),
    FIELD("segment_header", rk_segment_header, fault_code, "u64"),
    FIELD("segment_header", rk_segment_header, overruns, "u64"),
    FIELD("segment_header", rk_segment_header, lapped, "u64"),
    FIELD("segment_header", rk_segment_header, read_retries, "u64"),
    FIELD("segment_header", rk_segment_header, rejected, "u64"),
    FIELD("segment_header", rk_segment_header, gaps, "u64"),
    FIELD("stream_entry", rk_stream_entry, type_id, "u32"),
    FIELD("stream_entry", rk_stream_entry, type_version, "u16"),
    FIELD("stream_entry", rk_stream_entry, flags, "u16"),
    FIELD("stream_entry", rk_stream_entry, cursor_offset, "u64"),
    FIELD("stream_entry", rk_stream_entry, ring_offset, "u64"),
    FIELD("stream_entry", rk_stream_entry, slot_stride, "u32"),
    FIELD("stream_entry", rk_stream_entry, slot_count, "u32"),
    FIELD("stream_entry", rk_stream_entry, payload_bytes, "u32"),
    FIELD("stream_entry", rk_stream_entry, period_ns, "u64"),
    FIELD("slot_header", rk_slot_header, sequence, "u64"),
    FIELD("slot_header", rk_slot_header, stamp_ns, "u64"),
    FIELD("slot_header", rk_slot_header, used_bytes, "u32"),
    FIELD("slot_header", rk_slot_header, blocks, "u32"),
    FIELD("haptic.tick", rk_tick_head, tick, "u64"),
    FIELD("haptic.tick", rk_tick_head, start_ns, "u64"),
    FIELD("haptic.tick", rk_tick_head, period_ns, "u64"),
    FIELD("haptic.tick", rk_tick_head, previous_duration_ns, "u64"),
    FIELD("haptic.tick", rk_tick_head, world_epoch, "u64"),
    FIELD("haptic.tick", rk_tick_head, world_frame, "u64"),
    FIELD("haptic.tick", rk_tick_head, stiffness, "f64"),
    FIELD("haptic.tick", rk_tick_head, damping, "f64"),
    FIELD("haptic.tick", rk_tick_head, force_cap, "f64"),
    FIELD("haptic.tick", rk_tick_head, pointer_count, "u32"),
    FIELD("haptic.tick", rk_tick_head, channel_count, "u32"),
    FIELD("haptic.tick/pointer", rk_pointer, pointer, "u32"),
    FIELD("haptic.tick/pointer", rk_pointer, reason, "u32"),
    FIELD("haptic.tick/pointer", rk_pointer, radius, "f64"),
    FIELD("haptic.tick/pointer", rk_pointer, position, "f64[3]"),
    FIELD("haptic.tick/pointer", rk_pointer, velocity, "f64[3]"),
    FIELD("haptic.tick/pointer", rk_pointer, force, "f64[3]"),
    FIELD("haptic.tick/channel", rk_channel, body, "u32"),
    FIELD("haptic.tick/channel", rk_channel, generation, "u32"),
    FIELD("haptic.tick/channel", rk_channel, pointer, "u32"),
    FIELD("haptic.tick/channel", rk_channel, state, "u32"),
    FIELD("haptic.tick/channel", rk_channel, opened_tick, "u64"),
    FIELD("haptic.tick/channel", rk_channel, impulse, "i64[3]"),
    FIELD("haptic.tick/channel", rk_channel, angular_impulse, "i64[3]"),
    FIELD("haptic.tick/channel", rk_channel, first_moment, "f64[3]"),
    FIELD("haptic.tick/channel", rk_channel, angular_first_moment, "f64[3]"),
    FIELD("haptic.tick/channel", rk_channel, contact_point, "f64[3]"),
    FIELD("haptic.tick/pointer_rotation", rk_pointer_rotation, orientation, "f64[4]"),
    FIELD("haptic.tick/pointer_rotation", rk_pointer_rotation, angular_velocity, "f64[3]"),
    FIELD("haptic.tick/pointer_rotation", rk_pointer_rotation, torque, "f64[3]"),
    FIELD("haptic.tick/ground", rk_ground, impulse, "i64[3]"),
    FIELD("haptic.tick/ground", rk_ground, angular_impulse, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, ticks, "u64"),
    FIELD("haptic.health", rk_haptic_health, period_ns, "u64"),
    FIELD("haptic.health", rk_haptic_health, missed, "u64"),
    FIELD("haptic.health", rk_haptic_health, worst_missed_in_a_row, "u64"),
    FIELD("haptic.health", rk_haptic_health, reason_ticks, "u64"),
    FIELD("haptic.health", rk_haptic_health, reason, "u32"),
    FIELD("haptic.health", rk_haptic_health, peer_state, "u32"),
    FIELD("haptic.health", rk_haptic_health, peer_epoch, "u64"),
    FIELD("haptic.health", rk_haptic_health, feature_age_ns, "u64"),
    FIELD("haptic.health", rk_haptic_health, zero_force_after_ns, "u64"),
    FIELD("haptic.health", rk_haptic_health, largest_force, "f64"),
    FIELD("haptic.health", rk_haptic_health, largest_force_step, "f64"),
    FIELD("haptic.health", rk_haptic_health, slew_limit, "f64"),
    FIELD("haptic.health", rk_haptic_health, target, "f64[3]"),
    FIELD("haptic.health", rk_haptic_health, scheduling.policy, "u32"),
    FIELD("haptic.health", rk_haptic_health, scheduling.priority, "u32"),
    FIELD("haptic.health", rk_haptic_health, scheduling.memory_locked, "u32"),
    FIELD("haptic.health", rk_haptic_health, scheduling.cpu, "u32"),
    FIELD("haptic.health", rk_haptic_health, books.displayed, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, books.ground, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, books.covered, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, books.applied, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, books.discarded, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, books.peer_lost, "i64[3]"),
    FIELD("haptic.health", rk_haptic_health, minor_faults, "u64"),
    FIELD("haptic.health", rk_haptic_health, major_faults, "u64"),
    FIELD("haptic.health", rk_haptic_health, device, "char[32]"),
    FIELD("haptic.health", rk_haptic_health, lateness, "u64[256]"),
    FIELD("haptic.health", rk_haptic_health, duration, "u64[256]"),
    FIELD("haptic.health/reconciliation", rk_reconciliation, frames, "u64"),
    FIELD("haptic.health/reconciliation", rk_reconciliation, newest_jump, "f64"),
    FIELD("haptic.health/reconciliation", rk_reconciliation, largest_jump, "f64"),
    FIELD("haptic.health/energy", rk_energy, injected, "f64"),
    FIELD("haptic.health/energy", rk_energy, dissipated, "f64"),
    FIELD("haptic.health/energy", rk_energy, flagged, "u64"),
    FIELD("haptic.health/energy", rk_energy, unstable, "u32"),
    FIELD("haptic.health/energy", rk_energy, controller, "u32"),
    FIELD("world.frame", rk_frame_head, frame, "u64"),
    FIELD("world.frame", rk_frame_head, world_time_ns, "u64"),
    FIELD("world.frame", rk_frame_head, period_ns, "u64"),
    FIELD("world.frame", rk_frame_head, acked_epoch, "u64"),
    FIELD("world.frame", rk_frame_head, acked_tick, "u64"),
    FIELD("world.frame", rk_frame_head, baseline_tick, "u64"),
    FIELD("world.frame", rk_frame_head, applied, "i64[3]"),
    FIELD("world.frame", rk_frame_head, discarded, "i64[3]"),
    FIELD("world.frame", rk_frame_head, coupling, "u32"),
    FIELD("world.frame", rk_frame_head, plane_count, "u32"),
    FIELD("world.frame/plane", rk_plane, pointer, "u32"),
    FIELD("world.frame/plane", rk_plane, body, "u32"),
    FIELD("world.frame/plane", rk_plane, generation, "u32"),
    FIELD("world.frame/plane", rk_plane, feature, "u32"),
    FIELD("world.frame/plane", rk_plane, point, "f64[3]"),
    FIELD("world.frame/plane", rk_plane, normal, "f64[3]"),
    FIELD("world.frame/plane_surface", rk_plane_surface, stiffness, "f64"),
    FIELD("world.frame/plane_surface", rk_plane_surface, damping, "f64"),
    FIELD("world.frame/plane_velocity", rk_plane_velocity, velocity, "f64[3]"),
    FIELD("world.frame/plane_friction", rk_plane_friction, static_friction, "f64"),
    FIELD("world.frame/plane_friction", rk_plane_friction, dynamic_friction, "f64"),
    FIELD("world.frame/plane_recovery", rk_plane_recovery, recovery_s, "f64"),
    FIELD("world.frame/local", rk_local_head, local_body_count, "u32"),
    FIELD("world.frame/local", rk_local_head, reserved, "u32"),
    FIELD("world.frame/local", rk_local_head, substep_ns, "u64"),
    FIELD("world.frame/local_body", rk_local_body, body, "u32"),
    FIELD("world.frame/local_body", rk_local_body, generation, "u32"),
    FIELD("world.frame/local_body", rk_local_body, contact_count, "u32"),
    FIELD("world.frame/local_body", rk_local_body, reserved, "u32"),
    FIELD("world.frame/local_body", rk_local_body, mass, "f64"),
    FIELD("world.frame/local_body", rk_local_body, inertia, "f64[6]"),
    FIELD("world.frame/local_body", rk_local_body, position, "f64[3]"),
    FIELD("world.frame/local_body", rk_local_body, orientation, "f64[4]"),
    FIELD("world.frame/local_body", rk_local_body, velocity, "f64[3]"),
    FIELD("world.frame/local_body", rk_local_body, angular_velocity, "f64[3]"),
    FIELD("world.frame/local_body", rk_local_body, acceleration, "f64[3]"),
    FIELD("world.frame/local_body", rk_local_body, angular_acceleration, "f64[3]"),
    FIELD("world.frame/contact_plane", rk_contact_plane, other_body, "u32"),
    FIELD("world.frame/contact_plane", rk_contact_plane, other_generation, "u32"),
    FIELD("world.frame/contact_plane", rk_contact_plane, point, "f64[3]"),
    FIELD("world.frame/contact_plane", rk_contact_plane, normal, "f64[3]"),
    FIELD("world.frame/contact_plane", rk_contact_plane, gap, "f64"),
    FIELD("world.frame/contact_plane", rk_contact_plane, friction, "f64"),
    FIELD("world.frame/contact_plane", rk_contact_plane, other_velocity, "f64[3]"),
    FIELD("world.frame/contact_plane", rk_contact_plane, other_inverse_mass, "f64"),
    FIELD("world.frame/contact_plane", rk_contact_plane, impulse, "f64[3]"),
    FIELD("world.frame/contact_plane", rk_contact_plane, radius, "f64"),
    FIELD("world.frame/plane_mobility", rk_plane_mobility, inverse_mass, "f64"),
    FIELD("world.frame/plane_rounding", rk_plane_rounding, radius, "f64"),
    FIELD("world.health", rk_world_health, frames, "u64"),
    FIELD("world.health", rk_world_health, period_ns, "u64"),
    FIELD("world.health", rk_world_health, missed, "u64"),
    FIELD("world.health", rk_world_health, lapped, "u64"),
    FIELD("world.health", rk_world_health, peer_state, "u32"),
    FIELD("world.health", rk_world_health, coupling, "u32"),
    FIELD("world.health", rk_world_health, peer_epoch, "u64"),
    FIELD("world.health", rk_world_health, applied, "i64[3]"),
    FIELD("world.health", rk_world_health, discarded.gap, "i64[3]"),
    FIELD("world.health", rk_world_health, discarded.coupling, "i64[3]"),
    FIELD("world.health", rk_world_health, discarded.foreign_world, "i64[3]"),
    FIELD("world.health", rk_world_health, discarded.unknown_body, "i64[3]"),
    FIELD("world.health", rk_world_health, penalty_impulse, "f64[3]"),
    FIELD("world.health", rk_world_health, moving_bodies, "u64"),
    FIELD("world.health", rk_world_health, resets, "u64"),
    FIELD("world.health", rk_world_health, scheduling.policy, "u32"),
    FIELD("world.health", rk_world_health, scheduling.priority, "u32"),
    FIELD("world.health", rk_world_health, scheduling.memory_locked, "u32"),
    FIELD("world.health", rk_world_health, scheduling.cpu, "u32"),
    FIELD("world.health", rk_world_health, scene, "char[64]"),
    FIELD("world.health", rk_world_health, lateness, "u64[256]"),
    FIELD("world.health", rk_world_health, duration, "u64[256]"),
    FIELD("world.bodies", rk_bodies_head, body_count, "u32"),
    FIELD("world.bodies", rk_bodies_head, reserved, "u32"),
    FIELD("world.bodies/body", rk_body, body, "u32"),
    FIELD("world.bodies/body", rk_body, generation, "u32"),
    FIELD("world.bodies/body", rk_body, mass, "f64"),
    FIELD("world.bodies/body", rk_body, position, "f64[3]"),
    FIELD("world.bodies/body", rk_body, orientation, "f64[4]"),
    FIELD("world.bodies/body", rk_body, velocity, "f64[3]"),
    FIELD("world.bodies/body", rk_body, angular_velocity, "f64[3]"),
    FIELD("world.scene", rk_scene_head, revision, "u64"),
    FIELD("world.scene", rk_scene_head, needs, "u64"),
    FIELD("world.scene", rk_scene_head, left_out, "u64"),
    FIELD("world.scene", rk_scene_head, gravity, "f64[3]"),
    FIELD("world.scene", rk_scene_head, name, "char[64]"),
    FIELD("world.scene", rk_scene_head, body_count, "u32"),
    FIELD("world.scene", rk_scene_head, collider_count, "u32"),
    FIELD("world.scene/body", rk_scene_body, body, "u32"),
    FIELD("world.scene/body", rk_scene_body, generation, "u32"),
    FIELD("world.scene/body", rk_scene_body, fixed, "u32"),
    FIELD("world.scene/body", rk_scene_body, collider_count, "u32"),
    FIELD("world.scene/body", rk_scene_body, name, "char[64]"),
    FIELD("world.scene/collider", rk_scene_collider, shape, "u32"),
    FIELD("world.scene/collider", rk_scene_collider, reserved, "u32"),
    FIELD("world.scene/collider", rk_scene_collider, dimensions, "f64[3]"),
    FIELD("world.scene/collider", rk_scene_collider, position, "f64[3]"),
    FIELD("world.scene/collider", rk_scene_collider, orientation, "f64[4]"),
    FIELD("world.scene/collider", rk_scene_collider, colour, "f64[4]"),
    FIELD("world.scene/mesh", rk_scene_mesh, sha256, "u8[32]"),
    FIELD("world.scene/mesh", rk_scene_mesh, path, "char[224]"),
};

size_t rk_test_layout(char* text, size_t room) {
  size_t at = 0;
  for (size_t i = 0; i < sizeof kFields / sizeof kFields[0]; ++i) {
    at += (size_t)snprintf(text + at, room - at, "%s:%zu:%zu\n", kFields[i].name, kFields[i].offset,
                           kFields[i].bytes);
  }
  return at;
}

int rk_test_recode(uint32_t type, const uint64_t* words, size_t bytes, uint32_t used,
                   uint32_t blocks, uint64_t* again, uint32_t* again_used, uint32_t* again_blocks) {
  static rk_tick tick;
  static rk_frame frame;
  rk_received shape;
  int coded = 0;
  memset(&shape, 0, sizeof shape);
  shape.used_bytes = used;
  shape.blocks = blocks;
  if (type == RK_HAPTIC_TICK && rk_decode_tick(words, bytes, &shape, &tick) == RK_SOUND) {
    coded = rk_encode_tick(&tick, again, &shape);
  } else if (type == RK_WORLD_FRAME && rk_decode_frame(words, bytes, &shape, &frame) == RK_SOUND) {
    coded = rk_encode_frame(&frame, again, &shape);
  }
  *again_used = shape.used_bytes;
  *again_blocks = shape.blocks;
  return coded;
}

struct rk_test_view {
  rk_view view;
  rk_reader ticks;
};
struct rk_test_segment {
  rk_segment segment;
  rk_writer ticks;
};

int rk_test_attach(const char* instance, uint32_t role, struct rk_test_view** out, char why[256]) {
  static const rk_need need = {RK_HAPTIC_TICK, 1, 0};
  struct rk_test_view* view = (struct rk_test_view*)calloc(1, sizeof *view);
  const int status = (int)rk_attach(&view->view, instance, role, &need, role == RK_HAPTIC ? 1 : 0);
  snprintf(why, 256, "%s", view->view.why);
  *out = NULL;
  if (status != RK_ATTACHED) {
    free(view);
  } else {
    rk_reader_of(&view->view, RK_HAPTIC_TICK, &view->ticks);
    *out = view;
  }
  return status;
}

uint64_t rk_test_epoch(const struct rk_test_view* view) {
  return view->view.header.epoch;
}
uint64_t rk_test_state(const struct rk_test_view* view) {
  return rk_state(&view->view);
}
uint64_t rk_test_heartbeat(const struct rk_test_view* view) {
  return rk_heartbeat_of(&view->view);
}
int rk_test_alive(const struct rk_test_view* view) {
  return rk_owner_alive(&view->view);
}
int rk_test_replaced(const struct rk_test_view* view) {
  return rk_replaced(&view->view);
}
uint64_t rk_test_lost(const struct rk_test_view* view) {
  return view->ticks.lost;
}

int rk_test_read(struct rk_test_view* view, int next, uint64_t* words, size_t bytes,
                 uint64_t* number, uint64_t* stamp_ns, uint32_t* used, uint32_t* blocks) {
  rk_received received;
  enum rk_read_status status;
  memset(&received, 0, sizeof received);
  status = next ? rk_read_next(&view->ticks, words, bytes, &received)
                : rk_read_latest(&view->ticks, words, bytes, &received);
  *number = received.number;
  *stamp_ns = received.stamp_ns;
  *used = received.used_bytes;
  *blocks = received.blocks;
  return (int)status;
}

void rk_test_detach(struct rk_test_view* view) {
  rk_detach(&view->view);
  free(view);
}

int rk_test_create(const char* instance, struct rk_test_segment** out, char why[256]) {
  static const rk_stream_spec streams[2] = {
      {RK_HAPTIC_TICK, RK_TICK_BYTES, 16, 1000000},
      {RK_HAPTIC_HEALTH, RK_HAPTIC_HEALTH_BYTES, 4, 100000000}};
  struct rk_test_segment* own = (struct rk_test_segment*)calloc(1, sizeof *own);
  const int status = rk_create(&own->segment, instance, RK_HAPTIC, streams, 2, "rikiseki_h_test");
  snprintf(why, 256, "%s", own->segment.why);
  *out = own;
  if (status != RK_CREATED) {
    free(own);
    *out = NULL;
  } else {
    rk_writer_of(&own->segment, RK_HAPTIC_TICK, &own->ticks);
  }
  return status;
}

int rk_test_publish(struct rk_test_segment* own, const uint64_t* words, uint32_t used,
                    uint32_t blocks, uint64_t stamp_ns) {
  rk_received shape;
  memset(&shape, 0, sizeof shape);
  shape.used_bytes = used;
  shape.blocks = blocks;
  rk_heartbeat(&own->segment, own->ticks.published, stamp_ns);
  return rk_publish(&own->ticks, words, &shape, stamp_ns);
}

uint64_t rk_test_own_state(const struct rk_test_segment* own) {
  return __atomic_load_n(&own->segment.header->state, __ATOMIC_ACQUIRE);
}

void rk_test_close(struct rk_test_segment* own) {
  rk_close(&own->segment);
  free(own);
}

void rk_test_die(struct rk_test_segment* own) {
  struct flock lock = rk_lock_on_byte_0(F_UNLCK);
  fcntl(own->segment.descriptor, F_OFD_SETLK, &lock); /* the map alone would keep it */
  close(own->segment.descriptor);
  close(own->segment.role_lock);
  own->segment.descriptor = own->segment.role_lock = -1;
}
