// The live view in headless Chromium against the real pair: what the page shows is what stands in shared
// memory. Screenshots stay in the artefacts folder of the build.
#include <signal.h>

#include <atomic>
#include <catch2/catch.hpp>
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

constexpr int kWidth = 640;
constexpr int kHeight = 360;
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
         picture["bodies"][1]["drawn"] > 0 && picture["bodies"][1]["position"][0].is_number() && picture["frames"] > 2 &&
         picture["fingers"].size() == 1 && picture["banner"] == "";
}

/// Two looks at one moment: the picture, and the frames that the page remembers.
json PictureAndFrames(Chromium& page) {
  return page.Evaluate("({ picture: rikiseki.picture(), frames: rikiseki.frames() })");
}

}  // namespace

TEST_CASE("the picture is what stands in shared memory: block, planes, force, impulses, copies") {
  WatchedPair pair;
  pair.StartWorld();
  pair.StartHaptic();
  pair.StartViewer();
  const BodyWatch bodies(pair.instance());
  const TickWatch ticks(pair.instance(), kSlewLimit);
  Chromium page(pair.url(), kWidth, kHeight);
  const json scene = AwaitPicture(page, ShowsScene);
  REQUIRE(ShowsScene(scene));
  CHECK(scene["complaint"] == "");
  const std::size_t place = MovingPlace(scene);

  // The first contact, the page's own clock stopped to look at it.
  const json contact = AwaitPicture(page, InContact);
  REQUIRE(InContact(contact));
  CHECK(page.Screenshot("view-contact").size() > kEmptyPng);
  std::map<std::uint64_t, WatchedTick> by_tick;
  for (const WatchedTick& tick : ticks.All()) by_tick[tick.tick] = tick;
  const auto shown_tick = contact["tick"].get<std::uint64_t>();
  REQUIRE(by_tick.contains(shown_tick));
  CHECK(contact["fingers"][0]["force"][0] == by_tick[shown_tick].force_x);  // to the bit
  CHECK(contact["fingers"][0]["position"][0] == by_tick[shown_tick].finger_x);
  // The proxy is on the surface, where the finger's centre is pressed away from: along the force.
  const double pressed = contact["fingers"][0]["position"][0].get<double>() -
                         contact["fingers"][0]["proxy"][0].get<double>();
  CHECK(pressed >= 0);
  CHECK(contact["fingers"][0]["force"][0] < 0);

  const json flashing = AwaitPicture(page, [](const json& picture) {
    return picture["drawn"]["flashes"] > 0 && picture["drawn"]["ghosts"] > 0;
  });
  CHECK(flashing["drawn"]["flashes"] > 0);
  CHECK(flashing["drawn"]["ghosts"] > 0);

  // While the block moves, every frame that the page has is to the bit what the segment held, and the
  // block stands between the two frames about the moment shown.
  double least = 1e9;
  double most = -1e9;
  for (int i = 0; i < 400 && most - least < 0.02; ++i) {
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
  std::size_t compared = 0;
  for (const json& frame : remembered) {
    const auto found = held.find(frame["stamp"].get<std::uint64_t>());
    if (found == held.end()) continue;  // this watch slept through it
    ++compared;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(frame["bodies"][place][axis] == found->second[axis]);
    }
  }
  CHECK(compared > remembered.size() / 4);

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

TEST_CASE("pause and step back, by key; phone width and dark") {
  WatchedPair pair;
  pair.StartWorld();
  pair.StartHaptic();
  pair.StartViewer();
  Chromium page(pair.url(), kWidth, kHeight);
  REQUIRE(ShowsScene(AwaitPicture(page, ShowsScene)));
  REQUIRE(InContact(AwaitPicture(page, InContact)));

  page.Press(" ");
  const json paused = AwaitPicture(page, [](const json& picture) { return picture["paused"]; });
  REQUIRE(paused["paused"]);
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
  CHECK(forward["frame"].get<int>() == back["frame"].get<int>() + 1);
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
  REQUIRE(InContact(AwaitPicture(page, InContact)));
  CHECK(page.Screenshot("view-phone-dark").size() > kEmptyPng);
  // Every button can be reached and says what it does.
  CHECK(page.Evaluate("[...document.querySelectorAll('button')].every("
                      "(b) => b.tabIndex >= 0 && b.textContent.trim() && b.title)")
            .get<bool>());
}

TEST_CASE("interpolation moves monotonically at 5 Hz where the raw view steps") {
  WatchedPair pair({"loop.rate_hz=5"});
  pair.StartWorld();
  pair.StartHaptic();
  pair.StartViewer();
  Chromium page(pair.url(), kWidth, kHeight);
  const json scene = AwaitPicture(page, ShowsScene);
  REQUIRE(ShowsScene(scene));
  const std::size_t place = MovingPlace(scene);

  // Until the block has been pushed: then both views are drawn over the same remembered seconds, at
  // moments of our own, every 10 ms, which no load of the machine can thin out.
  const std::string x = "rikiseki.picture().bodies[" + std::to_string(place) + "].position[0]";
  const double start = page.Evaluate(x);
  REQUIRE(AwaitPicture(page, [&](const json& picture) {
            return picture["bodies"][place]["position"][0] > start + 0.05;
          })["bodies"][place]["position"][0] > start + 0.05);
  const auto sweep = [&](bool interpolate) {
    return page.Evaluate("rikiseki.sweep(" + std::to_string(place) + ", " +
                         (interpolate ? "true" : "false") + ", 10e6)");
  };
  const json smooth = sweep(true);
  const json raw = sweep(false);
  REQUIRE(smooth.size() > 100);
  int smooth_places = 0;
  int raw_places = 0;
  for (std::size_t i = 1; i < smooth.size(); ++i) {
    // Pushed along +x and braked by friction, the block never goes back.
    CHECK(smooth[i].get<double>() >= smooth[i - 1].get<double>() - 1e-6);
    smooth_places += smooth[i].get<double>() > smooth[i - 1].get<double>() + 1e-6 ? 1 : 0;
  }
  for (std::size_t i = 1; i < raw.size(); ++i) {
    raw_places += raw[i].get<double>() > raw[i - 1].get<double>() + 1e-6 ? 1 : 0;
  }
  CHECK(raw_places >= 1);
  CHECK(smooth_places >
        5 * raw_places);  // 20 moments between two frames, less where it comes to rest

  // And the button does it.
  page.Press("i");
  CHECK_FALSE(AwaitPicture(
      page, [](const json& picture) { return !picture["interpolate"]; })["interpolate"]);
}

TEST_CASE("the banner says when and why there is no force, and the page recovers by itself") {
  WatchedPair pair;
  pair.StartWorld();
  pair.StartHaptic();
  pair.StartViewer();
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
  REQUIRE(InContact(AwaitPicture(page, InContact)));

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
