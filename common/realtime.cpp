// SPDX-License-Identifier: MIT
#include "common/realtime.h"

#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <future>
#include <system_error>

namespace rikiseki {
namespace {

struct Start {
  RealtimeRequest request;
  std::function<void()> body;
  std::promise<RealtimeObtained> obtained;
};

// Touches the part of the stack that the loop will use, so that its first deep call faults nothing in.
// RT: runs before the loop.
__attribute__((noinline)) void TouchStack(std::size_t bytes) {
  constexpr std::size_t kChunk = 16 * 1024;
  std::array<volatile char, kChunk> chunk;
  for (std::size_t i = 0; i < kChunk; i += 1024) chunk[i] = 0;
  if (bytes > 2 * kChunk) TouchStack(bytes - kChunk);
  chunk[0] = 0;  // after the call: no tail recursion, the frames must stay side by side
}

RealtimeObtained Apply(const RealtimeRequest& request) {
  RealtimeObtained obtained;
  if (request.cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(request.cpu), &cpus);
    if (const int error = pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus); error != 0) {
      obtained.refusal = "cpu " + std::to_string(request.cpu) + ": " + std::strerror(error);
    } else {
      obtained.cpu = request.cpu;
    }
  }
  if (request.fifo_priority > 0) {
    sched_param parameters{};
    parameters.sched_priority = request.fifo_priority;
    // Reset on fork: a child never inherits the right to starve the machine.
    if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) != 0) {
      obtained.refusal += (obtained.refusal.empty() ? "" : "; ") + std::string("SCHED_FIFO ") +
                          std::to_string(request.fifo_priority) + ": " + std::strerror(errno) +
                          " (needs RLIMIT_RTPRIO, see README)";
    }
  }
  const RealtimeObtained now = ReadScheduling();
  obtained.policy = now.policy;
  obtained.priority = now.priority;
  return obtained;
}

void* Run(void* argument) {
  std::unique_ptr<Start> start(static_cast<Start*>(argument));
  TouchStack(start->request.stack_bytes / 2);
  start->obtained.set_value(Apply(start->request));
  start->body();
  return nullptr;
}

}  // namespace

RealtimeObtained ReadScheduling() {
  sched_param actual{};
  sched_getparam(0, &actual);
  return {.policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK,
          .priority = actual.sched_priority,
          .cpu = -1,
          .refusal = ""};
}

std::string LockMemory() {
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return "";
  return std::string("mlockall: ") + std::strerror(errno) + " (needs RLIMIT_MEMLOCK, see README)";
}

std::string PolicyName(int policy, int priority) {
  switch (policy) {
    case SCHED_FIFO:
      return "SCHED_FIFO " + std::to_string(priority);
    case SCHED_RR:
      return "SCHED_RR " + std::to_string(priority);
    case SCHED_OTHER:
      return "SCHED_OTHER";
    default:
      return "policy " + std::to_string(policy);
  }
}

RealtimeThread::RealtimeThread(const RealtimeRequest& request, std::function<void()> body) {
  auto start = std::make_unique<Start>(Start{request, std::move(body), {}});
  std::future<RealtimeObtained> obtained = start->obtained.get_future();
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, request.stack_bytes);
  const int error = pthread_create(&thread_, &attributes, Run, start.get());
  pthread_attr_destroy(&attributes);
  if (error != 0) throw std::system_error(error, std::generic_category(), "pthread_create");
  (void)start.release();  // the thread owns it now
  obtained_ = obtained.get();
}

RealtimeThread::~RealtimeThread() {
  Join();
}

void RealtimeThread::Join() {
  if (joined_) return;
  pthread_join(thread_, nullptr);
  joined_ = true;
}

}  // namespace rikiseki
