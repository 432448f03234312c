// SPDX-License-Identifier: MIT
// The live view in headless Chromium against the real pair: what the page shows is what stands in shared
// memory. Screenshots stay in the artefacts folder of the build.
#include <signal.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <mutex>
#include <sstream>
#include <thread>

#include "tests/browser/chromium.h"
#include "tests/browser/watched_pair.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using nlohmann::json;

constexpr int kWidth = 900;  // wide enough for the desk layout
constexpr int kHeight = 440;
constexpr double kSlewLimit = 5000;      // N/s, of the shipped file
constexpr std::size_t kEmptyPng = 4000;  // bytes; a window of one colour has 1 to 2 kB

/// Reads where the one body that can move is, in every frame, on a thread of its own.
class BodyWatch {
 public:
  explicit BodyWatch(const std::string& instance)
      : view_(Observe(instance, protocol::Role::kWorld)), thread_([this] { Run(); }) {}
  ~BodyWatch() {
    stop_ = true;
    thread_.join();
  }

  /// By the stamp of the message that said so.
  std::map<std::uint64_t, protocol::Vector> Positions() const {
    const std::lock_guard lock(mutex_);
    return positions_;
  }

 private:
  void Run() {
    protocol::BodiesReader reader(view_->Stream(protocol::StreamType::kWorldBodies));
    while (!stop_) {
      if (reader.ReadLatest() == protocol::ReadStatus::kFresh) {
        const std::lock_guard lock(mutex_);
        for (const protocol::Body& body : reader.bodies()) {
          if (body.mass > 0) positions_[reader.received().stamp_ns] = body.position;
        }
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::unique_ptr<protocol::PeerView> view_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, protocol::Vector> positions_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Where in the lists of the page the body that can move stands.
std::size_t MovingPlace(const json& picture) {
  for (std::size_t i = 0; i < picture["bodies"].size(); ++i) {
    if (!picture["bodies"][i]["fixed"].get<bool>()) return i;
  }
  FAIL("the page knows no body that can move");
  return 0;
}

bool InContact(const json& picture) {
  return picture["drawn"]["planes"] > 0 && picture["drawn"]["arrows"] > 0 &&
         Length(picture["fingers"][0]["force"]) > 0.5;
}

bool ShowsScene(const json& picture) {
  return picture["bodies"].size() == 2 && picture["bodies"][0]["drawn"] > 0 &&
         picture["bodies"][1]["drawn"] > 0 && picture["bodies"][1]["position"][0].is_number() &&
         picture["frames"] > 2 && picture["fingers"].size() == 1 && picture["banner"] == "";
}

/// Puts the block back to where it can be pushed, when the finger is not in its way.
void ResetBlock(Chromium& page, WatchedPair& pair) {
  AwaitPicture(page, [](const json& picture) {
    return picture["fingers"].size() == 1 && picture["fingers"][0]["position"][0] < -0.045;
  });
  pair.world->Signal(SIGHUP);
}

/// A picture for which `holds`, which a push makes true. One push throws the block out of reach, perhaps
/// before the page was there.
json AwaitPush(Chromium& page, WatchedPair& pair, bool (*holds)(const json& picture)) {
  json picture;
  for (int i = 0; i < 15; ++i) {
    ResetBlock(page, pair);
    picture = AwaitPicture(page, holds, 3);  // a push comes every 1.2 s
    if (holds(picture)) break;
  }
  return picture;
}

/// Two looks at one moment: the picture, and the frames that the page remembers.
json PictureAndFrames(Chromium& page) {
  return page.Evaluate("({ picture: rikiseki.picture(), frames: rikiseki.frames() })");
}

}  // namespace

TEST_CASE("the picture is what stands in shared memory: block, planes, force, impulses, copies") {
  WatchedPair pair;
  pair.StartAll();
  const BodyWatch bodies(pair.instance());
  const TickWatch ticks(pair.instance(), kSlewLimit);
  Chromium page(pair.url(), kWidth, kHeight);
  const json scene = AwaitPicture(page, ShowsScene);
  REQUIRE(ShowsScene(scene));
  CHECK(scene["complaint"] == "");
  const std::size_t place = MovingPlace(scene);

  // The first contact, the page's own clock stopped to look at it.
  const json contact = AwaitPush(page, pair, InContact);
  REQUIRE(InContact(contact));
  CHECK(page.Screenshot("view-contact").size() > kEmptyPng);
  std::map<std::uint64_t, WatchedTick> by_tick;
  for (const WatchedTick& tick : ticks.All()) by_tick[tick.tick] = tick;
  const auto shown_tick = contact["tick"].get<std::uint64_t>();
  REQUIRE(by_tick.contains(shown_tick));
  CHECK(contact["fingers"][0]["force"][0] == by_tick[shown_tick].force_x);  // to the bit
  CHECK(contact["fingers"][0]["position"][0] == by_tick[shown_tick].finger_x);
  // The force points from the finger's centre to the proxy on the surface, out of the block.
  const json& finger = contact["fingers"][0];
  CHECK((finger["proxy"][0].get<double>() - finger["position"][0].get<double>()) *
            finger["force"][0].get<double>() >=
        0);

  // The frame after brings the impulse, and the copies come with every frame near the block.
  const auto flashes = [](const json& picture) {
    return picture["drawn"]["flashes"] > 0 && picture["drawn"]["ghosts"] > 0;
  };
  CHECK(flashes(AwaitPush(page, pair, flashes)));

  // While the block moves, every frame that the page has is to the bit what the segment held, and the
  // block stands between the two frames about the moment shown.
  ResetBlock(page, pair);
  double least = 1e9;
  double most = -1e9;
  for (int i = 0; i < 1000 && most - least < 0.02; ++i) {
    const json look = PictureAndFrames(page);
    const json& shown = look["picture"]["bodies"][place]["position"];
    const double time = look["picture"]["time"];
    const json* before = nullptr;
    const json* after = nullptr;
    for (const json& frame : look["frames"]) {
      (frame["state"] <= time ? before : after) = &frame;
      if (after != nullptr) break;
    }
    REQUIRE(before != nullptr);
    const json& from = (*before)["bodies"][place];
    if (from.is_null()) continue;  // of the time before the block was put back
    const json& to = after == nullptr ? from : (*after)["bodies"][place];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = std::min(from[axis].get<double>(), to[axis].get<double>());
      const double high = std::max(from[axis].get<double>(), to[axis].get<double>());
      const double rounding = 1e-12;  // of a cubic of numbers below 1 m: some 2^-53
      CHECK(shown[axis].get<double>() >= low - rounding);
      CHECK(shown[axis].get<double>() <= high + rounding);
    }
    least = std::min(least, shown[0].get<double>());
    most = std::max(most, shown[0].get<double>());
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  CHECK(most - least >= 0.02);
  const json remembered = PictureAndFrames(page)["frames"];
  const auto held = bodies.Positions();
  std::size_t of_this_block = 0;
  std::size_t compared = 0;
  for (const json& frame : remembered) {
    const auto found = held.find(frame["stamp"].get<std::uint64_t>());
    if (frame["bodies"][place].is_null()) continue;
    ++of_this_block;
    if (found == held.end()) continue;  // this watch slept through it
    ++compared;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(frame["bodies"][place][axis] == found->second[axis]);
    }
  }
  CHECK(compared > of_this_block / 4);

  // The books of the last 5 s.
  std::istringstream csv(page.Evaluate("rikiseki.csv()").get<std::string>());
  std::string line;
  std::getline(csv, line);
  CHECK(line.starts_with("time_s,tick,frame,pointer,reason,x_m,"));
  for (const WatchedTick& tick : ticks.All()) by_tick[tick.tick] = tick;
  std::size_t rows = 0;
  while (std::getline(csv, line)) {
    std::vector<std::string> cells;
    std::istringstream split(line);
    for (std::string cell; std::getline(split, cell, ',');) cells.push_back(cell);
    REQUIRE(cells.size() >= 15);
    const auto known = by_tick.find(std::stoull(cells[1]));
    if (known == by_tick.end()) continue;
    ++rows;
    CHECK(std::stod(cells[8]) == known->second.force_x);
    CHECK(std::stod(cells[5]) == known->second.finger_x);
    if (!cells[11].empty()) CHECK(std::stod(cells[11]) >= 0);
  }
  CHECK(rows > 500);
}

TEST_CASE("pause and step back, by key, at phone width and in the dark") {
  WatchedPair pair;
  pair.StartAll();
  Chromium page(pair.url(), kWidth, kHeight);
  REQUIRE(ShowsScene(AwaitPicture(page, ShowsScene)));
  REQUIRE(InContact(AwaitPush(page, pair, InContact)));

  page.Press(" ");
  // All that was under way when the picture stopped has come.
  const auto settled = [](const json& picture) {
    return picture["paused"].get<bool>() &&
           picture["now"].get<double>() > picture["time"].get<double>() + 1e9;
  };
  const json paused = AwaitPicture(page, settled);
  REQUIRE(settled(paused));
  const json later =
      AwaitPicture(page, [&](const json& picture) { return picture["ticks"] > paused["ticks"]; });
  CHECK(later["ticks"] > paused["ticks"]);  // it goes on listening
  CHECK(later["time"] == paused["time"]);
  CHECK(later["fingers"] == paused["fingers"]);
  CHECK(later["bodies"] == paused["bodies"]);

  page.Press("ArrowLeft");
  const json back =
      AwaitPicture(page, [&](const json& picture) { return picture["time"] < paused["time"]; });
  CHECK(back["time"] < paused["time"]);
  CHECK(back["frame"] <= paused["frame"]);
  page.Press("ArrowRight");
  const json forward =
      AwaitPicture(page, [&](const json& picture) { return picture["time"] > back["time"]; });
  CHECK(forward["frame"] > back["frame"]);  // by one, but where the page slept through some
  page.Press("ArrowLeft", true);
  const json second =
      AwaitPicture(page, [&](const json& picture) { return picture["time"] < forward["time"]; });
  const double wanted =
      std::max(forward["time"].get<double>() - 1e9, second["oldest"].get<double>());
  CHECK(second["time"].get<double>() == Approx(wanted).margin(1));  // ns
  page.Press(" ");
  CHECK_FALSE(AwaitPicture(page, [](const json& picture) { return !picture["paused"]; })["paused"]);

  page.Resize(375, 812);
  page.SetDark(true);
  CHECK(page.Evaluate("document.documentElement.scrollWidth <= innerWidth").get<bool>());
  CHECK(page.Evaluate("getComputedStyle(document.body).color") == "rgb(230, 231, 234)");
  REQUIRE(InContact(AwaitPush(page, pair, InContact)));
  CHECK(page.Screenshot("view-phone-dark").size() > kEmptyPng);
  // Every button can be reached and says what it does.
  CHECK(page.Evaluate("[...document.querySelectorAll('button')].every("
                      "(b) => b.tabIndex >= 0 && b.textContent.trim() && b.title)")
            .get<bool>());
}

TEST_CASE("interpolation moves monotonically at 5 Hz where the raw view steps") {
  WatchedPair pair({"loop.rate_hz=5"});
  pair.StartWorld();
  pair.StartViewer();
  Chromium page(pair.url(), kWidth, kHeight);
  const auto shows_block = [](const json& picture) {
    return picture["bodies"].size() == 2 && picture["bodies"][1]["position"][0].is_number();
  };
  const json scene = AwaitPicture(page, shows_block);
  REQUIRE(shows_block(scene));
  const std::size_t place = MovingPlace(scene);
  const double start = scene["bodies"][place]["position"][0];
  pair.StartHaptic();  // the first push is seen from its beginning
  const auto pushed = [&](const json& picture) {
    return std::abs(picture["bodies"][place]["position"][0].get<double>() - start) > 0.05;
  };
  REQUIRE(pushed(AwaitPicture(page, pushed)));

  // Both ways to draw it, over the same remembered seconds, at moments of our own, every 10 ms, which no
  // load of the machine can thin out: [frame before the moment, x].
  const json look = page.Evaluate("({ frames: rikiseki.frames(), smooth: rikiseki.sweep(" +
                                  std::to_string(place) + ", true, 10e6), raw: rikiseki.sweep(" +
                                  std::to_string(place) + ", false, 10e6) })");
  std::map<std::uint64_t, double> x_of_frame;
  for (const json& frame : look["frames"]) {
    x_of_frame[frame["number"]] = frame["bodies"][place][0];
  }
  const auto moves = [](const json& sweep) {
    int count = 0;
    for (std::size_t i = 1; i < sweep.size(); ++i) {
      const double way = sweep[i][1].get<double>() - sweep[i - 1][1].get<double>();
      if (std::abs(way) > 1e-6) ++count;
    }
    return count;
  };
  const json& smooth = look["smooth"];
  REQUIRE(smooth.size() > 40);
  for (std::size_t i = 1; i < smooth.size(); ++i) {
    const std::uint64_t frame = smooth[i][0];
    if (smooth[i - 1][0] != frame || !x_of_frame.contains(frame + 1)) continue;
    // From one frame to the next it goes one way.
    const double whole = x_of_frame[frame + 1] - x_of_frame[frame];
    const double way = smooth[i][1].get<double>() - smooth[i - 1][1].get<double>();
    CHECK(way * whole >=
          -1e-15);  // rounding of a cubic of numbers below 1 m, times a way below 1 m
  }
  CHECK(moves(look["raw"]) >= 1);
  // 20 moments from frame to frame, where the raw view steps once; fewer where it comes to rest.
  CHECK(moves(smooth) > 5 * moves(look["raw"]));

  // And the button does it.
  page.Press("i");
  CHECK_FALSE(AwaitPicture(
      page, [](const json& picture) { return !picture["interpolate"]; })["interpolate"]);
}

TEST_CASE("the banner says when and why there is no force, and the page recovers by itself") {
  WatchedPair pair;
  pair.StartAll();
  Chromium page(pair.url(), kWidth, kHeight);
  REQUIRE(ShowsScene(AwaitPicture(page, ShowsScene)));
  const auto says = [](const std::string& words) {
    return [words](const json& picture) {
      return picture["banner"].get<std::string>().find(words) != std::string::npos;
    };
  };

  pair.world->Signal(SIGKILL);
  pair.world->Wait();
  const json lost = AwaitPicture(page, says("No force (world_"));
  CHECK(says("No force (world_")(lost));
  CHECK(page.Screenshot("view-world-killed").size() > kEmptyPng);
  pair.StartWorld();
  CHECK(ShowsScene(AwaitPicture(page, ShowsScene)));
  REQUIRE(InContact(AwaitPush(page, pair, InContact)));

  pair.haptic->Signal(SIGKILL);
  pair.haptic->Wait();
  CHECK(says("no haptic server runs")(AwaitPicture(page, says("no haptic server runs"))));
  pair.StartHaptic();
  CHECK(ShowsScene(AwaitPicture(page, ShowsScene)));

  pair.viewer->Signal(SIGKILL);
  pair.viewer->Wait();
  CHECK(says("The viewer does not answer")(AwaitPicture(page, says("The viewer does not answer"))));
  pair.StartViewer();
  const json again = AwaitPicture(page, ShowsScene);
  CHECK(ShowsScene(again));
  const json moving =
      AwaitPicture(page, [&](const json& picture) { return picture["ticks"] > again["ticks"]; });
  CHECK(moving["ticks"] > again["ticks"]);

  pair.viewer->Signal(SIGTERM);
  CHECK(pair.viewer->Wait() == 0);
}
