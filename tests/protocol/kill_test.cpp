// SPDX-License-Identifier: MIT
// Processes that die: what a reader sees when a full-speed writer is killed at any instant.
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <random>

#include "protocol/attach.h"
#include "protocol/peer_link.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::Eventually;
using test::FreshInstance;
using test::HapticOptions;
using test::TemporaryFolder;

AttachRequest Asking(const std::string& instance) {
  AttachRequest request;
  request.instance = instance;
  request.role = Role::kHaptic;
  return request;
}

pid_t StartWriter(const std::string& instance, const std::string& folder) {
  return test::Fork([&] {
    SegmentOwner owner(HapticOptions(instance, folder));
    auto writer = owner.Writer<HapticTick>();
    for (std::uint64_t n = 1;; ++n) {
      writer.Publish(test::Numbered(n), n);
      owner.Heartbeat(n, n);
    }
  });
}

TEST_CASE("a writer killed at a random instant leaves nothing torn, and its newest message whole") {
  const bool full = std::getenv("RIKISEKI_FULL") != nullptr;
  const int kills = full ? 2000 : 100;
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  std::mt19937 random(5);
  PeerLinkOptions options;
  options.peer = Asking(instance);
  options.poll_ms = 2;
  PeerLink link(options);
  std::uint64_t epoch = 0;
  std::uint64_t messages = 0;
  for (int i = 0; i < kills; ++i) {
    const pid_t child = StartWriter(instance, folder.path());
    REQUIRE(Eventually([&] { return link.HasNext(); }));
    PeerView& view = *link.TakeNext();
    REQUIRE(view.epoch() > epoch);
    epoch = view.epoch();
    auto latest = view.Reader<HapticTick>();
    auto next = view.Reader<HapticTick>();
    HapticTick tick;
    bool sound = true;
    const auto read = [&] {
      for (auto* reader : {&latest, &next}) {
        const ReadStatus status =
            reader == &latest ? reader->ReadLatest(tick) : reader->ReadNext(tick);
        if (status == ReadStatus::kFresh) {
          ++messages;
          sound = sound && test::IsNumbered(tick);
        }
        sound = sound && status != ReadStatus::kRejected && status != ReadStatus::kBackwards;
      }
    };
    // A writer may die before its first message: here it has one.
    const std::uint64_t before = messages;
    REQUIRE(Eventually([&] {
      read();
      return messages > before;
    }));
    const unsigned spins = std::uniform_int_distribution<unsigned>(0, 2000)(random);
    for (unsigned spin = 0; spin < spins; ++spin) read();
    kill(child, SIGKILL);
    REQUIRE(WIFSIGNALED(test::Reap(child)));
    // The dead segment: frozen, whole, and known to be dead.
    CHECK_FALSE(view.OwnerAlive());
    auto after = view.Reader<HapticTick>();
    REQUIRE(after.ReadLatest(tick) == ReadStatus::kFresh);
    CHECK(test::IsNumbered(tick));
    const std::uint64_t newest = after.received().number;
    CHECK(after.ReadLatest(tick) == ReadStatus::kSame);
    auto draining = view.Reader<HapticTick>();
    ReadStatus status = draining.ReadNext(tick);
    for (; status == ReadStatus::kFresh; status = draining.ReadNext(tick)) {
      sound = sound && test::IsNumbered(tick);
    }
    CHECK(status == ReadStatus::kEmpty);
    CHECK(draining.received().number == newest);
    CHECK(sound);
    REQUIRE(Eventually([&] { return view.gone(); }));
  }
  CHECK(messages > static_cast<std::uint64_t>(kills));
  RemoveObject(SegmentName(instance, Role::kHaptic));
}

TEST_CASE("an unreaped child is dead, whatever its pid says") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const pid_t child = StartWriter(instance, folder.path());
  AttachResult result;
  REQUIRE(Eventually([&] {
    result = Attach(Asking(instance));
    return result.view != nullptr;
  }));
  kill(child, SIGKILL);
  siginfo_t info{};
  REQUIRE(waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT) == 0);
  CHECK(kill(child, 0) == 0);  // a zombie
  CHECK_FALSE(result.view->OwnerAlive());
  {
    SegmentOwner successor(HapticOptions(instance, folder.path()));
    CHECK(successor.epoch() > result.view->epoch());
    CHECK(result.view->State() == SegmentState::kSuperseded);
  }
  test::Reap(child);
}

TEST_CASE("a stopped owner is not a dead one") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const pid_t child = StartWriter(instance, folder.path());
  AttachResult result;
  REQUIRE(Eventually([&] {
    result = Attach(Asking(instance));
    return result.view != nullptr;
  }));
  kill(child, SIGSTOP);
  int status = 0;
  REQUIRE(waitpid(child, &status, WUNTRACED) == child);
  CHECK(result.view->OwnerAlive());
  const std::uint64_t heartbeat = result.view->HeartbeatNs();
  usleep(20'000);
  CHECK(result.view->HeartbeatNs() == heartbeat);  // only its age tells
  kill(child, SIGCONT);
  CHECK(Eventually([&] { return result.view->HeartbeatNs() != heartbeat; }));
  kill(child, SIGKILL);
  test::Reap(child);
  RemoveObject(SegmentName(instance, Role::kHaptic));
}

}  // namespace
}  // namespace rikiseki::protocol
