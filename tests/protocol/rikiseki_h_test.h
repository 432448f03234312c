// SPDX-License-Identifier: MIT
/* What rikiseki_h_test.c offers to the C++ half of the test. */
#pragma once

#include "protocol/rikiseki.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The text that layout.golden.txt should be. */
size_t rk_test_layout(char* text, size_t room);

/* Decodes a tick or frame of `bytes` private bytes and encodes it again; 0 if it is rejected. */
int rk_test_recode(uint32_t type, const uint64_t* words, size_t bytes, uint32_t used,
                   uint32_t blocks, uint64_t* again, uint32_t* again_used, uint32_t* again_blocks);

/* A reader of a segment and its ticks. Returns enum rk_attach_status. */
struct rk_test_view;
int rk_test_attach(const char* instance, uint32_t role, struct rk_test_view** view, char why[256]);
uint64_t rk_test_epoch(const struct rk_test_view* view);
uint64_t rk_test_state(const struct rk_test_view* view);
uint64_t rk_test_heartbeat(const struct rk_test_view* view);
int rk_test_alive(const struct rk_test_view* view);
int rk_test_replaced(const struct rk_test_view* view);
uint64_t rk_test_lost(const struct rk_test_view* view);
/* Returns enum rk_read_status. */
int rk_test_read(struct rk_test_view* view, int next, uint64_t* words, size_t bytes,
                 uint64_t* number, uint64_t* stamp_ns, uint32_t* used, uint32_t* blocks);
void rk_test_detach(struct rk_test_view* view);

/* A haptic segment with 16 ticks. Returns an exit status, 0 if it was made. */
struct rk_test_segment;
int rk_test_create(const char* instance, struct rk_test_segment** own, char why[256]);
int rk_test_publish(struct rk_test_segment* own, const uint64_t* words, uint32_t used,
                    uint32_t blocks, uint64_t stamp_ns);
uint64_t rk_test_own_state(const struct rk_test_segment* own);
void rk_test_close(struct rk_test_segment* own);
/* Drops the locks and leaves everything else as it is, as a SIGKILL does. */
void rk_test_die(struct rk_test_segment* own);

#ifdef __cplusplus
}
#endif
