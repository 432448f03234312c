// SPDX-License-Identifier: MIT
// The pair in use for long: one side stays while the other is killed and restarted at random, and both
// are reloaded, with good and with broken settings and scenes. Who stays must not grow - in memory,
// descriptors, mappings or threads -, the force must keep its limits at every tick, and the books must
// balance. A minute for either side, a quarter of an hour with RIKISEKI_FULL.
#include <signal.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <random>
#include <sstream>
#include <thread>

#include "tests/common/temporary_folder.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::Role;

constexpr double kSlewLimit = 5000;   // N/s
constexpr double kPatience = 60;      // s, for what takes milliseconds on an idle machine
constexpr double kWarmUpShare = 0.4;  // of the time; every event has happened by then
constexpr int kKinds = 9;
// What the allocator may take more of. haptic_server was constant to the page in every run, world_server in most:
// its heap grows in steps of 7 MiB, two or three within the first 140 readings, and then no more. In the long form
// a leak of 60 KiB in each of 400 readings is found.
constexpr long kMappingSlack = 8;
constexpr long kHapticSlackKib = 512;
constexpr long kWorldSlackKib = 24576;

// The least of each for some seconds: what is held for a moment only, while a peer is attached or a scene is
// read, is no growth.
Usage LeastUsageOf(pid_t process) {
  Usage least = UsageOf(process);
  for (int i = 0; i < 30; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const Usage now = UsageOf(process);
    for (long Usage::*held : {&Usage::descriptors, &Usage::mappings, &Usage::segments,
                              &Usage::threads, &Usage::resident_kib}) {
      least.*held = std::min(least.*held, now.*held);
    }
  }
  return least;
}

std::size_t CountOf(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

std::string Shipped(const std::string& scene) {
  std::ostringstream text;
  text << std::ifstream(SourceFile("config/scenes/" + scene)).rdbuf();
  return text.str();
}

class Soak {
 public:
  // `stays` is watched, the other side comes and goes.
  Soak(Role stays, unsigned seed) : stays_(stays), random_(seed) {
    WriteGood();
    Start(Role::kHaptic);
    Start(Role::kWorld);
  }

  // Every event once, for what is made once: libsdformat opens its log at the first broken scene.
  void WarmUp() {
    for (int kind = 0; kind < kKinds; ++kind) Event(kind);
  }

  void Run(double seconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(Uniform(50, 500)));
      Event(Uniform(0, kKinds - 1));
      REQUIRE(Of(stays_)->IsRunning());
      REQUIRE(Of(comes_)->IsRunning());
    }
  }

  // Both alive and pushing in the same scene as always, as long as it takes until the books are settled.
  Usage Settle() {
    scene_ = "push.sdf";
    WriteGood();
    Reload(Role::kWorld);
    Reload(Role::kHaptic);
    const auto haptic = Observe(instance_, Role::kHaptic, kPatience);
    const auto world = Observe(instance_, Role::kWorld, kPatience);
    const bool is_back = Eventually(
        [&] { return std::string(ReadWorldHealth(*world).scene.data()) == "push"; }, kPatience);
    INFO(Of(Role::kWorld)->Stderr());
    REQUIRE(is_back);
    SettledBooks(*haptic);
    return LeastUsageOf(Of(stays_)->pid());
  }

  // Whatever the watch of the present haptic side saw.
  void CheckForce() {
    const std::size_t seen = watch_->All().size();
    CHECK(watch_->finite());
    CHECK(watch_->worst_over_cap() <= 1e-9);
    CHECK(watch_->worst_over_slew() <= 1e-9);
    CHECK(watch_->lost() <= seen / 100);  // a watch that saw it, on however slow a machine
    ticks_ += seen;
  }

  int events() const { return events_; }
  std::size_t ticks() const { return ticks_; }

 private:
  void Event(int kind) {
    ++events_;
    switch (kind) {
      case 0:
        stiffness_ = Uniform(5, 20) * 100;
        cap_ = Uniform(4, 10);
        WriteGood();
        return Reload(Role::kHaptic);
      case 1:
        radius_ = Uniform(20, 60);
        WriteGood();
        return Reload(Role::kWorld);
      case 2: {
        constexpr std::array kBroken{"[render]\nstiffness_n_per_m = -1\n", "[rendering]\n", "\x01"};
        return BrokenSettings(Role::kHaptic, kBroken[static_cast<std::size_t>(Uniform(0, 2))]);
      }
      case 3: {
        constexpr std::array kBroken{"[loop]\nrate_hz = fast\n", "[scene]\nfile = not/there.sdf\nx",
                                     "[scene]\nfile = a\nfile = b\n"};
        return BrokenSettings(Role::kWorld, kBroken[static_cast<std::size_t>(Uniform(0, 2))]);
      }
      case 4: {  // the watched file is saved, with another scene in it
        constexpr std::array kScenes{"push.sdf", "three_cubes.sdf", "stiff_wall.sdf", "stack.sdf"};
        scene_ = kScenes[static_cast<std::size_t>(Uniform(0, 3))];
        return WriteGood();
      }
      case 5:
        return BrokenScene();
      case 6:
        Observe(instance_, comes_, kPatience);  // one that still starts would end by the signal
        Of(comes_)->Signal(SIGTERM);
        CHECK(Of(comes_)->Wait(kPatience) == 0);
        return Start(comes_);
      default:  // at any instant; a world while it starts, too
        Of(comes_)->Signal(SIGKILL);
        Of(comes_)->Wait();
        return Start(comes_);
    }
  }

  int Uniform(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

  std::optional<Child>& Of(Role role) { return role == Role::kHaptic ? haptic_ : world_; }

  static std::string SettingsOf(Role role) {
    return role == Role::kHaptic ? "haptic.ini" : "world.ini";
  }

  // Renamed into place: who starts or reads meanwhile finds the old or the new.
  void WriteGood() {
    std::ostringstream haptic;
    haptic << "[render]\nstiffness_n_per_m = " << stiffness_ << "\n[safety]\nforce_cap_n = " << cap_
           << "\nslew_limit_n_per_s = " << kSlewLimit
           << "\n[device]\nfile = " << SourceFile("config/devices/simulated.ini") << "\n";
    folder_.Rename(SettingsOf(Role::kHaptic), haptic.str());
    std::ostringstream world;
    world << "[scene]\nfile = scene.sdf\n[features]\nradius_mm = " << radius_ << "\n";
    folder_.Rename(SettingsOf(Role::kWorld), world.str());
    folder_.Rename("scene.sdf", Shipped(scene_));
  }

  void Start(Role role) {
    if (role == Role::kHaptic && watch_) {
      CheckForce();
      watch_.reset();
    }
    Of(role).emplace(std::vector<std::string>{
        Program(role == Role::kHaptic ? "haptic_server" : "world_server"), "--config",
        folder_.File(SettingsOf(role)), "--instance", instance_});
    if (role == Role::kHaptic) watch_.emplace(instance_, kSlewLimit);
  }

  void Reload(Role role) {
    Observe(instance_, role, kPatience);
    Of(role)->Signal(SIGHUP);
  }

  // Until the log has one more of these than before.
  void WaitForRefusal(Role role, const std::string& words, std::size_t before) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatience);
    while (CountOf(Of(role)->Stderr(), words) <= before) {
      INFO(Of(role)->Stderr());
      REQUIRE(std::chrono::steady_clock::now() < end);
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }

  void BrokenSettings(Role role, const std::string& text) {
    Observe(instance_, role, kPatience);  // it would not start with them
    const std::string words = "the settings stay as they were";
    const std::size_t before = CountOf(Of(role)->Stderr(), words);
    folder_.Rename(SettingsOf(role), text);
    Of(role)->Signal(SIGHUP);
    WaitForRefusal(role, words, before);
    WriteGood();
  }

  void BrokenScene() {
    Observe(instance_, Role::kWorld, kPatience);
    const std::string words = "the scene stays as it was";
    const std::size_t before = CountOf(Of(Role::kWorld)->Stderr(), words);
    folder_.Rename("scene.sdf", "<sdf version=\"1.9\"><world name=\"half\"><model name=\"cut");
    WaitForRefusal(Role::kWorld, words, before);
    WriteGood();
  }

  const Role stays_;
  const Role comes_ = stays_ == Role::kHaptic ? Role::kWorld : Role::kHaptic;
  const Instance instance_;
  const TemporaryFolder folder_;
  std::mt19937 random_;
  int stiffness_ = 2000;  // N/m
  int cap_ = 10;          // N
  int radius_ = 20;       // mm
  std::string scene_ = "push.sdf";
  std::optional<Child> haptic_;
  std::optional<Child> world_;
  std::optional<TickWatch> watch_;
  int events_ = 0;
  std::size_t ticks_ = 0;
};

void Judge(Role stays) {
  const double seconds = std::getenv("RIKISEKI_FULL") != nullptr ? 900 : 60;
  Soak soak(stays, 8);
  soak.WarmUp();
  soak.Run(kWarmUpShare * seconds);
  const Usage before = soak.Settle();
  const int events_before = soak.events();
  soak.Run((1 - kWarmUpShare) * seconds);
  const Usage after = soak.Settle();
  soak.CheckForce();
  const int events = soak.events() - events_before;
  std::printf(
      "%d events and %d more, %zu ticks; resident %ld -> %ld KiB, threads %ld -> %ld, descriptors "
      "%ld -> %ld, mappings %ld -> %ld, of segments %ld -> %ld\n",
      events_before, events, soak.ticks(), before.resident_kib, after.resident_kib, before.threads,
      after.threads, before.descriptors, after.descriptors, before.mappings, after.mappings,
      before.segments, after.segments);
  CHECK(after.threads <= before.threads);
  CHECK(after.descriptors <= before.descriptors);
  CHECK(after.segments <= before.segments);
  CHECK(after.mappings <= before.mappings + kMappingSlack);
  CHECK(after.resident_kib <=
        before.resident_kib + (stays == Role::kHaptic ? kHapticSlackKib : kWorldSlackKib));
  CHECK(events > seconds / 5);  // it must have been a soak, on however slow a machine
}

}  // namespace

TEST_CASE("haptic_server in use for long does not grow, and the force keeps its limits") {
  Judge(Role::kHaptic);
}

TEST_CASE("world_server in use for long does not grow, and the force keeps its limits") {
  Judge(Role::kWorld);
}
