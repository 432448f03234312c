// SPDX-License-Identifier: MIT
// The kernel itself keeps each side from writing to the other's segment: shown between two users
// who share a group, as the two daemons are installed (SPEC.md 5.1), and from a third user outside
// the group.
#include <fcntl.h>
#include <grp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <vector>

#include "protocol/attach.h"
#include "tests/process/child.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::Role;

// Nobody is called so: users need no entry in /etc/passwd.
constexpr uid_t kOwner = 64001;
constexpr uid_t kPeer = 64002;
constexpr uid_t kOutsider = 64003;
constexpr gid_t kGroup = 64000;
constexpr gid_t kOtherGroup = 64009;

bool MayBecomeOthers() {
  if (geteuid() == 0) return true;
  WARN("not root: the tests between users are skipped");
  return false;
}

// Runs `body` as another user in a child process; its wait status. `body` returns the exit status.
int As(uid_t user, gid_t group, const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    if (setgroups(0, nullptr) != 0 || setgid(group) != 0 || setuid(user) != 0) _exit(120);
    int status = 121;
    try {
      status = body();
    } catch (...) {
    }
    _exit(status);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

// The exit status of `body` as that user; minus the signal that ended it.
int ExitAs(uid_t user, gid_t group, const std::function<int()>& body) {
  const int status = As(user, group, body);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

// A world segment that lives in a process of user kOwner.
class ForeignSegment {
 public:
  explicit ForeignSegment(const std::string& instance)
      : path_("/dev/shm" + protocol::SegmentName(instance, Role::kWorld)) {
    std::string folder = (std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX").string();
    REQUIRE(mkdtemp(folder.data()) != nullptr);
    folder_ = folder;
    REQUIRE(chown(folder.c_str(), kOwner, kGroup) == 0);
    int ready[2];
    REQUIRE(pipe2(ready, O_CLOEXEC) == 0);
    REQUIRE(pipe2(end_, O_CLOEXEC) == 0);
    child_ = fork();
    if (child_ == 0) {
      close(end_[1]);
      if (setgroups(0, nullptr) != 0 || setgid(kGroup) != 0 || setuid(kOwner) != 0) _exit(120);
      try {
        protocol::SegmentOwner owner({.instance = instance,
                                      .role = Role::kWorld,
                                      .streams = protocol::WorldStreams(50'000'000, 4, 50'000'000),
                                      .build = "permission test",
                                      .runtime_directory = folder_});
        protocol::WorldFrame frame;
        frame.frame = 7;
        frame.period_ns = 50'000'000;
        owner.Writer<protocol::WorldFrame>().Publish(frame, 1);
        char byte = 1;
        if (write(ready[1], &byte, 1) != 1) _exit(1);
        while (read(end_[0], &byte, 1) < 0 && errno == EINTR) {
        }
      } catch (...) {
        _exit(121);
      }
      _exit(0);
    }
    close(ready[1]);
    close(end_[0]);
    char byte = 0;
    const bool made = read(ready[0], &byte, 1) == 1;
    close(ready[0]);
    REQUIRE(made);
  }
  ~ForeignSegment() {
    close(end_[1]);
    int status = 0;
    waitpid(child_, &status, 0);
    std::filesystem::remove_all(folder_);
  }
  ForeignSegment(const ForeignSegment&) = delete;
  ForeignSegment& operator=(const ForeignSegment&) = delete;

  const char* path() const { return path_.c_str(); }

 private:
  std::string path_;
  std::string folder_;
  pid_t child_ = 0;
  int end_[2] = {};
};

// errno of `call` (which fails with -1), or 0.
template <typename Call>
int ErrorOf(Call call) {
  errno = 0;
  return call() == -1 ? errno : 0;
}

int MapError(int descriptor, int protection) {
  void* const map = mmap(nullptr, 4096, protection, MAP_SHARED, descriptor, 0);
  return map == MAP_FAILED ? errno : 0;
}

}  // namespace

TEST_CASE("a peer of the same group reads a segment and cannot write to it by any way") {
  if (!MayBecomeOthers()) return;
  const Instance instance;
  const ForeignSegment segment(instance);
  struct stat status {};
  REQUIRE(stat(segment.path(), &status) == 0);
  CHECK(status.st_uid == kOwner);
  CHECK(status.st_gid == kGroup);
  CHECK((status.st_mode & 07777) == 0640);

  const char* const path = segment.path();
  const auto as_peer = [](const std::function<int()>& body) { return ExitAs(kPeer, kGroup, body); };
  CHECK(as_peer([&] { return ErrorOf([&] { return open(path, O_RDWR); }); }) == EACCES);
  CHECK(as_peer([&] { return ErrorOf([&] { return open(path, O_WRONLY); }); }) == EACCES);
  CHECK(as_peer([&] { return ErrorOf([&] { return truncate(path, 0); }); }) == EACCES);
  CHECK(as_peer([&] { return ErrorOf([&] { return chmod(path, 0666); }); }) == EPERM);
  CHECK(as_peer([&] { return ErrorOf([&] { return unlink(path); }); }) == EPERM);  // the sticky bit
  // Another way to the same pages: through the descriptor that may read.
  CHECK(as_peer([&] {
          const int descriptor = open(path, O_RDONLY);
          if (descriptor < 0 || MapError(descriptor, PROT_READ) != 0) return 1;
          if (MapError(descriptor, PROT_READ | PROT_WRITE) != EACCES) return 2;
          if (ErrorOf([&] { return ftruncate(descriptor, 0); }) != EINVAL) return 3;
          void* const map = mmap(nullptr, 4096, PROT_READ, MAP_SHARED, descriptor, 0);
          if (ErrorOf([&] { return mprotect(map, 4096, PROT_READ | PROT_WRITE); }) != EACCES)
            return 4;
          const std::string self = "/proc/self/fd/" + std::to_string(descriptor);
          if (ErrorOf([&] { return open(self.c_str(), O_RDWR); }) != EACCES) return 5;
          return 0;
        }) == 0);
}

TEST_CASE("a store or an exchange through a peer's map faults, a load does not") {
  if (!MayBecomeOthers()) return;
  const Instance instance;
  const ForeignSegment segment(instance);
  enum class Touch { kLoad, kStore, kExchange };
  const auto touch = [&](Touch how) {
    return ExitAs(kPeer, kGroup, [&] {
      const int descriptor = open(segment.path(), O_RDONLY);
      auto* const words =
          static_cast<std::uint64_t*>(mmap(nullptr, 4096, PROT_READ, MAP_SHARED, descriptor, 0));
      signal(SIGSEGV, SIG_DFL);  // not Catch's handler
      std::atomic_ref<std::uint64_t> word(words[0]);
      std::uint64_t expected = protocol::kMagic;
      switch (how) {
        case Touch::kLoad:
          return word.load() == protocol::kMagic ? 0 : 1;
        case Touch::kStore:
          word.store(protocol::kMagic);
          return 2;
        case Touch::kExchange:
          word.compare_exchange_strong(expected, expected);
          return 3;
      }
      return 4;
    });
  };
  CHECK(touch(Touch::kLoad) == 0);
  CHECK(touch(Touch::kStore) == -SIGSEGV);
  CHECK(touch(Touch::kExchange) == -SIGSEGV);
}

TEST_CASE("a user outside the group cannot even read") {
  if (!MayBecomeOthers()) return;
  const Instance instance;
  const ForeignSegment segment(instance);
  CHECK(ExitAs(kOutsider, kOtherGroup,
               [&] { return ErrorOf([&] { return open(segment.path(), O_RDONLY); }); }) == EACCES);
  CHECK(ExitAs(kOutsider, kOtherGroup, [&] {
          const protocol::AttachResult result = protocol::Attach(
              {.instance = instance, .role = Role::kWorld, .required = {}, .owners = {kOwner}});
          const bool says_so = result.text.find("may not be read") != std::string::npos &&
                               result.text.find("group haptics") != std::string::npos;
          return result.status == protocol::AttachStatus::kForbidden && says_so ? 0 : 1;
        }) == 0);
}

TEST_CASE("who attaches says whose segments it believes") {
  if (!MayBecomeOthers()) return;
  const Instance instance;
  const ForeignSegment segment(instance);
  const auto attach_as_peer = [&](const std::vector<uid_t>& owners, protocol::AttachStatus expected,
                                  const std::string& sentence) {
    return ExitAs(kPeer, kGroup, [&] {
      const protocol::AttachResult result = protocol::Attach(
          {.instance = instance, .role = Role::kWorld, .required = {}, .owners = owners});
      if (result.status != expected) return 1;
      if (result.text.find(sentence) == std::string::npos) return 2;
      if (result.view == nullptr) return 0;
      protocol::WorldFrame frame;
      auto reader = result.view->Reader<protocol::WorldFrame>();
      return reader.ReadLatest(frame) == protocol::ReadStatus::kFresh && frame.frame == 7 ? 0 : 3;
    });
  };
  CHECK(attach_as_peer({kOwner}, protocol::AttachStatus::kAttached, "attached") == 0);
  const std::string refusal =
      "its owner, user " + std::to_string(kOwner) + ", may not own a segment";
  CHECK(attach_as_peer({kPeer}, protocol::AttachStatus::kForbidden, refusal) == 0);
  CHECK(attach_as_peer({}, protocol::AttachStatus::kForbidden, refusal) == 0);  // the default
  // Root may read everything, and still believes only whom it is told to.
  const protocol::AttachResult as_root =
      protocol::Attach({.instance = instance, .role = Role::kWorld, .required = {}, .owners = {}});
  CHECK(as_root.status == protocol::AttachStatus::kForbidden);
  CHECK_THAT(as_root.text, Contains(refusal));
}

TEST_CASE("a name that belongs to another user is not taken over: exit 78 and a sentence") {
  if (!MayBecomeOthers()) return;
  const Instance instance;
  const ForeignSegment segment(instance);
  struct stat before {};
  REQUIRE(stat(segment.path(), &before) == 0);
  Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
               "--instance", instance});
  CHECK(world.Wait() == 78);
  CHECK_THAT(world.Stderr(), Contains(segment.path()) &&
                                 Contains("belongs to user " + std::to_string(kOwner)) &&
                                 Contains("choose another --instance"));
  struct stat after {};
  REQUIRE(stat(segment.path(), &after) == 0);  // it is still there, and the same
  CHECK(after.st_ino == before.st_ino);
  CHECK(after.st_size == before.st_size);
}
