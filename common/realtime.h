// SPDX-License-Identifier: MIT
// A thread for a loop with deadlines: SCHED_FIFO and locked memory where the machine permits, and the
// truth about it where not (notes of README, "Real time").
#pragma once

#include <pthread.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace rikiseki {

struct RealtimeRequest {
  int fifo_priority = 0;                 // 1..99; 0 = stay with the ordinary scheduler
  int cpu = -1;                          // pin to this one; -1 = leave it to the scheduler
  std::size_t stack_bytes = 512 * 1024;  // locked and touched before the loop starts
};

/// What the scheduler gave, read back from the running thread.
struct RealtimeObtained {
  int policy = 0;  // SCHED_*
  int priority = 0;
  int cpu = -1;
  std::string refusal;  // empty, or why less was obtained than requested, in words
};

/// What the calling thread runs under.
RealtimeObtained ReadScheduling();

/// Locks present and future memory and stops the allocator from giving pages back, so that the loop
/// meets no page fault. Returns an empty string, or why it was refused, in words.
std::string LockMemory();

/// "SCHED_FIFO 80", "SCHED_OTHER", ...
std::string PolicyName(int policy, int priority);

/// A joinable thread that starts with the wanted policy, or without it if that is refused.
class RealtimeThread {
 public:
  /// Starts `body` and returns when it runs. Throws std::system_error if no thread can be had at all.
  RealtimeThread(const RealtimeRequest& request, std::function<void()> body);
  ~RealtimeThread();  // joins
  RealtimeThread(const RealtimeThread&) = delete;
  RealtimeThread& operator=(const RealtimeThread&) = delete;

  const RealtimeObtained& obtained() const { return obtained_; }
  void Join();

 private:
  pthread_t thread_{};
  bool joined_ = false;
  RealtimeObtained obtained_;
};

}  // namespace rikiseki
