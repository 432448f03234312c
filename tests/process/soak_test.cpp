// The pair in use for long: one side stays while the other is killed and restarted at random, and both
// are reloaded with other settings and scenes. Who stays must not grow - in memory, descriptors or
// mappings -, the force must stay inside its limits at every tick, and the books must balance at the end.
#include <signal.h>

#include <array>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
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

constexpr double kSlewLimit = 5000;  // N/s, shipped
// The allocator's own give and take; a leak of 4 kB in each of the thousand events of the long form is
// found.
constexpr std::int64_t kMemorySlackKib = 4096;
constexpr std::int64_t kMappingSlack = 8;

// What a process holds.
struct Holdings {
  std::int64_t resident_kib = 0;
  std::int64_t descriptors = 0;
  std::int64_t mappings = 0;
};

Holdings HoldingsOf(pid_t process) {
  const std::string folder = "/proc/" + std::to_string(process);
  Holdings holdings;
  std::ifstream status(folder + "/status");
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") status >> holdings.resident_kib;
  }
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder + "/fd")) {
    ++holdings.descriptors;
  }
  std::ifstream maps(folder + "/maps");
  for (std::string line; std::getline(maps, line);) ++holdings.mappings;
  return holdings;
}

void CheckNoGrowth(const Holdings& before, const Holdings& after) {
  CHECK(after.descriptors <= before.descriptors);
  CHECK(after.mappings <= before.mappings + kMappingSlack);
  CHECK(after.resident_kib <= before.resident_kib + kMemorySlackKib);
}

class Soak {
 public:
  explicit Soak(unsigned seed) : random_(seed) {
    WriteHaptic(2000);
    WriteWorld("push.sdf");
    Start(Role::kHaptic);
    Start(Role::kWorld);
  }

  // Reloads of both sides, and restarts of one, for so long.
  void Run(double seconds, Role restarted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(Uniform(300, 1500)));
      ++events_;
      switch (Uniform(0, 3)) {
        case 0:
          WriteHaptic(Uniform(5, 20) * 100);
          Reload(Role::kHaptic);
          break;
        case 1: {
          constexpr std::array kScenes{"push.sdf", "three_cubes.sdf", "stiff_wall.sdf"};
          WriteWorld(kScenes[static_cast<std::size_t>(Uniform(0, 2))]);
          Reload(Role::kWorld);
          break;
        }
        case 2:
          Observe(instance_, restarted, 30);
          Of(restarted)->Signal(SIGTERM);
          CHECK(Of(restarted)->Wait(30) == 0);
          Start(restarted);
          break;
        default:
          Of(restarted)->Signal(SIGKILL);
          Of(restarted)->Wait();
          Start(restarted);
      }
      REQUIRE(Of(Role::kHaptic)->IsRunning());
      REQUIRE(Of(Role::kWorld)->IsRunning());
    }
  }

  // A second after the last event.
  Holdings Settled(Role role) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    return HoldingsOf(Of(role)->pid());
  }

  // Both alive and pushing, as long as it takes until the books are settled.
  void CheckBooks() {
    WriteWorld("push.sdf");
    Reload(Role::kWorld);
    const auto view = Observe(instance_, Role::kHaptic, 30);
    Observe(instance_, Role::kWorld, 30);
    SettledBooks(*view);
  }

  const std::string& instance() const { return instance_; }
  int events() const { return events_; }

 private:
  int Uniform(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

  std::optional<Child>& Of(Role role) { return role == Role::kHaptic ? haptic_ : world_; }

  void WriteHaptic(int stiffness) {
    std::ostringstream text;
    text << "[render]\nstiffness_n_per_m = " << stiffness
         << "\n[safety]\nslew_limit_n_per_s = " << kSlewLimit
         << "\n[device]\nfile = " << SourceFile("config/devices/simulated.ini")
         << "\n[hand]\nrest_ms = 500\n";
    folder_.Write("haptic.ini", text.str());
  }

  void WriteWorld(const std::string& scene) {
    folder_.Write("world.ini", "[scene]\nfile = " + SourceFile("config/scenes/" + scene) + "\n");
  }

  void Start(Role role) {
    const std::string name = role == Role::kHaptic ? "haptic" : "world";
    Of(role).emplace(std::vector<std::string>{Program(name + "_server"), "--config",
                                              folder_.File(name + ".ini"), "--instance",
                                              instance_});
  }

  // One that still starts would end by the signal.
  void Reload(Role role) {
    Observe(instance_, role, 30);
    Of(role)->Signal(SIGHUP);
  }

  Instance instance_;
  TemporaryFolder folder_;
  std::mt19937 random_;
  std::optional<Child> haptic_;
  std::optional<Child> world_;
  int events_ = 0;
};

}  // namespace

TEST_CASE("the pair in use for long: who stays does not grow, the force keeps its limits") {
  const double phase_s = std::getenv("RIKISEKI_FULL") != nullptr ? 900 : 60;
  Soak soak(8);
  {
    const TickWatch watch(soak.instance(), kSlewLimit);
    soak.Run(phase_s / 3, Role::kWorld);
    const Holdings before = soak.Settled(Role::kHaptic);
    soak.Run(2 * phase_s / 3, Role::kWorld);
    CheckNoGrowth(before, soak.Settled(Role::kHaptic));
    CheckSafe(watch);
  }
  soak.Run(phase_s / 3, Role::kHaptic);
  const Holdings before = soak.Settled(Role::kWorld);
  soak.Run(2 * phase_s / 3, Role::kHaptic);
  CheckNoGrowth(before, soak.Settled(Role::kWorld));
  soak.CheckBooks();
  CHECK(soak.events() > phase_s / 4);  // it must have been a soak, on however slow a machine
}
