// SPDX-License-Identifier: MIT
// The daemons under a service manager, played by the test: it reads what they send to $NOTIFY_SOCKET, and
// reloads them by SIGHUP.
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>
#include <thread>

#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::Role;

// A service manager that listens. Children that start while it lives report to it.
class Manager {
 public:
  Manager() {
    std::string folder = (std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX").string();
    REQUIRE(mkdtemp(folder.data()) != nullptr);
    folder_ = folder;
    const std::string path = folder_ + "/notify";
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    REQUIRE(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    const timeval patience{.tv_sec = 0, .tv_usec = 50'000};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", "400000", 1);  // fed four times as often
    unsetenv("WATCHDOG_PID");
    thread_ = std::thread([this] { Listen(); });
  }
  ~Manager() {
    stop_ = true;
    thread_.join();
    close(socket_);
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    std::filesystem::remove_all(folder_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  const std::string& folder() const { return folder_; }

  /// How often a message that contains this has come.
  int Count(const std::string& message) const {
    const std::lock_guard lock(mutex_);
    int count = 0;
    for (const std::string& known : messages_) count += known.find(message) != std::string::npos;
    return count;
  }
  bool Hears(const std::string& message, int more_than = 0) const {
    return Eventually([&] { return Count(message) > more_than; }, 20);
  }

 private:
  void Listen() {
    char buffer[4096];
    while (!stop_) {
      const ssize_t got = recv(socket_, buffer, sizeof buffer, 0);
      if (got <= 0) continue;
      const std::lock_guard lock(mutex_);
      messages_.emplace_back(buffer, static_cast<std::size_t>(got));
    }
  }

  std::string folder_;
  int socket_ = -1;
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Settings that the test edits.
class Settings {
 public:
  explicit Settings(const std::string& folder) : path_(folder + "/server.ini") {}
  void Write(const std::string& text) const { std::ofstream(path_) << text; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string HapticText(const std::string& stiffness) {
  return "[render]\nstiffness_n_per_m = " + stiffness +
         "\n[device]\nfile = " + SourceFile("config/devices/simulated.ini") +
         "\n[hand]\nscript = rest\n";
}

protocol::HapticTick NewestTick(const protocol::PeerView& view) {
  auto reader = view.Reader<protocol::HapticTick>();
  protocol::HapticTick tick;
  REQUIRE(Eventually(
      [&] { return reader.ReadLatest(tick, view.HeartbeatNs()) == protocol::ReadStatus::kFresh; }));
  return tick;
}

// Stops one thread of a process alone, as a loop that hangs in its device stands still.
class FrozenThread {
 public:
  explicit FrozenThread(pid_t thread) : thread_(thread) {
    held_ = ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) == 0 &&
            ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 &&
            waitpid(thread, nullptr, __WALL) == thread;
  }
  ~FrozenThread() {
    if (held_) ptrace(PTRACE_DETACH, thread_, nullptr, nullptr);
  }
  FrozenThread(const FrozenThread&) = delete;
  FrozenThread& operator=(const FrozenThread&) = delete;
  bool held() const { return held_; }

 private:
  pid_t thread_;
  bool held_ = false;
};

std::vector<pid_t> ThreadsOf(pid_t process) {
  std::vector<pid_t> threads;
  for (const auto& entry :
       std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    threads.push_back(static_cast<pid_t>(std::stol(entry.path().filename())));
  }
  return threads;
}

std::vector<std::string> HapticCommand(const Settings& settings, const std::string& instance) {
  return {Program("haptic_server"), "--config", settings.path(), "--instance", instance};
}

}  // namespace

TEST_CASE("haptic_server says that it is ready, how it is, and that it stops") {
  const Instance instance;
  const Manager manager;
  const Settings settings(manager.folder());
  settings.Write(HapticText("2000"));
  Child haptic(HapticCommand(settings, instance));
  REQUIRE(manager.Hears("READY=1"));
  CHECK(manager.Hears("STATUS=1000 Hz on "));
  CHECK(manager.Hears("No world is attached"));
  CHECK(manager.Hears("WATCHDOG=1", manager.Count("WATCHDOG=1") + 2));
  haptic.Signal(SIGTERM);
  CHECK(haptic.Wait() == 0);
  CHECK(manager.Hears("STOPPING=1"));
}

TEST_CASE("a loop that hangs is not fed for, though its supervisor lives") {
  const Instance instance;
  const Manager manager;
  const Settings settings(manager.folder());
  settings.Write(HapticText("2000"));
  Child haptic(HapticCommand(settings, instance));
  REQUIRE(manager.Hears("WATCHDOG=1"));
  const auto view = Observe(instance, Role::kHaptic);
  // The loop's thread is the one with which the ticks stand still.
  for (const pid_t thread : ThreadsOf(haptic.pid())) {
    if (thread == haptic.pid()) continue;
    const FrozenThread frozen(thread);
    if (!frozen.held()) {
      WARN("this machine lets nobody stop a single thread (ptrace): skipped");
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const std::uint64_t tick = view->Tick();
    const int fed = manager.Count("WATCHDOG=1");
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    if (view->Tick() != tick) continue;
    CHECK(manager.Count("WATCHDOG=1") <= fed + 1);  // one may have been on its way
    // The supervisor goes on: it reloads.
    const int reloads = manager.Count("RELOADING=1");
    haptic.Signal(SIGHUP);
    CHECK(manager.Hears("RELOADING=1", reloads));
    return;
  }
  FAIL("no thread ticks");
}

TEST_CASE("a good file changes the running haptic_server, a wrong one nothing at all") {
  const Instance instance;
  const Manager manager;
  const Settings settings(manager.folder());
  settings.Write(HapticText("2000"));
  Child haptic(HapticCommand(settings, instance));
  const auto view = Observe(instance, Role::kHaptic);
  REQUIRE(manager.Hears("READY=1"));
  REQUIRE(NewestTick(*view).stiffness == 2000);

  settings.Write(HapticText("1200") + "stroke_mm = 1 2 3\n");
  haptic.Signal(SIGHUP);
  CHECK(manager.Hears("RELOADING=1"));
  CHECK(manager.Hears("READY=1", 1));
  CHECK(Eventually([&] { return NewestTick(*view).stiffness == 1200; }));
  CHECK_THAT(haptic.Stderr(), Contains("now render.stiffness_n_per_m = 1200"));
  CHECK_THAT(haptic.Stderr(), Contains("needs a restart: hand.stroke_mm = 1 2 3"));

  // The first line is right, and is not taken either.
  settings.Write(HapticText("700") + "rest_ms = long\n");
  haptic.Signal(SIGHUP);
  CHECK(manager.Hears("READY=1", 2));
  CHECK_THAT(haptic.Stderr(), Contains(settings.path() + ":7: hand.rest_ms = long"));
  CHECK_THAT(haptic.Stderr(), Contains("the settings stay as they were"));
  CHECK(NewestTick(*view).stiffness == 1200);
  haptic.Signal(SIGTERM);
  CHECK(haptic.Wait() == 0);
}

TEST_CASE("SIGHUP leads a running world_server to another scene, and a wrong file leads nowhere") {
  const Instance instance;
  const Manager manager;
  const Settings settings(manager.folder());
  const auto text = [](const std::string& scene, const std::string& more) {
    return "[scene]\nfile = " + SourceFile("config/scenes/" + scene) + "\n[features]\n" + more;
  };
  settings.Write(text("push.sdf", ""));
  Child world({Program("world_server"), "--config", settings.path(), "--instance", instance});
  const auto view = Observe(instance, Role::kWorld);
  REQUIRE(manager.Hears("READY=1"));
  CHECK(manager.Hears("STATUS=20 Hz, scene push"));
  CHECK(manager.Hears("WATCHDOG=1", 2));

  settings.Write(text("three_cubes.sdf", "radius_mm = 35\nfinger_friction = 0.3\n"));
  world.Signal(SIGHUP);
  CHECK(manager.Hears("scene three_cubes"));
  CHECK_THAT(world.Stderr(), Contains("now features.radius_mm = 35"));
  CHECK_THAT(world.Stderr(), Contains("needs a restart: features.finger_friction = 0.3"));

  const int ready = manager.Count("READY=1");
  settings.Write(text("push.sdf", "radius_mm = far\n"));
  world.Signal(SIGHUP);
  CHECK(manager.Hears("READY=1", ready));
  CHECK_THAT(world.Stderr(), Contains(settings.path() + ":4: features.radius_mm = far"));
  CHECK(std::string(ReadWorldHealth(*view).scene.data()) == "three_cubes");
  world.Signal(SIGTERM);
  CHECK(world.Wait() == 0);
}
