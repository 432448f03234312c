// SPDX-License-Identifier: MIT
/* A whole world side on rikiseki.h alone: the fixed box of SPEC.md section 10 at the origin, 20 Hz. An example
 * to start from, and a test: peer_test.cpp holds haptic_server in contact with it.
 *
 *   rikiseki_h_world [instance]         until SIGTERM */
#define _GNU_SOURCE /* rikiseki.h needs it before the first system header */

#include <signal.h>

#include "protocol/rikiseki.h"

static const double kHalfExtent = 0.03;               /* m */
static const uint64_t kPeriodNs = UINT64_C(50000000); /* 20 Hz */
static volatile sig_atomic_t stopping = 0;

static void stop(int number) {
  (void)number;
  stopping = 1;
}

static int same_channel(const rk_channel* a, const rk_channel* b) {
  return a->body == b->body && a->generation == b->generation && a->pointer == b->pointer &&
         a->opened_tick == b->opened_tick;
}

/* 7.4: takes differences of totals. Nothing here can move, so all of it is discarded, and declared. 0 if the
 * tick is an old one. */
static int consume(rk_frame* frame, const rk_tick* tick, const rk_tick* before, uint64_t epoch) {
  if (frame->head.acked_epoch == epoch && tick->head.tick <= before->head.tick) return 0;
  if (frame->head.acked_epoch != epoch) { /* a new haptic side: a baseline, nothing more */
    memset(frame->head.applied, 0, sizeof frame->head.applied);
    memset(frame->head.discarded, 0, sizeof frame->head.discarded);
    frame->head.acked_epoch = epoch;
    frame->head.acked_tick = frame->head.baseline_tick = tick->head.tick;
    return 1;
  }
  for (uint32_t i = 0; i < tick->head.channel_count; ++i) {
    const rk_channel* now = &tick->channel[i];
    int64_t base[3] = {0, 0, 0};
    if (now->opened_tick <= before->head.tick) memcpy(base, now->impulse, sizeof base);
    for (uint32_t j = 0; j < before->head.channel_count; ++j) {
      if (same_channel(now, &before->channel[j])) {
        memcpy(base, before->channel[j].impulse, sizeof base);
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      frame->head.discarded[axis] =
          rk_add(frame->head.discarded[axis], rk_sub(now->impulse[axis], base[axis]));
    }
  }
  frame->head.acked_tick = tick->head.tick;
  return 1;
}

/* The tangent plane at the box's nearest point, for each finger in reach. */
static void find_planes(rk_frame* frame, const rk_tick* tick) {
  frame->head.plane_count = 0;
  for (uint32_t i = 0; i < tick->head.pointer_count; ++i) {
    const rk_pointer* finger = &tick->pointer[i];
    rk_plane* plane = &frame->plane[frame->head.plane_count];
    double distance = 0;
    int deepest = 0;
    memset(plane, 0, sizeof *plane);
    for (int axis = 0; axis < 3; ++axis) {
      const double x = finger->position[axis];
      plane->point[axis] = fmin(fmax(x, -kHalfExtent), kHalfExtent);
      plane->normal[axis] = x - plane->point[axis];
      distance = hypot(distance, plane->normal[axis]);
      if (fabs(x) > fabs(finger->position[deepest])) deepest = axis;
    }
    if (distance < 1e-9) { /* inside: out through the nearest face */
      memset(plane->normal, 0, sizeof plane->normal);
      plane->normal[deepest] = finger->position[deepest] < 0 ? -1 : 1;
      plane->point[deepest] = plane->normal[deepest] * kHalfExtent;
    }
    rk_normalise(plane->normal, 3);
    if (distance > finger->radius + 0.03) continue;
    plane->pointer = finger->pointer;
    plane->generation = 1;
    frame->mobility[frame->head.plane_count].inverse_mass = 0; /* 6.2-13: it cannot move */
    ++frame->head.plane_count;
  }
}

/* The haptic side, as far as we know it. */
typedef struct peer {
  rk_view view;
  rk_reader reader;
  int attached;
  ino_t refused; /* talked nonsense: not before it changes (9.2-6) */
  rk_tick tick;  /* the newest */
} peer;

/* A world at 20 Hz may look for its peer in its own loop; a force loop may not (5.3-1). */
static void look_for(peer* haptic, const char* instance) {
  const rk_need need = {RK_HAPTIC_TICK, 1, 0};
  if (rk_attach(&haptic->view, instance, RK_HAPTIC, &need, 1) != RK_ATTACHED) return;
  if (haptic->view.inode == haptic->refused) {
    rk_detach(&haptic->view);
  } else {
    haptic->attached = rk_reader_of(&haptic->view, RK_HAPTIC_TICK, &haptic->reader);
  }
}

/* Every tick that was published and not read yet. 0 if the peer breaks the protocol. */
static int drain(peer* haptic, rk_frame* frame) {
  uint64_t words[RK_TICK_BYTES / 8];
  rk_received received;
  rk_tick tick;
  while (!rk_hopeless(&haptic->reader)) {
    const enum rk_read_status read = rk_read_next(&haptic->reader, words, sizeof words, &received);
    if (read == RK_BACKWARDS) return 0;
    if (read != RK_FRESH && read != RK_REJECTED) return 1;
    if (rk_jumped(&haptic->reader, rk_now_ns())) return 0;
    if (read == RK_FRESH &&
        rk_accept(&haptic->reader, &received, rk_decode_tick(words, sizeof words, &received, &tick),
                  rk_now_ns()) == RK_SOUND &&
        consume(frame, &tick, &haptic->tick, haptic->view.header.epoch)) {
      haptic->tick = tick;
    }
  }
  return 0;
}

int main(int argc, char** argv) {
  static peer haptic;
  static rk_frame frame;
  const char* instance = argc > 1 ? argv[1] : "0";
  const rk_stream_spec stream = {RK_WORLD_FRAME, RK_FRAME_ROOM, 8, kPeriodNs};
  const struct timespec period = {0, (long)kPeriodNs};
  uint64_t words[RK_FRAME_BYTES / 8];
  rk_segment own;
  rk_writer writer;
  rk_received shape;
  const int status = rk_create(&own, instance, RK_WORLD, &stream, 1, "rikiseki_h_world");
  if (status != RK_CREATED || !rk_writer_of(&own, RK_WORLD_FRAME, &writer)) {
    fprintf(stderr, "rikiseki_h_world: %s\n", own.why);
    return status;
  }
  signal(SIGTERM, stop);
  signal(SIGINT, stop);
  rk_frame_init(&frame);
  frame.head.period_ns = kPeriodNs;
  frame.head.coupling = RK_BY_IMPULSE;
  while (!stopping) {
    /* First whether it ended, then its last messages: so none is left unread (5.3-5). */
    int over = haptic.attached && (rk_state(&haptic.view) == RK_CLOSED ||
                                   !rk_owner_alive(&haptic.view) || rk_replaced(&haptic.view));
    if (!haptic.attached) look_for(&haptic, instance);
    if (haptic.attached && !drain(&haptic, &frame)) {
      haptic.refused = haptic.view.inode;
      over = 1;
    }
    if (over) haptic.tick.head.pointer_count = 0;
    ++frame.head.frame;
    frame.head.world_time_ns += kPeriodNs;
    find_planes(&frame, &haptic.tick);
    if (rk_encode_frame(&frame, words, &shape)) rk_publish(&writer, words, &shape, rk_now_ns());
    rk_heartbeat(&own, frame.head.frame, rk_now_ns());
    if (haptic.attached) rk_report(&own, &haptic.reader);
    if (over) {
      rk_report_last(&own, &haptic.reader);
      rk_detach(&haptic.view);
      haptic.attached = 0;
    }
    nanosleep(&period, NULL);
  }
  rk_close(&own);
  return 0;
}
