// Both daemons and both sides of scripts/peer.py before the conformance kit, strictly.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::Role;

// The kit's own watchdogs end it long before; this only keeps a hang from lasting for ever.
constexpr double kPatience = 180;

struct Instance {
  std::string name = FreshInstance();
  ~Instance() {
    for (const char* role : {".haptic", ".world"}) {
      std::filesystem::remove("/dev/shm/rikiseki." + name + role);
    }
  }
};

/// The kit's exit status; its report, if that is not 0, goes to the test's.
int Check(const std::string& instance, const std::vector<std::string>& more) {
  const std::string junit = (std::filesystem::temp_directory_path() / (instance + ".xml")).string();
  std::vector<std::string> command{Program("protocol_check"), "--instance", instance, "--strict",
                                   "--junit", junit};
  command.insert(command.end(), more.begin(), more.end());
  Child kit(command);
  const int status = kit.Wait(kPatience);
  std::ifstream file(junit);
  std::string line;
  while (status != 0 && std::getline(file, line)) {
    if (line.find("<failure") != std::string::npos) UNSCOPED_INFO(line);
  }
  if (status != 0) UNSCOPED_INFO(kit.Stderr());
  std::filesystem::remove(junit);
  return status;
}

}  // namespace

TEST_CASE("haptic_server passes protocol_check --strict, its hand at rest") {
  const Instance instance;
  const Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                      "--instance", instance.name, "--set", "hand.script=rest"});
  CHECK(Check(instance.name, {"--as", "world"}) == 0);
}

TEST_CASE("world_server passes protocol_check --strict, with a box that is fixed, and one that moves") {
  const bool fixed = GENERATE(true, false);
  const std::string scene = fixed ? "config/scenes/conformance.sdf" : "config/scenes/push.sdf";
  INFO(scene);
  const Instance instance;
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance.name, "--set", "scene.file=" + SourceFile(scene)});
  CHECK(Check(instance.name, {"--as", "haptic"}) == 0);
}

TEST_CASE("peer.py passes protocol_check --strict on both sides") {
  const bool as_world = GENERATE(true, false);
  INFO("judged by the kit as " << (as_world ? "world" : "haptic"));
  const Instance instance;
  const Child peer({"/usr/bin/python3", SourceFile("scripts/peer.py"),
                    as_world ? "haptic" : "world", "--instance", instance.name});
  CHECK(Check(instance.name, {"--as", as_world ? "world" : "haptic"}) == 0);
}

TEST_CASE("protocol_check inspect: a live pair is sound, nobody is no pair") {
  const Instance instance;
  Child nobody({Program("protocol_check"), "inspect", instance.name});
  CHECK(nobody.Wait() == 1);
  const Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                      "--instance", instance.name});
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance.name});
  Observe(instance.name, Role::kHaptic);
  Observe(instance.name, Role::kWorld);
  Child kit({Program("protocol_check"), "inspect", instance.name, "--strict"});
  CHECK(kit.Wait() == 0);
}

TEST_CASE("protocol_check refuses a role that somebody has, and wrong command lines") {
  const Instance instance;
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance.name});
  Observe(instance.name, Role::kWorld);
  Child kit({Program("protocol_check"), "--as", "world", "--instance", instance.name});
  CHECK(kit.Wait() == 75);
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"--as", "both"}, {}, {"inspect"}, {"--as", "world", "--case", "haptic/none"},
           {"--as", "world", "--target", "1,2"}}) {
    std::vector<std::string> command{Program("protocol_check")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    Child wrong(command);
    CHECK(wrong.Wait() == 64);
  }
}
