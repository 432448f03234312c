// SPDX-License-Identifier: MIT
// The live view of haptic_status as a person sees it: on a terminal of any size each picture has room, the
// reason of the force is in it, and Ctrl-C leaves the terminal as it was.
#include <signal.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "tests/process/child.h"
#include "tests/process/observer.h"
#include "tests/process/terminal.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::PeerState;
using protocol::Role;

constexpr char kHome[] = "\x1b[H";
constexpr char kToEndOfLine[] = "\x1b[K";
constexpr char kBelow[] = "\x1b[J";

// The lines of the whole pictures from this place of the output on.
std::vector<std::vector<std::string>> Pictures(const std::string& output, std::size_t from = 0) {
  std::vector<std::vector<std::string>> pictures;
  while (true) {
    const std::size_t start = output.find(kHome, from);
    const std::size_t end = output.find(kBelow, start == std::string::npos ? from : start);
    if (start == std::string::npos || end == std::string::npos) return pictures;
    std::vector<std::string>& lines = pictures.emplace_back();
    for (std::size_t at = start + sizeof kHome - 1; at < end;) {
      const std::size_t line_end = output.find(kToEndOfLine, at);
      lines.push_back(output.substr(at, line_end - at));
      at = output.find('\n', line_end) + 1;
    }
    from = end;
  }
}

void CheckRoom(const std::vector<std::string>& picture, int columns, int rows) {
  CHECK(picture.size() < static_cast<std::size_t>(rows));  // the cursor stands below
  for (const std::string& line : picture) {
    CHECK(line.size() <= static_cast<std::size_t>(columns));
    CHECK(line.find('\x1b') == std::string::npos);
  }
}

std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace

TEST_CASE("the live view has room on every terminal, says why, and Ctrl-C leaves it sane") {
  const Instance instance;
  Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
               "--instance", instance});
  Child haptic({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"),
                "--instance", instance, "--set", "hand.script=rest"});
  const auto view = Observe(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return ReadHapticHealth(*view).peer_state == PeerState::kLive; }));

  OnTerminal status({Program("haptic_status"), "--instance", instance, "--interval", "0.05"}, 120,
                    80);
  const auto seen = [&](std::size_t from, std::size_t count) {
    REQUIRE(Eventually([&] { return Pictures(status.Output(), from).size() >= count; }, 30));
    return Pictures(status.Output(), from).back();
  };
  const std::vector<std::string> wide = seen(0, 3);
  CheckRoom(wide, 120, 80);
  CHECK_THAT(Joined(wide), Contains("  force      Nothing is touched, so the force is zero.\n"));
  CHECK_THAT(Joined(wide), Contains("\nBOOKS   balanced (N s)\n") && Contains("< 100 us"));
  CHECK_THAT(Joined(wide), Contains("\nWORLD   ready") && Contains("cube::link"));

  // Two more pictures: the first of them may have been under way when the window shrank.
  for (const auto& [columns, rows] : {std::pair(80, 24), std::pair(40, 12), std::pair(20, 5)}) {
    const std::size_t before = status.Output().size();
    status.Resize(columns, rows);
    const std::vector<std::string> small = seen(before, 3);
    CheckRoom(small, columns, rows);
    CHECK_THAT(small.front(), Contains("HAPTIC  ready"));
    if (columns < 80) CHECK_THAT(small.back(), Contains("... "));
    if (columns == 80)
      CHECK_THAT(Joined(small), Contains("Nothing is touched") && Contains("BOOKS   balanced, "));
  }

  status.Press('\x03');
  CHECK(status.Wait() == -SIGINT);
  CHECK(status.Echoes());
  // Nothing was switched that would have to be switched back: no hidden cursor, no other screen.
  CHECK(status.Output().find("\x1b[?") == std::string::npos);
  CHECK(haptic.IsRunning());
  CHECK(world.IsRunning());
}
