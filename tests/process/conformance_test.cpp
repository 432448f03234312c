// SPDX-License-Identifier: MIT
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

/// The kit's exit status; its report, if that is not 0, goes to the test's.
int Check(const std::string& instance, const std::vector<std::string>& more) {
  const std::string junit = (std::filesystem::temp_directory_path() / (instance + ".xml")).string();
  std::vector<std::string> command{
      Program("protocol_check"), "--instance", instance, "--strict", "--junit", junit};
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
  const Instance owned;
  const std::string instance = owned;
  const Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                      "--instance", instance, "--set", "hand.script=rest"});
  CHECK(Check(instance, {"--as", "world"}) == 0);
}

TEST_CASE(
    "world_server passes protocol_check --strict, with a box that is fixed, and one that moves, by "
    "impulses and as a local body") {
  const auto [name, coupling] = GENERATE(table<const char*, const char*>({
      {"conformance.sdf", "impulse"},
      {"push.sdf", "impulse"},
      {"push.sdf", "local"},
  }));
  const std::string scene = std::string("config/scenes/") + name;
  INFO(scene << ", coupling " << coupling);
  const Instance owned;
  const std::string instance = owned;
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance, "--set", "scene.file=" + SourceFile(scene), "--set",
                     std::string("coupling.coupling=") + coupling});
  CHECK(Check(instance, {"--as", "haptic"}) == 0);
}

TEST_CASE("peer.py passes protocol_check --strict on both sides") {
  const bool as_world = GENERATE(true, false);
  INFO("judged by the kit as " << (as_world ? "world" : "haptic"));
  const Instance owned;
  const std::string instance = owned;
  const Child peer({"/usr/bin/python3", SourceFile("scripts/peer.py"),
                    as_world ? "haptic" : "world", "--instance", instance});
  CHECK(Check(instance, {"--as", as_world ? "world" : "haptic"}) == 0);
}

TEST_CASE("protocol_check inspect: a live pair is sound, nobody is no pair") {
  const Instance owned;
  const std::string instance = owned;
  Child nobody({Program("protocol_check"), "inspect", instance});
  CHECK(nobody.Wait() == 1);
  const Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                      "--instance", instance});
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance});
  Observe(instance, Role::kHaptic);
  Observe(instance, Role::kWorld);
  Child kit({Program("protocol_check"), "inspect", instance, "--strict"});
  CHECK(kit.Wait() == 0);
}

TEST_CASE("protocol_check refuses a role that somebody has, and wrong command lines") {
  const Instance owned;
  const std::string instance = owned;
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--instance", instance});
  Observe(instance, Role::kWorld);
  Child kit({Program("protocol_check"), "--as", "world", "--instance", instance});
  CHECK(kit.Wait() == 75);
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--as", "both"},
                                             {},
                                             {"inspect"},
                                             {"--as", "world", "--case", "haptic/none"},
                                             {"--as", "world", "--target", "1,2"}}) {
    std::vector<std::string> command{Program("protocol_check")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    Child wrong(command);
    CHECK(wrong.Wait() == 64);
  }
}
