// SPDX-License-Identifier: MIT
/* rikiseki.h: the Rikiseki protocol in plain C11 (and C++), for whoever writes a peer or looks on.
 *
 * One file, no dependency but libc, POSIX on Linux, and the __atomic builtins of GCC and Clang. It
 * is written from SPEC.md; section numbers below are its. Include it before any system header, or
 * define _GNU_SOURCE yourself. Link with -lm.
 *
 * A peer in short (a whole one is tests/protocol/rikiseki_h_world.c):
 *
 *   own side   rk_create, rk_writer_of;  each tick: rk_encode_*, rk_publish, rk_heartbeat, rk_report;
 *              rk_close
 *   other side rk_attach (every 100 ms while detached, not in a thread with deadlines),
 *              rk_reader_of;  each tick: rk_state, rk_read_*, rk_jumped, rk_decode_*, rk_accept;
 *              every 100 ms: rk_owner_alive, rk_replaced;  rk_detach
 *
 * Nothing here allocates memory. rk_publish, rk_read_*, rk_encode_*, rk_decode_*, rk_state and
 * rk_heartbeat make no system call and do not block. One thread per rk_writer and per rk_reader.
 */
#ifndef RIKISEKI_H
#define RIKISEKI_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pwd.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifndef F_OFD_SETLK
#error "include rikiseki.h before the system headers, or define _GNU_SOURCE"
#endif
#if !defined(__BYTE_ORDER__) || __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the protocol is little-endian, and this header copies records as they are"
#endif

#ifdef __cplusplus
#define RK_STATIC_ASSERT(condition) static_assert(condition, #condition)
#else
#define RK_STATIC_ASSERT(condition) _Static_assert(condition, #condition)
#endif
#define RK_AT(type, field, offset) RK_STATIC_ASSERT(offsetof(type, field) == (offset))
#define RK_SIZE(type, bytes) RK_STATIC_ASSERT(sizeof(type) == (bytes))

/* ---------------------------------------------------------------------------------------------
 * Constants */

#define RK_VERSION_MAJOR 1
#define RK_VERSION_MINOR 0
#define RK_LAYOUT_HASH UINT64_C(0xACAE8D32F68C7538) /* 8.3 */

#define RK_MAGIC UINT64_C(0x494B4553494B4952) /* "RIKISEKI" */
#define RK_BYTE_ORDER UINT32_C(0x01020304)
#define RK_HEADER_BYTES 4096u
#define RK_MAX_STREAMS 16u
#define RK_LINE_BYTES 128u
#define RK_MIN_SLOTS 4u
#define RK_MAX_SLOTS 65536u
#define RK_MAX_SEGMENT_BYTES (UINT64_C(16) << 20)

#define RK_MAX_POINTERS 4u
#define RK_MAX_CHANNELS 16u
#define RK_MAX_PLANES 32u
#define RK_MAX_LOCAL_BODIES 4u
#define RK_MAX_CONTACT_PLANES 16u /* of one local body */
#define RK_MAX_BODIES 10000u
#define RK_IMPULSE_UNIT 1e-12       /* N s, N m s: 7.1 */
#define RK_MOBILITY_NOT_SAID (-1.0) /* of a plane, 6.2 */

enum rk_role { RK_HAPTIC = 1, RK_WORLD = 2 };
enum rk_segment_state {
  RK_INITIALISING = 0,
  RK_READY = 1,
  RK_CLOSED = 2,
  RK_FAULTED = 3,
  RK_SUPERSEDED = 4
};
enum rk_stream_type {
  RK_HAPTIC_TICK = 1,
  RK_HAPTIC_HEALTH = 2,
  RK_WORLD_FRAME = 16,
  RK_WORLD_HEALTH = 17,
  RK_WORLD_BODIES = 18,
  RK_WORLD_SCENE = 19
};
enum rk_channel_state { RK_CHANNEL_OPEN = 1, RK_CHANNEL_CLOSED = 2 };
enum rk_coupling { RK_BY_POSITION = 1, RK_BY_IMPULSE = 2, RK_BY_LOCAL = 3 };
enum rk_reason { /* 6.6 */
                 RK_NO_CONTACT = 0,
                 RK_CONTACT = 1,
                 RK_CAPPED = 2,
                 RK_SLEW_LIMITED = 3,
                 RK_TENSION_LIMITED = 4,
                 RK_SOFT_START = 5,
                 RK_WORLD_LATE = 6,
                 RK_WORLD_LOST = 7,
                 RK_WORLD_ABSENT = 8,
                 RK_OVER_SPEED = 9,
                 RK_NOT_FINITE = 10,
                 RK_NO_CHANNEL = 11,
                 RK_DEVICE_FAULT = 12,
                 RK_LOOP_FAULT = 13,
                 RK_STOPPED = 14,
                 RK_EMERGENCY_STOP = 15,
                 RK_PASSIVITY = 16,
                 RK_CLUTCHED = 17
};

/* Block bits. */
#define RK_TICK_ROTATIONS 1u
#define RK_TICK_GROUND 2u
#define RK_FRAME_SURFACES 1u
#define RK_FRAME_VELOCITIES 2u
#define RK_FRAME_FRICTION 4u
#define RK_FRAME_RECOVERY 8u
#define RK_FRAME_LOCAL_BODIES 16u
#define RK_FRAME_MOBILITY 32u
#define RK_FRAME_ROUNDING 64u
#define RK_HEALTH_RECONCILIATION 1u
#define RK_HEALTH_ENERGY 2u
#define RK_SCENE_MESHES 1u

/* ---------------------------------------------------------------------------------------------
 * The bytes: records as sections 3, 4 and 6 give them */

typedef struct rk_stream_entry { /* 3.2 */
  uint32_t type_id;
  uint16_t type_version;
  uint16_t flags;
  uint64_t cursor_offset;
  uint64_t ring_offset;
  uint32_t slot_stride;
  uint32_t slot_count;
  uint32_t payload_bytes;
  uint32_t reserved0;
  uint64_t period_ns;
  uint64_t reserved1[2];
} rk_stream_entry;

typedef struct rk_segment_header { /* 3.1 */
  uint64_t magic;
  uint32_t byte_order;
  uint16_t version_major;
  uint16_t version_minor;
  uint64_t layout_hash;
  uint32_t header_bytes;
  uint32_t stream_count;
  uint64_t segment_bytes;
  uint64_t epoch;
  uint32_t role;
  uint32_t writer_pid;
  char build[64];
  uint64_t reserved0;
  uint64_t state;
  uint64_t heartbeat_ns;
  uint64_t tick;
  uint64_t fault_code;
  uint64_t reserved1[12];
  uint64_t overruns;
  uint64_t lapped;
  uint64_t read_retries;
  uint64_t rejected;
  uint64_t gaps;
  uint64_t reserved2[91];
  rk_stream_entry stream[RK_MAX_STREAMS];
  uint64_t reserved3[256];
} rk_segment_header;

typedef struct rk_slot_header { /* 4.1 */
  uint64_t sequence;
  uint64_t stamp_ns;
  uint32_t used_bytes;
  uint32_t blocks;
  uint64_t reserved;
} rk_slot_header;

typedef struct rk_tick_head { /* haptic.tick, 6.1 */
  uint64_t tick;
  uint64_t start_ns;
  uint64_t period_ns;
  uint64_t previous_duration_ns;
  uint64_t world_epoch;
  uint64_t world_frame;
  double stiffness;
  double damping;
  double force_cap;
  uint32_t pointer_count;
  uint32_t channel_count;
} rk_tick_head;

typedef struct rk_pointer { /* haptic.tick/pointer */
  uint32_t pointer;
  uint32_t reason;
  double radius;
  double position[3];
  double velocity[3];
  double force[3];
} rk_pointer;

typedef struct rk_channel { /* haptic.tick/channel */
  uint32_t body;
  uint32_t generation;
  uint32_t pointer;
  uint32_t state;
  uint64_t opened_tick;
  int64_t impulse[3];
  int64_t angular_impulse[3];
  double first_moment[3];
  double angular_first_moment[3];
  double contact_point[3];
} rk_channel;

typedef struct rk_pointer_rotation { /* haptic.tick/pointer_rotation */
  double orientation[4];
  double angular_velocity[3];
  double torque[3];
} rk_pointer_rotation;

typedef struct rk_ground { /* haptic.tick/ground */
  int64_t impulse[3];
  int64_t angular_impulse[3];
} rk_ground;

typedef struct rk_frame_head { /* world.frame, 6.2 */
  uint64_t frame;
  uint64_t world_time_ns;
  uint64_t period_ns;
  uint64_t acked_epoch;
  uint64_t acked_tick;
  uint64_t baseline_tick;
  int64_t applied[3];
  int64_t discarded[3];
  uint32_t coupling;
  uint32_t plane_count;
} rk_frame_head;

typedef struct rk_plane { /* world.frame/plane */
  uint32_t pointer;
  uint32_t body;
  uint32_t generation;
  uint32_t feature;
  double point[3];
  double normal[3];
} rk_plane;

typedef struct rk_plane_surface { /* world.frame/plane_surface */
  double stiffness;
  double damping;
} rk_plane_surface;

typedef struct rk_plane_velocity { /* world.frame/plane_velocity */
  double velocity[3];
} rk_plane_velocity;

typedef struct rk_plane_friction { /* world.frame/plane_friction */
  double static_friction;
  double dynamic_friction;
} rk_plane_friction;

typedef struct rk_plane_recovery { /* world.frame/plane_recovery */
  double recovery_s;
} rk_plane_recovery;

typedef struct rk_local_head { /* world.frame/local */
  uint32_t local_body_count;
  uint32_t reserved;
  uint64_t substep_ns;
} rk_local_head;

typedef struct rk_local_body { /* world.frame/local_body */
  uint32_t body;
  uint32_t generation;
  uint32_t contact_count;
  uint32_t reserved;
  double mass;
  double inertia[6];
  double position[3];
  double orientation[4];
  double velocity[3];
  double angular_velocity[3];
  double acceleration[3];
  double angular_acceleration[3];
} rk_local_body;

typedef struct rk_contact_plane { /* world.frame/contact_plane */
  uint32_t other_body;
  uint32_t other_generation;
  double point[3];
  double normal[3];
  double gap;
  double friction;
  double other_velocity[3];
  double other_inverse_mass;
  double impulse[3];
  double radius;
} rk_contact_plane;

typedef struct rk_plane_mobility { /* world.frame/plane_mobility */
  double inverse_mass;             /* 1/kg; 0 = it cannot move; RK_MOBILITY_NOT_SAID */
} rk_plane_mobility;

typedef struct rk_plane_rounding { /* world.frame/plane_rounding */
  double radius;                   /* m, of the ball about point - radius * normal; 0 = flat */
} rk_plane_rounding;

typedef struct rk_scheduling {
  uint32_t policy;
  uint32_t priority;
  uint32_t memory_locked;
  uint32_t cpu;
} rk_scheduling;

typedef struct rk_books { /* 7.6 */
  int64_t displayed[3];
  int64_t ground[3];
  int64_t covered[3];
  int64_t applied[3];
  int64_t discarded[3];
  int64_t peer_lost[3];
} rk_books;

typedef struct rk_haptic_health { /* 6.3 */
  uint64_t ticks;
  uint64_t period_ns;
  uint64_t missed;
  uint64_t worst_missed_in_a_row;
  uint64_t reason_ticks;
  uint32_t reason;
  uint32_t peer_state;
  uint64_t peer_epoch;
  uint64_t feature_age_ns;
  uint64_t zero_force_after_ns;
  double largest_force;
  double largest_force_step;
  double slew_limit;
  double target[3];
  rk_scheduling scheduling;
  rk_books books;
  uint64_t minor_faults;
  uint64_t major_faults;
  char device[32];
  uint64_t lateness[256];
  uint64_t duration[256];
} rk_haptic_health;

typedef struct rk_reconciliation { /* haptic.health/reconciliation */
  uint64_t frames;
  double newest_jump;
  double largest_jump;
} rk_reconciliation;

typedef struct rk_energy { /* haptic.health/energy */
  double injected;
  double dissipated;
  uint64_t flagged;
  uint32_t unstable;
  uint32_t controller;
} rk_energy;

typedef struct rk_discarded {
  int64_t gap[3];
  int64_t coupling[3];
  int64_t foreign_world[3];
  int64_t unknown_body[3];
} rk_discarded;

typedef struct rk_world_health { /* 6.3 */
  uint64_t frames;
  uint64_t period_ns;
  uint64_t missed;
  uint64_t lapped;
  uint32_t peer_state;
  uint32_t coupling;
  uint64_t peer_epoch;
  int64_t applied[3];
  rk_discarded discarded;
  double penalty_impulse[3];
  uint64_t moving_bodies;
  uint64_t resets;
  rk_scheduling scheduling;
  char scene[64];
  uint64_t lateness[256];
  uint64_t duration[256];
} rk_world_health;

typedef struct rk_bodies_head { /* world.bodies, 6.4 */
  uint32_t body_count;
  uint32_t reserved;
} rk_bodies_head;

typedef struct rk_body { /* world.bodies/body */
  uint32_t body;
  uint32_t generation;
  double mass;
  double position[3];
  double orientation[4];
  double velocity[3];
  double angular_velocity[3];
} rk_body;

typedef struct rk_scene_head { /* world.scene, 6.5 */
  uint64_t revision;
  uint64_t needs;
  uint64_t left_out;
  double gravity[3];
  char name[64];
  uint32_t body_count;
  uint32_t collider_count;
} rk_scene_head;

typedef struct rk_scene_body { /* world.scene/body */
  uint32_t body;
  uint32_t generation;
  uint32_t fixed;
  uint32_t collider_count;
  char name[64];
} rk_scene_body;

typedef struct rk_scene_collider { /* world.scene/collider */
  uint32_t shape;
  uint32_t reserved;
  double dimensions[3];
  double position[3];
  double orientation[4];
  double colour[4];
} rk_scene_collider;

typedef struct rk_scene_mesh { /* world.scene/mesh */
  uint8_t sha256[32];
  char path[224];
} rk_scene_mesh;

RK_SIZE(rk_stream_entry, 64);
RK_AT(rk_stream_entry, cursor_offset, 8);
RK_AT(rk_stream_entry, slot_stride, 24);
RK_AT(rk_stream_entry, payload_bytes, 32);
RK_AT(rk_stream_entry, period_ns, 40);
RK_SIZE(rk_segment_header, RK_HEADER_BYTES);
RK_AT(rk_segment_header, layout_hash, 0x010);
RK_AT(rk_segment_header, segment_bytes, 0x020);
RK_AT(rk_segment_header, epoch, 0x028);
RK_AT(rk_segment_header, build, 0x038);
RK_AT(rk_segment_header, state, 0x080);
RK_AT(rk_segment_header, heartbeat_ns, 0x088);
RK_AT(rk_segment_header, tick, 0x090);
RK_AT(rk_segment_header, overruns, 0x100);
RK_AT(rk_segment_header, gaps, 0x120);
RK_AT(rk_segment_header, stream, 0x400);
RK_SIZE(rk_slot_header, 32);
RK_AT(rk_slot_header, used_bytes, 16);
RK_SIZE(rk_tick_head, 80);
RK_AT(rk_tick_head, stiffness, 48);
RK_AT(rk_tick_head, pointer_count, 72);
RK_SIZE(rk_pointer, 88);
RK_AT(rk_pointer, position, 16);
RK_AT(rk_pointer, force, 64);
RK_SIZE(rk_channel, 144);
RK_AT(rk_channel, opened_tick, 16);
RK_AT(rk_channel, impulse, 24);
RK_AT(rk_channel, contact_point, 120);
RK_SIZE(rk_pointer_rotation, 80);
RK_SIZE(rk_ground, 48);
RK_SIZE(rk_frame_head, 104);
RK_AT(rk_frame_head, acked_epoch, 24);
RK_AT(rk_frame_head, applied, 48);
RK_AT(rk_frame_head, coupling, 96);
RK_SIZE(rk_plane, 64);
RK_AT(rk_plane, point, 16);
RK_AT(rk_plane, normal, 40);
RK_SIZE(rk_plane_surface, 16);
RK_SIZE(rk_haptic_health, 4424);
RK_AT(rk_haptic_health, books, 136);
RK_AT(rk_haptic_health, lateness, 328);
RK_SIZE(rk_world_health, 4384);
RK_AT(rk_world_health, scheduling, 208);
RK_AT(rk_world_health, lateness, 288);
RK_SIZE(rk_bodies_head, 8);
RK_SIZE(rk_body, 120);
RK_AT(rk_body, orientation, 40);
RK_SIZE(rk_plane_velocity, 24);
RK_SIZE(rk_plane_friction, 16);
RK_SIZE(rk_plane_recovery, 8);
RK_SIZE(rk_local_head, 16);
RK_SIZE(rk_local_body, 224);
RK_AT(rk_local_body, mass, 16);
RK_AT(rk_local_body, orientation, 96);
RK_AT(rk_local_body, angular_acceleration, 200);
RK_SIZE(rk_contact_plane, 136);
RK_AT(rk_contact_plane, gap, 56);
RK_AT(rk_contact_plane, impulse, 104);
RK_AT(rk_contact_plane, radius, 128);
RK_SIZE(rk_plane_mobility, 8);
RK_SIZE(rk_plane_rounding, 8);
RK_SIZE(rk_reconciliation, 24);
RK_SIZE(rk_energy, 32);
RK_SIZE(rk_scene_head, 120);
RK_SIZE(rk_scene_body, 80);
RK_SIZE(rk_scene_collider, 120);
RK_SIZE(rk_scene_mesh, 256);

/* ---------------------------------------------------------------------------------------------
 * Messages as a peer holds them, with all blocks filled in */

typedef struct rk_tick {
  rk_tick_head head;
  rk_pointer pointer[RK_MAX_POINTERS];
  rk_pointer_rotation rotation[RK_MAX_POINTERS]; /* of pointer[i] */
  rk_channel channel[RK_MAX_CHANNELS];
  rk_ground ground;
} rk_tick;

/* rk_frame_init first: a frame that is all zero says of every plane that its body cannot move. */
typedef struct rk_frame {
  rk_frame_head head;
  rk_plane plane[RK_MAX_PLANES];
  rk_plane_surface surface[RK_MAX_PLANES]; /* of plane[i], like the next three; 0 = the default */
  rk_plane_velocity velocity[RK_MAX_PLANES];
  rk_plane_friction friction[RK_MAX_PLANES];
  rk_plane_recovery recovery[RK_MAX_PLANES];
  rk_local_head local;
  rk_local_body local_body[RK_MAX_LOCAL_BODIES];
  rk_contact_plane contact[RK_MAX_LOCAL_BODIES][RK_MAX_CONTACT_PLANES]; /* of local_body[i] */
  rk_plane_mobility mobility[RK_MAX_PLANES];                            /* of plane[i] */
  rk_plane_rounding rounding[RK_MAX_PLANES];                            /* likewise; 0 = flat */
} rk_frame;

/* Room for the largest message of a stream. */
#define RK_TICK_BYTES                                                                \
  ((uint32_t)(sizeof(rk_tick_head) +                                                 \
              RK_MAX_POINTERS * (sizeof(rk_pointer) + sizeof(rk_pointer_rotation)) + \
              RK_MAX_CHANNELS * sizeof(rk_channel) + sizeof(rk_ground)))
#define RK_FRAME_BYTES                                                                       \
  ((uint32_t)(sizeof(rk_frame_head) +                                                        \
              RK_MAX_PLANES *                                                                \
                  (sizeof(rk_plane) + sizeof(rk_plane_surface) + sizeof(rk_plane_velocity) + \
                   sizeof(rk_plane_friction) + sizeof(rk_plane_recovery) +                   \
                   sizeof(rk_plane_mobility) + sizeof(rk_plane_rounding)) +                  \
              sizeof(rk_local_head) +                                                        \
              RK_MAX_LOCAL_BODIES *                                                          \
                  (sizeof(rk_local_body) + RK_MAX_CONTACT_PLANES * sizeof(rk_contact_plane))))
#define RK_FRAME_ROOM (16384u - 32u) /* 6.2-2: what a frame's slot should have room for */
#define RK_HAPTIC_HEALTH_BYTES \
  ((uint32_t)(sizeof(rk_haptic_health) + sizeof(rk_reconciliation) + sizeof(rk_energy)))

/* What stands beside a payload. */
typedef struct rk_received {
  uint64_t number; /* n */
  uint64_t stamp_ns;
  uint32_t used_bytes; /* as the writer says; copied is what fits the reader's buffer */
  uint32_t blocks;
} rk_received;

/* Why a message is rejected, 9.2. */
enum rk_verdict {
  RK_SOUND = 0,
  RK_BAD_LENGTH,
  RK_BAD_COUNT,
  RK_BAD_ENUMERATOR,
  RK_BAD_IDENTITY,
  RK_BAD_NUMBER, /* not finite */
  RK_BAD_RANGE,
  RK_BAD_QUATERNION,
  RK_BAD_NORMAL
};

static inline int rk_finite(const double* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (!isfinite(values[i])) return 0;
  }
  return 1;
}

/* Likewise for a stretch of a record that holds nothing but doubles. */
static inline int rk_finite_span(const void* record, size_t from, size_t to) {
  for (; from < to; from += sizeof(double)) {
    double value;
    memcpy(&value, (const unsigned char*)record + from, sizeof value);
    if (!isfinite(value)) return 0;
  }
  return 1;
}

static inline int rk_is_period(uint64_t period_ns) {
  return period_ns >= 1 && period_ns <= UINT64_C(10000000000);
}

/* Scales `values` to unit length unless they are as far as doubles can tell. Returns the length
 * before. */
static inline double rk_normalise(double* values, size_t count) {
  double length = 0;
  for (size_t i = 0; i < count; ++i) length = hypot(length, values[i]);
  if (isfinite(length) && length > 1e-12 && fabs(length - 1) > 1e-14) {
    for (size_t i = 0; i < count; ++i) values[i] /= length;
  }
  return length;
}

static inline void rk_tick_init(rk_tick* m) {
  memset(m, 0, sizeof *m);
  for (size_t i = 0; i < RK_MAX_POINTERS; ++i) m->rotation[i].orientation[0] = 1;
}

static inline void rk_frame_init(rk_frame* m) {
  memset(m, 0, sizeof *m);
  for (size_t i = 0; i < RK_MAX_PLANES; ++i) m->mobility[i].inverse_mass = RK_MOBILITY_NOT_SAID;
}

/* Does the message say only what section 6 allows? Renormalises orientations. */
static inline enum rk_verdict rk_check_tick(rk_tick* m) {
  uint32_t seen = 0;
  if (m->head.pointer_count > RK_MAX_POINTERS || m->head.channel_count > RK_MAX_CHANNELS) {
    return RK_BAD_COUNT;
  }
  if (!rk_finite(&m->head.stiffness, 1) || !rk_finite(&m->head.damping, 1) ||
      !rk_finite(&m->head.force_cap, 1)) {
    return RK_BAD_NUMBER;
  }
  if (m->head.stiffness < 0 || m->head.damping < 0 || m->head.force_cap < 0 ||
      !rk_is_period(m->head.period_ns)) {
    return RK_BAD_RANGE;
  }
  for (uint32_t i = 0; i < m->head.pointer_count; ++i) {
    rk_pointer* p = &m->pointer[i];
    rk_pointer_rotation* r = &m->rotation[i];
    double norm;
    if (p->pointer >= RK_MAX_POINTERS || (seen & (1u << p->pointer)) != 0) return RK_BAD_IDENTITY;
    seen |= 1u << p->pointer;
    if (p->reason > RK_CLUTCHED) return RK_BAD_ENUMERATOR;
    if (!rk_finite(&p->radius, 1) || !rk_finite(p->position, 3) || !rk_finite(p->velocity, 3) ||
        !rk_finite(p->force, 3) || !rk_finite(r->orientation, 4) ||
        !rk_finite(r->angular_velocity, 3) || !rk_finite(r->torque, 3)) {
      return RK_BAD_NUMBER;
    }
    if (p->radius < 0) return RK_BAD_RANGE;
    norm = rk_normalise(r->orientation, 4);
    if (!(norm >= 0.99 && norm <= 1.01)) return RK_BAD_QUATERNION;
  }
  for (uint32_t i = 0; i < m->head.channel_count; ++i) {
    const rk_channel* c = &m->channel[i];
    if (c->pointer >= RK_MAX_POINTERS) return RK_BAD_IDENTITY;
    if (c->state != RK_CHANNEL_OPEN && c->state != RK_CHANNEL_CLOSED) return RK_BAD_ENUMERATOR;
    if (c->opened_tick > m->head.tick) return RK_BAD_RANGE;
    if (!rk_finite(c->first_moment, 3) || !rk_finite(c->angular_first_moment, 3) ||
        !rk_finite(c->contact_point, 3)) {
      return RK_BAD_NUMBER;
    }
  }
  return RK_SOUND;
}

/* 6.2-10 */
static inline int rk_is_inertia(const double* inertia) {
  const double trace = inertia[0] + inertia[3] + inertia[5];
  double m[6];
  if (!(trace >= 1e-18 && trace <= 1e18)) return 0;
  for (int i = 0; i < 6; ++i) m[i] = inertia[i] / trace;
  return m[0] > 1e-12 && m[0] * m[3] - m[1] * m[1] > 1e-12 &&
         m[0] * (m[3] * m[5] - m[4] * m[4]) - m[1] * (m[1] * m[5] - m[2] * m[4]) +
                 m[2] * (m[1] * m[4] - m[2] * m[3]) >
             1e-12;
}

static inline enum rk_verdict rk_check_local_body(rk_local_body* b, rk_contact_plane* contacts) {
  double norm;
  if (!rk_finite_span(b, offsetof(rk_local_body, mass), sizeof *b)) return RK_BAD_NUMBER;
  if (b->mass < 1e-9 || b->mass > 1e9 || !rk_is_inertia(b->inertia)) return RK_BAD_RANGE;
  norm = rk_normalise(b->orientation, 4);
  if (!(norm >= 0.99 && norm <= 1.01)) return RK_BAD_QUATERNION;
  for (uint32_t i = 0; i < b->contact_count; ++i) {
    rk_contact_plane* c = &contacts[i];
    if (!rk_finite_span(c, offsetof(rk_contact_plane, point), sizeof *c)) return RK_BAD_NUMBER;
    if (c->friction < 0 || c->other_inverse_mass < 0 || c->radius < 0) return RK_BAD_RANGE;
    norm = rk_normalise(c->normal, 3);
    if (!isfinite(norm)) return RK_BAD_NUMBER;
    if (!(norm > 1e-12)) return RK_BAD_NORMAL;
  }
  return RK_SOUND;
}

static inline int rk_is_not_said(double inverse_mass) { /* exactly */
  return inverse_mass >= RK_MOBILITY_NOT_SAID && inverse_mass <= RK_MOBILITY_NOT_SAID;
}

/* Likewise; renormalises normals. */
static inline enum rk_verdict rk_check_frame(rk_frame* m) {
  if (m->head.plane_count > RK_MAX_PLANES) return RK_BAD_COUNT;
  if (m->head.coupling < RK_BY_POSITION || m->head.coupling > RK_BY_LOCAL) return RK_BAD_ENUMERATOR;
  if (m->head.frame == 0 || !rk_is_period(m->head.period_ns)) return RK_BAD_RANGE;
  if (m->head.acked_epoch != 0 && m->head.baseline_tick > m->head.acked_tick) return RK_BAD_RANGE;
  for (uint32_t i = 0; i < m->head.plane_count; ++i) {
    rk_plane* p = &m->plane[i];
    const rk_plane_surface* s = &m->surface[i];
    const rk_plane_friction* f = &m->friction[i];
    const double recovery_s = m->recovery[i].recovery_s;
    const double inverse_mass = m->mobility[i].inverse_mass;
    const double radius = m->rounding[i].radius;
    double norm;
    if (p->pointer >= RK_MAX_POINTERS) return RK_BAD_IDENTITY;
    if (!rk_finite(p->point, 3) || !rk_finite_span(s, 0, sizeof *s) ||
        !rk_finite(m->velocity[i].velocity, 3) || !rk_finite_span(f, 0, sizeof *f) ||
        !isfinite(recovery_s) || !isfinite(inverse_mass) || !isfinite(radius)) {
      return RK_BAD_NUMBER;
    }
    if (s->stiffness < 0 || s->damping < 0 || f->static_friction < 0 || f->dynamic_friction < 0 ||
        recovery_s < 0 || recovery_s > 10 || radius < 0 ||
        (inverse_mass < 0 && !rk_is_not_said(inverse_mass))) {
      return RK_BAD_RANGE;
    }
    norm = rk_normalise(p->normal, 3);
    if (!isfinite(norm)) return RK_BAD_NUMBER;
    if (!(norm > 1e-12)) return RK_BAD_NORMAL;
  }
  if (m->local.local_body_count > RK_MAX_LOCAL_BODIES) return RK_BAD_COUNT;
  if (m->local.local_body_count > 0 && !rk_is_period(m->local.substep_ns)) return RK_BAD_RANGE;
  for (uint32_t i = 0; i < m->local.local_body_count; ++i) {
    enum rk_verdict verdict;
    for (uint32_t j = 0; j < i; ++j) {
      if (m->local_body[j].body == m->local_body[i].body) return RK_BAD_IDENTITY;
    }
    if (m->local_body[i].contact_count > RK_MAX_CONTACT_PLANES) return RK_BAD_COUNT;
    verdict = rk_check_local_body(&m->local_body[i], m->contact[i]);
    if (verdict != RK_SOUND) return verdict;
  }
  return RK_SOUND;
}

/* One record after the other, in either direction. */
static inline void rk_put(uint64_t* words, uint32_t* at, const void* record, size_t bytes) {
  memcpy((unsigned char*)words + *at, record, bytes);
  *at += (uint32_t)bytes;
}
static inline void rk_get(const uint64_t* words, uint32_t* at, void* record, size_t bytes) {
  memcpy(record, (const unsigned char*)words + *at, bytes);
  *at += (uint32_t)bytes;
}

static inline uint32_t rk_tick_bytes(const rk_tick_head* head, uint32_t blocks) {
  return (uint32_t)(sizeof(rk_tick_head) + head->pointer_count * sizeof(rk_pointer) +
                    head->channel_count * sizeof(rk_channel) +
                    ((blocks & RK_TICK_ROTATIONS) != 0
                         ? head->pointer_count * sizeof(rk_pointer_rotation)
                         : 0) +
                    ((blocks & RK_TICK_GROUND) != 0 ? sizeof(rk_ground) : 0));
}
/* Exactly what is known, or at least that if blocks of a later version follow. */
static inline int rk_length_agrees(const rk_received* r, uint32_t bytes, size_t room_bytes,
                                   uint32_t known_blocks) {
  if (bytes > room_bytes) return 0;
  return (r->blocks & ~known_blocks) != 0 ? r->used_bytes >= bytes : r->used_bytes == bytes;
}

/* Packs a message into `words` (room for RK_TICK_BYTES) and says used_bytes and blocks. 0 if its
 * counts are impossible. */
static inline int rk_encode_tick(const rk_tick* m, uint64_t* words, rk_received* shape) {
  static const double still[10] = {1, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  static const int64_t nothing[6] = {0, 0, 0, 0, 0, 0};
  uint32_t at = 0;
  uint32_t blocks = 0;
  if (m->head.pointer_count > RK_MAX_POINTERS || m->head.channel_count > RK_MAX_CHANNELS) return 0;
  for (uint32_t i = 0; i < m->head.pointer_count; ++i) {
    if (memcmp(&m->rotation[i], still, sizeof still) != 0) blocks |= RK_TICK_ROTATIONS;
  }
  if (memcmp(&m->ground, nothing, sizeof nothing) != 0) blocks |= RK_TICK_GROUND;
  rk_put(words, &at, &m->head, sizeof m->head);
  rk_put(words, &at, m->pointer, m->head.pointer_count * sizeof(rk_pointer));
  rk_put(words, &at, m->channel, m->head.channel_count * sizeof(rk_channel));
  if ((blocks & RK_TICK_ROTATIONS) != 0) {
    rk_put(words, &at, m->rotation, m->head.pointer_count * sizeof(rk_pointer_rotation));
  }
  if ((blocks & RK_TICK_GROUND) != 0) rk_put(words, &at, &m->ground, sizeof m->ground);
  shape->used_bytes = at;
  shape->blocks = blocks;
  return 1;
}

/* Unpacks and checks `room_bytes` of private memory. `m` is untouched unless RK_SOUND. */
static inline enum rk_verdict rk_decode_tick(const uint64_t* words, size_t room_bytes,
                                             const rk_received* r, rk_tick* m) {
  rk_tick copy;
  uint32_t at = 0;
  enum rk_verdict verdict;
  if (r->used_bytes < sizeof copy.head || room_bytes < sizeof copy.head) return RK_BAD_LENGTH;
  rk_tick_init(&copy);
  rk_get(words, &at, &copy.head, sizeof copy.head);
  if (copy.head.pointer_count > RK_MAX_POINTERS || copy.head.channel_count > RK_MAX_CHANNELS) {
    return RK_BAD_COUNT;
  }
  if (!rk_length_agrees(r, rk_tick_bytes(&copy.head, r->blocks), room_bytes,
                        RK_TICK_ROTATIONS | RK_TICK_GROUND)) {
    return RK_BAD_LENGTH;
  }
  rk_get(words, &at, copy.pointer, copy.head.pointer_count * sizeof(rk_pointer));
  rk_get(words, &at, copy.channel, copy.head.channel_count * sizeof(rk_channel));
  if ((r->blocks & RK_TICK_ROTATIONS) != 0) {
    rk_get(words, &at, copy.rotation, copy.head.pointer_count * sizeof(rk_pointer_rotation));
  }
  if ((r->blocks & RK_TICK_GROUND) != 0) rk_get(words, &at, &copy.ground, sizeof copy.ground);
  verdict = rk_check_tick(&copy);
  if (verdict == RK_SOUND) *m = copy;
  return verdict;
}

static inline int rk_any(const void* records, size_t bytes) { /* a value that is not 0 */
  for (size_t i = 0; i < bytes; i += sizeof(double)) {
    double value;
    memcpy(&value, (const unsigned char*)records + i, sizeof value);
    if (value < 0 || value > 0) return 1;
  }
  return 0;
}

static inline int rk_any_mobility(const rk_frame* m) {
  for (uint32_t i = 0; i < m->head.plane_count; ++i) {
    if (!rk_is_not_said(m->mobility[i].inverse_mass)) return 1;
  }
  return 0;
}

/* Room for RK_FRAME_BYTES. */
static inline int rk_encode_frame(const rk_frame* m, uint64_t* words, rk_received* shape) {
  const size_t planes = m->head.plane_count;
  const uint32_t bodies = m->local.local_body_count;
  uint32_t at = 0;
  uint32_t blocks = bodies > 0 ? RK_FRAME_LOCAL_BODIES : 0;
  if (planes > RK_MAX_PLANES || bodies > RK_MAX_LOCAL_BODIES) return 0;
  for (uint32_t i = 0; i < bodies; ++i) {
    if (m->local_body[i].contact_count > RK_MAX_CONTACT_PLANES) return 0;
  }
  if (rk_any(m->surface, planes * sizeof m->surface[0])) blocks |= RK_FRAME_SURFACES;
  if (rk_any(m->velocity, planes * sizeof m->velocity[0])) blocks |= RK_FRAME_VELOCITIES;
  if (rk_any(m->friction, planes * sizeof m->friction[0])) blocks |= RK_FRAME_FRICTION;
  if (rk_any(m->recovery, planes * sizeof m->recovery[0])) blocks |= RK_FRAME_RECOVERY;
  if (rk_any_mobility(m)) blocks |= RK_FRAME_MOBILITY;
  if (rk_any(m->rounding, planes * sizeof m->rounding[0])) blocks |= RK_FRAME_ROUNDING;
  rk_put(words, &at, &m->head, sizeof m->head);
  rk_put(words, &at, m->plane, planes * sizeof m->plane[0]);
  if ((blocks & RK_FRAME_SURFACES) != 0) {
    rk_put(words, &at, m->surface, planes * sizeof m->surface[0]);
  }
  if ((blocks & RK_FRAME_VELOCITIES) != 0) {
    rk_put(words, &at, m->velocity, planes * sizeof m->velocity[0]);
  }
  if ((blocks & RK_FRAME_FRICTION) != 0) {
    rk_put(words, &at, m->friction, planes * sizeof m->friction[0]);
  }
  if ((blocks & RK_FRAME_RECOVERY) != 0) {
    rk_put(words, &at, m->recovery, planes * sizeof m->recovery[0]);
  }
  if ((blocks & RK_FRAME_LOCAL_BODIES) != 0) {
    rk_put(words, &at, &m->local, sizeof m->local);
    rk_put(words, &at, m->local_body, bodies * sizeof m->local_body[0]);
    for (uint32_t i = 0; i < bodies; ++i) {
      rk_put(words, &at, m->contact[i], m->local_body[i].contact_count * sizeof m->contact[0][0]);
    }
  }
  if ((blocks & RK_FRAME_MOBILITY) != 0) {
    rk_put(words, &at, m->mobility, planes * sizeof m->mobility[0]);
  }
  if ((blocks & RK_FRAME_ROUNDING) != 0) {
    rk_put(words, &at, m->rounding, planes * sizeof m->rounding[0]);
  }
  shape->used_bytes = at;
  shape->blocks = blocks;
  return 1;
}

/* Takes `bytes` from a payload unless they lie beyond its end. */
static inline int rk_take(const uint64_t* words, uint32_t end, uint32_t* at, void* records,
                          size_t bytes) {
  if (bytes > end - *at) return 0;
  rk_get(words, at, records, bytes);
  return 1;
}

static inline enum rk_verdict rk_decode_local(const uint64_t* words, uint32_t end, uint32_t* at,
                                              rk_frame* m) {
  if (!rk_take(words, end, at, &m->local, sizeof m->local)) return RK_BAD_LENGTH;
  if (m->local.local_body_count > RK_MAX_LOCAL_BODIES) return RK_BAD_COUNT;
  if (!rk_take(words, end, at, m->local_body,
               m->local.local_body_count * sizeof m->local_body[0])) {
    return RK_BAD_LENGTH;
  }
  for (uint32_t i = 0; i < m->local.local_body_count; ++i) {
    if (m->local_body[i].contact_count > RK_MAX_CONTACT_PLANES) return RK_BAD_COUNT;
    if (!rk_take(words, end, at, m->contact[i],
                 m->local_body[i].contact_count * sizeof m->contact[0][0])) {
      return RK_BAD_LENGTH;
    }
  }
  return RK_SOUND;
}

static inline enum rk_verdict rk_decode_frame(const uint64_t* words, size_t room_bytes,
                                              const rk_received* r, rk_frame* m) {
  const uint32_t known = RK_FRAME_SURFACES | RK_FRAME_VELOCITIES | RK_FRAME_FRICTION |
                         RK_FRAME_RECOVERY | RK_FRAME_LOCAL_BODIES | RK_FRAME_MOBILITY |
                         RK_FRAME_ROUNDING;
  const uint32_t end = r->used_bytes < room_bytes ? r->used_bytes : (uint32_t)room_bytes;
  rk_frame copy;
  size_t planes;
  uint32_t at = 0;
  enum rk_verdict verdict = RK_SOUND;
  rk_frame_init(&copy);
  if (!rk_take(words, end, &at, &copy.head, sizeof copy.head)) return RK_BAD_LENGTH;
  planes = copy.head.plane_count;
  if (planes > RK_MAX_PLANES) return RK_BAD_COUNT;
  if (!rk_take(words, end, &at, copy.plane, planes * sizeof copy.plane[0]) ||
      ((r->blocks & RK_FRAME_SURFACES) != 0 &&
       !rk_take(words, end, &at, copy.surface, planes * sizeof copy.surface[0])) ||
      ((r->blocks & RK_FRAME_VELOCITIES) != 0 &&
       !rk_take(words, end, &at, copy.velocity, planes * sizeof copy.velocity[0])) ||
      ((r->blocks & RK_FRAME_FRICTION) != 0 &&
       !rk_take(words, end, &at, copy.friction, planes * sizeof copy.friction[0])) ||
      ((r->blocks & RK_FRAME_RECOVERY) != 0 &&
       !rk_take(words, end, &at, copy.recovery, planes * sizeof copy.recovery[0]))) {
    return RK_BAD_LENGTH;
  }
  if ((r->blocks & RK_FRAME_LOCAL_BODIES) != 0) verdict = rk_decode_local(words, end, &at, &copy);
  if (verdict == RK_SOUND && (r->blocks & RK_FRAME_MOBILITY) != 0 &&
      !rk_take(words, end, &at, copy.mobility, planes * sizeof copy.mobility[0])) {
    verdict = RK_BAD_LENGTH;
  }
  if (verdict == RK_SOUND && (r->blocks & RK_FRAME_ROUNDING) != 0 &&
      !rk_take(words, end, &at, copy.rounding, planes * sizeof copy.rounding[0])) {
    verdict = RK_BAD_LENGTH;
  }
  if (verdict == RK_SOUND && !rk_length_agrees(r, at, room_bytes, known)) verdict = RK_BAD_LENGTH;
  if (verdict == RK_SOUND) verdict = rk_check_frame(&copy);
  if (verdict == RK_SOUND) *m = copy;
  return verdict;
}

/* Impulse [N s] in whole units; what is left over goes into `remainder`, so that the sum never
 * drifts (7.1). Add the result to a total with rk_add. */
static inline int64_t rk_quantise(double newton_seconds, double* remainder) {
  const double exact = newton_seconds / RK_IMPULSE_UNIT + *remainder;
  double whole;
  if (!isfinite(exact)) return 0;
  whole = nearbyint(fmin(fmax(exact, -4e18), 4e18));
  *remainder = fmin(fmax(exact - whole, -0.5), 0.5);
  return (int64_t)whole;
}

/* Sums and differences modulo 2^64 (7.1), without the undefined overflow of signed numbers. */
static inline int64_t rk_add(int64_t a, int64_t b) {
  return (int64_t)((uint64_t)a + (uint64_t)b);
}
static inline int64_t rk_sub(int64_t a, int64_t b) {
  return (int64_t)((uint64_t)a - (uint64_t)b);
}

static inline uint64_t rk_now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (uint64_t)now.tv_sec * UINT64_C(1000000000) + (uint64_t)now.tv_nsec;
}

/* ---------------------------------------------------------------------------------------------
 * The ring, section 4 */

typedef struct rk_writer {
  uint64_t* counter; /* `published`, in shared memory */
  uint64_t* slots;
  uint32_t slot_stride, slot_count, payload_bytes;
  uint64_t published;
} rk_writer;

typedef struct rk_reader {
  const uint64_t* counter;
  const uint64_t* slots;
  uint32_t slot_stride, slot_count, payload_bytes;
  uint64_t cursor;                      /* number returned last */
  uint64_t lost;                        /* overwritten before rk_read_next saw them */
  uint64_t retries;                     /* copies thrown away */
  uint64_t rejected, rejected_in_a_row; /* by rk_accept */
  uint64_t stamp_ns;                    /* of the message accepted last */
  uint64_t period_ns;                   /* of the directory; 0 = aperiodic */
  uint64_t looked, looked_ns;           /* what rk_jumped saw last, and when; 0 = nothing yet */
} rk_reader;

enum rk_read_status {
  RK_FRESH,
  RK_SAME,      /* rk_read_latest: the newest is the one returned last */
  RK_EMPTY,     /* nothing (more) was published */
  RK_CONTENDED, /* three tries failed: keep the previous value and count it */
  RK_BACKWARDS, /* the counter went back: the writer breaks the protocol, detach */
  RK_REJECTED   /* impossible length, counted: keep the previous value */
};

/* Publishes message published + 1. 0, and nothing happens, if it does not fit. 4.2 */
static inline int rk_publish(rk_writer* w, const uint64_t* payload, const rk_received* shape,
                             uint64_t stamp_ns) {
  const uint64_t n = w->published + 1;
  uint64_t* slot = w->slots + (n & (w->slot_count - 1u)) * (w->slot_stride / 8u);
  if (shape->used_bytes > w->payload_bytes || shape->used_bytes % 8 != 0) return 0;
  __atomic_store_n(&slot[0], 2 * n - 1, __ATOMIC_RELAXED);
  __atomic_store_n(&slot[1], stamp_ns, __ATOMIC_RELEASE);
  __atomic_store_n(&slot[2], shape->used_bytes | (uint64_t)shape->blocks << 32, __ATOMIC_RELEASE);
  for (uint32_t i = 0; i < shape->used_bytes / 8u; ++i) {
    __atomic_store_n(&slot[4 + i], payload[i], __ATOMIC_RELEASE);
  }
  __atomic_store_n(&slot[0], 2 * n, __ATOMIC_RELEASE);
  __atomic_store_n(w->counter, n, __ATOMIC_RELEASE);
  w->published = n;
  return 1;
}

static inline int rk_copy(const rk_reader* r, uint64_t n, uint64_t* words, size_t room_bytes,
                          rk_received* received) {
  const uint64_t* slot = r->slots + (n & (r->slot_count - 1u)) * (r->slot_stride / 8u);
  uint64_t stamp_ns, shape;
  size_t bytes;
  if (__atomic_load_n(&slot[0], __ATOMIC_ACQUIRE) != 2 * n) return 0;
  stamp_ns = __atomic_load_n(&slot[1], __ATOMIC_ACQUIRE);
  shape = __atomic_load_n(&slot[2], __ATOMIC_ACQUIRE);
  bytes = (uint32_t)shape;
  if (bytes > r->payload_bytes) bytes = r->payload_bytes;
  if (bytes > room_bytes) bytes = room_bytes;
  for (size_t i = 0; i < bytes / 8; ++i) {
    words[i] = __atomic_load_n(&slot[4 + i], __ATOMIC_ACQUIRE);
  }
  if (__atomic_load_n(&slot[0], __ATOMIC_RELAXED) != 2 * n) return 0;
  received->number = n;
  received->stamp_ns = stamp_ns;
  received->used_bytes = (uint32_t)shape;
  received->blocks = (uint32_t)(shape >> 32);
  return 1;
}

static inline enum rk_read_status rk_return(rk_reader* r, const rk_received* received) {
  r->cursor = received->number;
  if (received->used_bytes <= r->payload_bytes && received->used_bytes % 8 == 0) return RK_FRESH;
  ++r->rejected;
  ++r->rejected_in_a_row;
  return RK_REJECTED;
}

/* The last word on a decoded message: its stamp must be neither in the future nor before the last
 * one's. Counts; pass the result of rk_decode_*. 9.2 */
static inline enum rk_verdict rk_accept(rk_reader* r, const rk_received* received,
                                        enum rk_verdict verdict, uint64_t now_ns) {
  if (verdict == RK_SOUND &&
      (received->stamp_ns > now_ns + 1000000u || received->stamp_ns < r->stamp_ns)) {
    verdict = RK_BAD_RANGE;
  }
  if (verdict == RK_SOUND) {
    r->rejected_in_a_row = 0;
    r->stamp_ns = received->stamp_ns;
  } else {
    ++r->rejected;
    ++r->rejected_in_a_row;
  }
  return verdict;
}

/* Has the counter grown faster than a writer of this period can be meant to? Ask after every read that
 * brought a message; then detach, as for RK_BACKWARDS. 9.2-9 */
static inline int rk_jumped(rk_reader* r, uint64_t now_ns) {
  const int first = r->looked_ns == 0;
  const uint64_t grown = r->cursor - r->looked;
  const uint64_t periods = first || r->period_ns == 0 ? 0 : (now_ns - r->looked_ns) / r->period_ns;
  r->looked = r->cursor;
  r->looked_ns = now_ns;
  return !first && r->period_ns != 0 && grown / 4 > periods + r->slot_count;
}

/* Ten rejections in a row, or RK_BACKWARDS: detach until the object changes. 9.2-6 */
static inline int rk_hopeless(const rk_reader* r) {
  return r->rejected_in_a_row >= 10;
}

/* Copies the newest message into `words`, `room_bytes` at most. 4.3 */
static inline enum rk_read_status rk_read_latest(rk_reader* r, uint64_t* words, size_t room_bytes,
                                                 rk_received* received) {
  for (int i = 0; i < 3; ++i) {
    const uint64_t n = __atomic_load_n(r->counter, __ATOMIC_ACQUIRE);
    if (n < r->cursor || n >> 63 != 0) return RK_BACKWARDS;
    if (n == 0) return RK_EMPTY;
    if (n == r->cursor) return RK_SAME;
    if (rk_copy(r, n, words, room_bytes, received)) return rk_return(r, received);
    ++r->retries;
  }
  return RK_CONTENDED;
}

/* Copies the message after the one returned last. 4.4 */
static inline enum rk_read_status rk_read_next(rk_reader* r, uint64_t* words, size_t room_bytes,
                                               rk_received* received) {
  for (int i = 0; i < 3; ++i) {
    const uint64_t n = __atomic_load_n(r->counter, __ATOMIC_ACQUIRE);
    if (n < r->cursor || n >> 63 != 0) return RK_BACKWARDS;
    if (n == r->cursor) return RK_EMPTY;
    if (n - r->cursor > r->slot_count - 2u) {
      r->lost += n - r->slot_count / 2u - r->cursor;
      r->cursor = n - r->slot_count / 2u;
    }
    if (rk_copy(r, r->cursor + 1, words, room_bytes, received)) return rk_return(r, received);
    ++r->retries;
  }
  return RK_CONTENDED;
}

/* ---------------------------------------------------------------------------------------------
 * Names and locks, sections 3 and 5 */

enum { RK_PATH_BYTES = 512, RK_WHY_BYTES = 192 };

static inline const char* rk_role_name(uint32_t role) {
  return role == RK_HAPTIC ? "haptic" : "world";
}

/* The file behind /rikiseki.<instance>.<role> on Linux. 0 if `instance` is no name. */
static inline int rk_object_path(char path[RK_PATH_BYTES], const char* instance, uint32_t role) {
  const size_t length =
      strspn(instance, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-");
  if (length < 1 || length > 64 || instance[length] != '\0') return 0;
  snprintf(path, RK_PATH_BYTES, "/dev/shm/rikiseki.%s.%s", instance, rk_role_name(role));
  return 1;
}

static inline struct flock rk_lock_on_byte_0(short type) {
  struct flock lock;
  memset(&lock, 0, sizeof lock);
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  return lock;
}

/* Somebody holds the owner lock. Asked as a reader, so that other observers do not count. */
static inline int rk_owner_locked(int descriptor) {
  struct flock lock = rk_lock_on_byte_0(F_RDLCK);
  return fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

/* ---------------------------------------------------------------------------------------------
 * Attaching to the other side's segment, 5.3 and 9.1 */

enum rk_attach_status {
  RK_ATTACHED = 0,
  RK_ABSENT,      /* no object of that name */
  RK_NOT_READY,   /* its owner is still filling it */
  RK_OWNER_GONE,  /* closed, superseded, or its owner died */
  RK_FORBIDDEN,   /* may not be read, or belongs to a user who may not own one */
  RK_INCOMPATIBLE /* do not try again before the object changes */
};

/* A stream that the reader cannot do without. */
typedef struct rk_need {
  uint32_t type_id;
  uint16_t type_version; /* at least */
  uint64_t history_ns;   /* slot_count * period_ns, at least; 0 = any */
} rk_need;

typedef struct rk_view {
  const rk_segment_header* shared; /* only its changing words, through the functions below */
  size_t bytes;
  int descriptor;
  dev_t device;
  ino_t inode;
  rk_segment_header header; /* the private, checked copy: everything else */
  char path[RK_PATH_BYTES];
  char why[RK_WHY_BYTES]; /* what rk_attach did not like */
} rk_view;

static inline int rk_refuse(rk_view* view, const char* field, uint64_t value) {
  snprintf(view->why, sizeof view->why, "%s is %llu", field, (unsigned long long)value);
  return 0;
}

static inline int rk_overlap(uint64_t a, uint64_t a_bytes, uint64_t b, uint64_t b_bytes) {
  return a < b + b_bytes && b < a + a_bytes;
}

/* The rules of 3.2 for entry `i` of the private copy, and that it overlaps no earlier one. */
static inline int rk_check_entry(rk_view* view, uint32_t i) {
  const rk_segment_header* h = &view->header;
  const rk_stream_entry* e = &h->stream[i];
  const uint64_t ring_bytes = (uint64_t)e->slot_stride * e->slot_count;
  if (e->type_id == 0) return rk_refuse(view, "stream type_id", 0);
  if (e->slot_stride == 0 || e->slot_stride % RK_LINE_BYTES != 0) {
    return rk_refuse(view, "slot_stride", e->slot_stride);
  }
  if (e->slot_count < RK_MIN_SLOTS || e->slot_count > RK_MAX_SLOTS ||
      (e->slot_count & (e->slot_count - 1)) != 0) {
    return rk_refuse(view, "slot_count", e->slot_count);
  }
  if (e->payload_bytes % 8 != 0 || e->payload_bytes > e->slot_stride - sizeof(rk_slot_header)) {
    return rk_refuse(view, "payload_bytes", e->payload_bytes);
  }
  if (e->cursor_offset % RK_LINE_BYTES != 0 || e->cursor_offset < RK_HEADER_BYTES ||
      e->cursor_offset > h->segment_bytes || RK_LINE_BYTES > h->segment_bytes - e->cursor_offset) {
    return rk_refuse(view, "cursor_offset", e->cursor_offset);
  }
  if (e->ring_offset % RK_LINE_BYTES != 0 || e->ring_offset < RK_HEADER_BYTES ||
      e->ring_offset > h->segment_bytes || ring_bytes > h->segment_bytes - e->ring_offset ||
      rk_overlap(e->ring_offset, ring_bytes, e->cursor_offset, RK_LINE_BYTES)) {
    return rk_refuse(view, "ring_offset", e->ring_offset);
  }
  for (uint32_t j = 0; j < i; ++j) {
    const rk_stream_entry* o = &h->stream[j];
    const uint64_t other_bytes = (uint64_t)o->slot_stride * o->slot_count;
    if (o->type_id == e->type_id) return rk_refuse(view, "twice: stream type_id", e->type_id);
    if (rk_overlap(e->cursor_offset, RK_LINE_BYTES, o->cursor_offset, RK_LINE_BYTES) ||
        rk_overlap(e->cursor_offset, RK_LINE_BYTES, o->ring_offset, other_bytes)) {
      return rk_refuse(view, "overlapping: cursor_offset", e->cursor_offset);
    }
    if (rk_overlap(e->ring_offset, ring_bytes, o->cursor_offset, RK_LINE_BYTES) ||
        rk_overlap(e->ring_offset, ring_bytes, o->ring_offset, other_bytes)) {
      return rk_refuse(view, "overlapping: ring_offset", e->ring_offset);
    }
  }
  return 1;
}

/* 9.1 and 8.2 on the private copy. */
static inline int rk_check_header(rk_view* view, uint32_t role) {
  const rk_segment_header* h = &view->header;
  if (h->magic != RK_MAGIC) return rk_refuse(view, "magic", h->magic);
  if (h->byte_order != RK_BYTE_ORDER) return rk_refuse(view, "byte_order", h->byte_order);
  if (h->version_major != RK_VERSION_MAJOR) {
    return rk_refuse(view, "version_major", h->version_major);
  }
  if (h->version_minor == RK_VERSION_MINOR && h->layout_hash != RK_LAYOUT_HASH) {
    return rk_refuse(view, "at the same version, layout_hash", h->layout_hash);
  }
  if (h->header_bytes != RK_HEADER_BYTES) return rk_refuse(view, "header_bytes", h->header_bytes);
  if (h->role != role) return rk_refuse(view, "role", h->role);
  if (h->epoch == 0) return rk_refuse(view, "epoch", 0);
  if (h->segment_bytes < RK_HEADER_BYTES || h->segment_bytes > view->bytes) {
    return rk_refuse(view, "segment_bytes", h->segment_bytes);
  }
  if (h->stream_count < 1 || h->stream_count > RK_MAX_STREAMS) {
    return rk_refuse(view, "stream_count", h->stream_count);
  }
  for (uint32_t i = 0; i < h->stream_count; ++i) {
    if (!rk_check_entry(view, i)) return 0;
  }
  return 1;
}

static inline const rk_stream_entry* rk_find(const rk_segment_header* header, uint32_t type_id) {
  for (uint32_t i = 0; i < header->stream_count && i < RK_MAX_STREAMS; ++i) {
    if (header->stream[i].type_id == type_id) return &header->stream[i];
  }
  return NULL;
}

static inline int rk_check_needs(rk_view* view, const rk_need* needs, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const rk_stream_entry* e = rk_find(&view->header, needs[i].type_id);
    uint64_t period_ns;
    if (e == NULL) return rk_refuse(view, "missing: the stream type", needs[i].type_id);
    if (e->type_version < needs[i].type_version) {
      return rk_refuse(view, "too old: type_version", e->type_version);
    }
    period_ns = e->period_ns < UINT64_C(10000000000) ? e->period_ns : UINT64_C(10000000000);
    if (e->slot_count * period_ns < needs[i].history_ns) {
      return rk_refuse(view, "too short: slot_count", e->slot_count);
    }
  }
  return 1;
}

/* This user, root, and the daemons' users where they exist. */
static inline int rk_may_own(uid_t uid) {
  static const char* const daemons[2] = {"haptics-device", "haptics-world"};
  if (uid == geteuid() || uid == 0) return 1;
  for (int i = 0; i < 2; ++i) {
    const struct passwd* user = getpwnam(daemons[i]);
    if (user != NULL && user->pw_uid == uid) return 1;
  }
  return 0;
}

static inline void rk_detach(rk_view* view) {
  if (view->shared != NULL) munmap((void*)(uintptr_t)view->shared, view->bytes);
  if (view->descriptor >= 0) close(view->descriptor);
  view->shared = NULL;
  view->descriptor = -1;
}

/* What the owner says now: enum rk_segment_state. */
static inline uint64_t rk_state(const rk_view* view) {
  return __atomic_load_n(&view->shared->state, __ATOMIC_ACQUIRE);
}
static inline uint64_t rk_heartbeat_of(const rk_view* view) {
  return __atomic_load_n(&view->shared->heartbeat_ns, __ATOMIC_RELAXED);
}
/* Does its owner live? Does the name lead to another object? (One that is gone is no end: 5.4-3.)
 * System calls, for 10 Hz. */
static inline int rk_owner_alive(const rk_view* view) {
  return rk_owner_locked(view->descriptor);
}
static inline int rk_replaced(const rk_view* view) {
  struct stat status;
  return lstat(view->path, &status) == 0 &&
         (status.st_dev != view->device || status.st_ino != view->inode);
}

static inline enum rk_attach_status rk_attach_failed(rk_view* view, enum rk_attach_status status,
                                                     const char* why) {
  if (why != NULL) snprintf(view->why, sizeof view->why, "%s", why);
  rk_detach(view);
  return status;
}

/* Attaches read-only to the segment of `role`. Unless RK_ATTACHED, view->why is a reason and there
 * is nothing to detach. */
static inline enum rk_attach_status rk_attach(rk_view* view, const char* instance, uint32_t role,
                                              const rk_need* needs, size_t need_count) {
  struct stat status;
  uint64_t words[RK_HEADER_BYTES / 8];
  volatile unsigned char touched = 0;
  void* map;
  memset(view, 0, sizeof *view);
  view->descriptor = -1;
  if (!rk_object_path(view->path, instance, role)) {
    return rk_attach_failed(view, RK_FORBIDDEN, "that is no instance name");
  }
  view->descriptor = open(view->path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (view->descriptor < 0) {
    return errno == ENOENT ? rk_attach_failed(view, RK_ABSENT, "there is no such segment")
                           : rk_attach_failed(view, RK_FORBIDDEN, strerror(errno));
  }
  if (fstat(view->descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    return rk_attach_failed(view, RK_FORBIDDEN, "it is not a regular object");
  }
  if (!rk_may_own(status.st_uid)) {
    return rk_attach_failed(view, RK_FORBIDDEN, "its owner may not own a segment");
  }
  if (status.st_size == 0) return rk_attach_failed(view, RK_NOT_READY, "it has no memory yet");
  if (status.st_size < (off_t)RK_HEADER_BYTES || status.st_size > (off_t)RK_MAX_SEGMENT_BYTES) {
    return rk_attach_failed(view, RK_INCOMPATIBLE, "its size is not 4096 bytes to 16 MiB");
  }
  view->device = status.st_dev;
  view->inode = status.st_ino;
  view->bytes = (size_t)status.st_size;
  map = mmap(NULL, view->bytes, PROT_READ, MAP_SHARED, view->descriptor, 0);
  if (map == MAP_FAILED) return rk_attach_failed(view, RK_FORBIDDEN, strerror(errno));
  view->shared = (const rk_segment_header*)map;
  switch (rk_state(view)) {
    case RK_INITIALISING:
      return rk_attach_failed(view, RK_NOT_READY, "its owner is still filling it");
    case RK_CLOSED:
    case RK_SUPERSEDED:
      return rk_attach_failed(view, RK_OWNER_GONE, "its owner has closed it");
    case RK_READY:
    case RK_FAULTED:
      break;
    default:
      return rk_attach_failed(view, RK_INCOMPATIBLE, "state is not 0 to 4");
  }
  for (size_t i = 0; i < RK_HEADER_BYTES / 8; ++i) {
    words[i] = __atomic_load_n((const uint64_t*)map + i, __ATOMIC_RELAXED);
  }
  memcpy(&view->header, words, sizeof view->header);
  if (!rk_check_header(view, role) || !rk_check_needs(view, needs, need_count)) {
    return rk_attach_failed(view, RK_INCOMPATIBLE, NULL);
  }
  if (!rk_owner_alive(view)) return rk_attach_failed(view, RK_OWNER_GONE, "its owner has died");
  for (size_t i = 0; i < view->bytes; i += 4096) {
    touched = ((const volatile unsigned char*)map)[i];
  }
  (void)touched;
  return RK_ATTACHED;
}

/* A reader of one stream, before its first message. 0 if there is no such stream. */
static inline int rk_reader_of(const rk_view* view, uint32_t type_id, rk_reader* reader) {
  const rk_stream_entry* e = rk_find(&view->header, type_id);
  const unsigned char* base = (const unsigned char*)view->shared;
  memset(reader, 0, sizeof *reader);
  if (e == NULL) return 0;
  reader->counter = (const uint64_t*)(const void*)(base + e->cursor_offset);
  reader->slots = (const uint64_t*)(const void*)(base + e->ring_offset);
  reader->slot_stride = e->slot_stride;
  reader->slot_count = e->slot_count;
  reader->payload_bytes = e->payload_bytes;
  reader->period_ns = e->period_ns;
  return 1;
}

/* ---------------------------------------------------------------------------------------------
 * Owning a segment, 5.1, 5.2 and 5.6 */

typedef struct rk_stream_spec {
  uint32_t type_id;
  uint32_t payload_bytes; /* RK_TICK_BYTES, RK_FRAME_ROOM, ... */
  uint32_t slot_count;    /* a power of two, 4..65536 */
  uint64_t period_ns;     /* nominal; 0 = aperiodic */
} rk_stream_spec;

typedef struct rk_segment {
  rk_segment_header* header; /* in shared memory */
  size_t bytes;
  int descriptor; /* carries the owner lock */
  int role_lock;
  dev_t device;
  ino_t inode;
  uint64_t lapped, retries, rejected; /* by the readers of rk_report_last */
  char path[RK_PATH_BYTES];
  char why[RK_WHY_BYTES]; /* what rk_create did not like */
} rk_segment;

enum { RK_CREATED = 0, RK_EXIT_USAGE = 64, RK_EXIT_TEMPORARY = 75, RK_EXIT_CONFIG = 78 };

/* A clean end: `closed`, and the name goes if it is still ours. */
static inline void rk_close(rk_segment* own) {
  struct stat status;
  if (own->header != NULL) {
    __atomic_store_n(&own->header->state, (uint64_t)RK_CLOSED, __ATOMIC_RELEASE);
    if (lstat(own->path, &status) == 0 && status.st_dev == own->device &&
        status.st_ino == own->inode) {
      unlink(own->path);
    }
    munmap(own->header, own->bytes);
  }
  if (own->descriptor >= 0) close(own->descriptor);
  if (own->role_lock >= 0) close(own->role_lock);
  own->header = NULL;
  own->descriptor = own->role_lock = -1;
}

static inline int rk_create_failed(rk_segment* own, int status, const char* what, int error) {
  snprintf(own->why, sizeof own->why, "%s%s%s", what, error != 0 ? ": " : "",
           error != 0 ? strerror(error) : "");
  rk_close(own);
  return status;
}

/* $RUNTIME_DIRECTORY, or $XDG_RUNTIME_DIR/haptics, or /tmp/rikiseki-<uid>: as the daemons do. */
static inline void rk_runtime_directory(char path[RK_PATH_BYTES]) {
  const char* given = getenv("RUNTIME_DIRECTORY");
  const char* session = getenv("XDG_RUNTIME_DIR");
  if (given != NULL && *given != '\0') {
    snprintf(path, RK_PATH_BYTES, "%.*s", (int)strcspn(given, ":"), given);
  } else if (session != NULL && *session != '\0') {
    snprintf(path, RK_PATH_BYTES, "%s/haptics", session);
  } else {
    snprintf(path, RK_PATH_BYTES, "/tmp/rikiseki-%lu", (unsigned long)geteuid());
  }
}

/* 5.2 step 1. */
static inline int rk_take_role(rk_segment* own, const char* instance, uint32_t role) {
  char folder[RK_PATH_BYTES];
  char file[RK_PATH_BYTES + 128];
  struct stat status;
  struct flock lock = rk_lock_on_byte_0(F_WRLCK);
  rk_runtime_directory(folder);
  if (mkdir(folder, 0700) != 0 && errno != EEXIST) {
    return rk_create_failed(own, RK_EXIT_CONFIG, "cannot make the runtime directory", errno);
  }
  if (lstat(folder, &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != geteuid()) {
    return rk_create_failed(own, RK_EXIT_CONFIG, "the runtime directory is not this user's", 0);
  }
  snprintf(file, sizeof file, "%s/rikiseki.%s.%s.lock", folder, instance, rk_role_name(role));
  own->role_lock = open(file, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (own->role_lock < 0) return rk_create_failed(own, RK_EXIT_CONFIG, "the lock file", errno);
  lock.l_len = 0; /* all of it */
  if (fcntl(own->role_lock, F_OFD_SETLK, &lock) != 0) {
    return rk_create_failed(own, RK_EXIT_TEMPORARY, "another process has this role", 0);
  }
  return 0;
}

/* 5.2 step 2: puts a dead predecessor's object out of the way; its epoch comes back, 0 if none. */
static inline int rk_supersede(rk_segment* own, uint64_t* epoch) {
  struct stat status;
  void* map;
  int old;
  *epoch = 0;
  if (lstat(own->path, &status) != 0) return 0;
  if (!S_ISREG(status.st_mode) || status.st_uid != geteuid()) {
    return rk_create_failed(own, RK_EXIT_CONFIG, "the name is taken by another user", 0);
  }
  old = open(own->path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (old >= 0) {
    if (rk_owner_locked(old)) {
      close(old);
      return rk_create_failed(own, RK_EXIT_TEMPORARY, "the segment is in use: its owner lives", 0);
    }
    if (fstat(old, &status) == 0 && status.st_size >= (off_t)RK_HEADER_BYTES) {
      map = mmap(NULL, RK_HEADER_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, old, 0);
      if (map != MAP_FAILED) {
        rk_segment_header* header = (rk_segment_header*)map;
        if (header->magic == RK_MAGIC) {
          *epoch = header->epoch;
          __atomic_store_n(&header->state, (uint64_t)RK_SUPERSEDED, __ATOMIC_RELEASE);
        }
        munmap(map, RK_HEADER_BYTES);
      }
    }
    close(old);
  }
  unlink(own->path);
  return 0;
}

static inline uint16_t rk_type_version(uint32_t type_id) { /* 6 */
  if (type_id == RK_WORLD_FRAME) return 4;
  return type_id == RK_HAPTIC_HEALTH ? 3 : 1;
}

/* Fills the private directory; the size of the whole segment, 0 if the streams cannot be. */
static inline uint64_t rk_arrange(const rk_stream_spec* streams, uint32_t count,
                                  rk_stream_entry* entries) {
  uint64_t ring = RK_HEADER_BYTES + (uint64_t)RK_LINE_BYTES * count;
  if (count < 1 || count > RK_MAX_STREAMS) return 0;
  for (uint32_t i = 0; i < count; ++i) {
    const rk_stream_spec* s = &streams[i];
    rk_stream_entry* e = &entries[i];
    if (s->slot_count < RK_MIN_SLOTS || s->slot_count > RK_MAX_SLOTS ||
        (s->slot_count & (s->slot_count - 1)) != 0 || s->payload_bytes % 8 != 0 ||
        s->payload_bytes > RK_MAX_SEGMENT_BYTES) {
      return 0;
    }
    memset(e, 0, sizeof *e);
    e->type_id = s->type_id;
    e->type_version = rk_type_version(s->type_id);
    e->cursor_offset = RK_HEADER_BYTES + (uint64_t)RK_LINE_BYTES * i;
    e->ring_offset = ring;
    e->slot_stride = (s->payload_bytes + 32u + RK_LINE_BYTES - 1u) / RK_LINE_BYTES * RK_LINE_BYTES;
    e->slot_count = s->slot_count;
    e->payload_bytes = s->payload_bytes;
    e->period_ns = s->period_ns;
    ring += (uint64_t)e->slot_stride * e->slot_count;
  }
  ring = (ring + 4095) / 4096 * 4096;
  return ring <= RK_MAX_SEGMENT_BYTES ? ring : 0;
}

/* Makes the segment of `role` and says `ready`. Returns RK_CREATED, or the exit status that 5.2
 * asks for, with own->why; then there is nothing to close. */
static inline int rk_create(rk_segment* own, const char* instance, uint32_t role,
                            const rk_stream_spec* streams, uint32_t stream_count,
                            const char* build) {
  rk_stream_entry entries[RK_MAX_STREAMS];
  struct stat status;
  struct flock lock = rk_lock_on_byte_0(F_WRLCK);
  uint64_t old_epoch, now_ns;
  void* map;
  int error;
  memset(own, 0, sizeof *own);
  own->descriptor = own->role_lock = -1;
  own->bytes = (size_t)rk_arrange(streams, stream_count, entries);
  if (own->bytes == 0) return rk_create_failed(own, RK_EXIT_USAGE, "impossible streams", 0);
  if ((role != RK_HAPTIC && role != RK_WORLD) || !rk_object_path(own->path, instance, role)) {
    return rk_create_failed(own, RK_EXIT_USAGE, "no such role or instance name", 0);
  }
  error = rk_take_role(own, instance, role);
  if (error != 0) return error;
  error = rk_supersede(own, &old_epoch);
  if (error != 0) return error;

  own->descriptor = open(own->path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0640);
  if (own->descriptor < 0) {
    return rk_create_failed(own, RK_EXIT_TEMPORARY, "cannot make the segment", errno);
  }
  error = fchmod(own->descriptor, 0640) != 0 || fstat(own->descriptor, &status) != 0
              ? errno
              : posix_fallocate(own->descriptor, 0, (off_t)own->bytes);
  map = error != 0 ? MAP_FAILED
                   : mmap(NULL, own->bytes, PROT_READ | PROT_WRITE, MAP_SHARED, own->descriptor, 0);
  if (map == MAP_FAILED || fcntl(own->descriptor, F_OFD_SETLK, &lock) != 0) {
    if (map != MAP_FAILED) munmap(map, own->bytes);
    unlink(own->path);
    return rk_create_failed(own, RK_EXIT_TEMPORARY, "cannot allocate, map or lock the segment",
                            error != 0 ? error : errno);
  }
  own->device = status.st_dev;
  own->inode = status.st_ino;
  own->header = (rk_segment_header*)map;
  now_ns = rk_now_ns();
  own->header->magic = RK_MAGIC;
  own->header->byte_order = RK_BYTE_ORDER;
  own->header->version_major = RK_VERSION_MAJOR;
  own->header->version_minor = RK_VERSION_MINOR;
  own->header->layout_hash = RK_LAYOUT_HASH;
  own->header->header_bytes = RK_HEADER_BYTES;
  own->header->stream_count = stream_count;
  own->header->segment_bytes = own->bytes;
  own->header->epoch = old_epoch >= now_ns && old_epoch >> 63 == 0 ? old_epoch + 1 : now_ns;
  own->header->role = role;
  own->header->writer_pid = (uint32_t)getpid();
  snprintf(own->header->build, sizeof own->header->build, "%s", build);
  own->header->heartbeat_ns = now_ns;
  memcpy(own->header->stream, entries, stream_count * sizeof entries[0]);
  __atomic_store_n(&own->header->state, (uint64_t)RK_READY, __ATOMIC_RELEASE);
  return RK_CREATED;
}

/* The writer of one of the own streams. 0 if there is no such stream. */
static inline int rk_writer_of(const rk_segment* own, uint32_t type_id, rk_writer* writer) {
  const rk_stream_entry* e = rk_find(own->header, type_id);
  unsigned char* base = (unsigned char*)own->header;
  memset(writer, 0, sizeof *writer);
  if (e == NULL) return 0;
  writer->counter = (uint64_t*)(void*)(base + e->cursor_offset);
  writer->slots = (uint64_t*)(void*)(base + e->ring_offset);
  writer->slot_stride = e->slot_stride;
  writer->slot_count = e->slot_count;
  writer->payload_bytes = e->payload_bytes;
  return 1;
}

/* Each tick. */
static inline void rk_heartbeat(rk_segment* own, uint64_t tick, uint64_t now_ns) {
  __atomic_store_n(&own->header->tick, tick, __ATOMIC_RELAXED);
  __atomic_store_n(&own->header->heartbeat_ns, now_ns, __ATOMIC_RELAXED);
}

/* Publishes what a reader of the peer met, on top of those before it. The counters never decrease, so
 * give it to rk_report_last before it goes. */
static inline void rk_report(rk_segment* own, const rk_reader* r) {
  __atomic_store_n(&own->header->lapped, own->lapped + r->lost, __ATOMIC_RELAXED);
  __atomic_store_n(&own->header->read_retries, own->retries + r->retries, __ATOMIC_RELAXED);
  __atomic_store_n(&own->header->rejected, own->rejected + r->rejected, __ATOMIC_RELAXED);
}
static inline void rk_report_last(rk_segment* own, const rk_reader* r) {
  rk_report(own, r);
  own->lapped += r->lost;
  own->retries += r->retries;
  own->rejected += r->rejected;
}

#endif /* RIKISEKI_H */
