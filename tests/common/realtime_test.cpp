// SPDX-License-Identifier: MIT
#include "common/realtime.h"

#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>

namespace rikiseki {
namespace {

// What the kernel says of the calling thread.
struct Kernel {
  int policy = -1;
  int priority = -1;
  bool reset_on_fork = false;
  int cpu_count = 0;
  int first_cpu = -1;
};

Kernel AskKernel() {
  Kernel kernel;
  const int policy = sched_getscheduler(0);
  kernel.policy = policy & ~SCHED_RESET_ON_FORK;
  kernel.reset_on_fork = (policy & SCHED_RESET_ON_FORK) != 0;
  sched_param parameters{};
  sched_getparam(0, &parameters);
  kernel.priority = parameters.sched_priority;
  cpu_set_t cpus;
  sched_getaffinity(0, sizeof cpus, &cpus);
  kernel.cpu_count = CPU_COUNT(&cpus);
  for (int cpu = CPU_SETSIZE - 1; cpu >= 0; --cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &cpus)) kernel.first_cpu = cpu;
  }
  return kernel;
}

struct Run {
  RealtimeObtained obtained;
  Kernel kernel;
};

Run Start(const RealtimeRequest& request) {
  Run run;
  RealtimeThread thread(request, [&] { run.kernel = AskKernel(); });
  thread.Join();
  run.obtained = thread.obtained();
  return run;
}

}  // namespace

TEST_CASE("without a request the thread stays with the ordinary scheduler") {
  const Run run = Start({});
  CHECK(run.kernel.policy == SCHED_OTHER);
  CHECK(run.obtained.policy == SCHED_OTHER);
  CHECK(run.obtained.priority == 0);
  CHECK(run.obtained.cpu == -1);
  CHECK(run.obtained.refusal.empty());
}

TEST_CASE("what is reported as obtained is what the kernel says, permitted or not") {
  const Run run = Start({.fifo_priority = 7});
  CHECK(run.obtained.policy == run.kernel.policy);
  CHECK(run.obtained.priority == run.kernel.priority);
  if (run.kernel.policy == SCHED_FIFO) {
    CHECK(run.kernel.priority == 7);
    CHECK(run.kernel.reset_on_fork);
    CHECK(run.obtained.refusal.empty());
    CHECK(PolicyName(run.obtained.policy, run.obtained.priority) == "SCHED_FIFO 7");
  } else {
    CHECK(run.obtained.refusal.starts_with("SCHED_FIFO 7: "));
  }
}

TEST_CASE("an impossible priority is refused in words and the thread runs all the same") {
  const Run run = Start({.fifo_priority = 100});
  CHECK(run.kernel.policy == SCHED_OTHER);
  CHECK(run.obtained.policy == SCHED_OTHER);
  CHECK(run.obtained.refusal.starts_with("SCHED_FIFO 100: "));
}

TEST_CASE("a thread is pinned to the CPU that is asked for") {
  const int cpu = AskKernel().first_cpu;
  const Run run = Start({.cpu = cpu});
  CHECK(run.kernel.cpu_count == 1);
  CHECK(run.kernel.first_cpu == cpu);
  CHECK(run.obtained.cpu == cpu);
  CHECK(run.obtained.refusal.empty());
}

TEST_CASE("a CPU that is not there is refused in words") {
  const Run run = Start({.cpu = CPU_SETSIZE - 1});
  CHECK(run.kernel.cpu_count == AskKernel().cpu_count);
  CHECK(run.obtained.cpu == -1);
  CHECK(run.obtained.refusal.starts_with("cpu 1023: "));
}

TEST_CASE("the stack that was asked for is there, and touched without harm when small") {
  for (const std::size_t bytes : {std::size_t{64} * 1024, std::size_t{4} * 1024 * 1024}) {
    std::atomic<bool> ran = false;
    RealtimeThread thread({.stack_bytes = bytes}, [&] {
      volatile char deep[48 * 1024];
      deep[0] = 1;
      ran = deep[0] == 1;
    });
    thread.Join();
    thread.Join();  // a second one does nothing
    CHECK(ran);
  }
}

TEST_CASE("the destructor joins") {
  bool ended = false;
  {
    const RealtimeThread thread({}, [&] {
      usleep(2000);
      ended = true;
    });
  }
  CHECK(ended);
}

TEST_CASE("a thread can ask what it runs under") {
  const Kernel kernel = AskKernel();
  const RealtimeObtained now = ReadScheduling();
  CHECK(now.policy == kernel.policy);
  CHECK(now.priority == kernel.priority);
  CHECK(now.refusal.empty());
}

TEST_CASE("policies have names") {
  CHECK(PolicyName(SCHED_OTHER, 0) == "SCHED_OTHER");
  CHECK(PolicyName(SCHED_FIFO, 80) == "SCHED_FIFO 80");
  CHECK(PolicyName(SCHED_RR, 3) == "SCHED_RR 3");
  CHECK(PolicyName(SCHED_BATCH, 0) == "policy 3");
}

}  // namespace rikiseki
