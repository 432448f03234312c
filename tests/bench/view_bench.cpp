// SPDX-License-Identifier: MIT
// What the live view costs: pictures per second of 1000 cubes under software rendering, and the lateness of
// the pair's loops with four clients on the live stream and without, by turns.
#include <catch2/catch.hpp>
#include <cstdio>
#include <thread>

#include "common/histogram.h"
#include "tests/browser/raw_client.h"
#include "tests/browser/watched_pair.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)

constexpr auto kTurn = std::chrono::seconds(5);
constexpr int kTurns = 6;  // of each kind

/// Takes in the live stream as fast as it comes: one word for every so many bytes of it.
class LiveClient {
 public:
  explicit LiveClient(int port) : client_(port) {
    client_.Send(LiveRequest(port));
    thread_ = std::thread([this] {
      while (!stop_) {
        if (!client_.Read(4096, 0.05).empty()) client_.Send(std::string("\x81\x81\0\0\0\0+", 7));
      }
    });
  }
  ~LiveClient() {
    stop_ = true;
    thread_.join();
  }

 private:
  RawClient client_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Lateness {
  protocol::Histogram haptic{};
  protocol::Histogram world{};
};

void AddGrowth(const protocol::Histogram& now, const protocol::Histogram& before,
               protocol::Histogram& sum) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += now[i] - before[i];
}

void Print(const char* what, const protocol::Histogram& lateness) {
  const auto us = [&](double fraction) {
    return static_cast<double>(HistogramQuantile(lateness, fraction)) * 1e-3;
  };
  std::printf("%-28s p50 %8.0f  p99 %8.0f  p99.9 %8.0f  max %8.0f us  (%llu)\n", what, us(0.5),
              us(0.99), us(0.999), us(1),
              static_cast<unsigned long long>(HistogramTotal(lateness)));
}

}  // namespace

TEST_CASE("pictures per second of a thousand cubes at 640x360") {
  WatchedPair pair({}, "config/scenes/thousand.sdf");
  pair.StartAll();
  Chromium page(pair.url(), 640 + 320, 360 + 120);  // with charts and buttons
  const auto picture = AwaitPicture(page, [](const nlohmann::json& shown) {
    return shown["bodies"].size() > 900 && shown["frames"] > 20 && shown["fps"] > 0;
  });
  REQUIRE(picture["bodies"].size() > 900);
  std::this_thread::sleep_for(kTurn);
  const auto size = page.Evaluate(
      "[document.getElementById('view').width, document.getElementById('view').height]");
  double sum = 0;
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));
    sum += Picture(page)["fps"].get<double>();
  }
  std::printf("%zu bodies, canvas %d x %d: %.1f pictures/s\n", picture["bodies"].size(),
              size[0].get<int>(), size[1].get<int>(), sum / 10);
  page.Screenshot("view-thousand");
}

TEST_CASE("lateness of the pair with and without four clients, by turns") {
  WatchedPair pair({}, "config/scenes/thousand.sdf");
  pair.StartAll();
  const auto haptic = Observe(pair.instance(), protocol::Role::kHaptic, 60);
  const auto world = Observe(pair.instance(), protocol::Role::kWorld, 60);
  Lateness alone;
  Lateness watched;
  for (int turn = 0; turn < 2 * kTurns; ++turn) {
    std::vector<std::unique_ptr<LiveClient>> clients;
    for (int i = 0; i < 4 * (turn % 2); ++i) {
      clients.push_back(std::make_unique<LiveClient>(pair.port()));
    }
    const auto haptic_before = ReadHapticHealth(*haptic).lateness;
    const auto world_before = ReadWorldHealth(*world).lateness;
    std::this_thread::sleep_for(kTurn);
    Lateness& sum = turn % 2 == 0 ? alone : watched;
    AddGrowth(ReadHapticHealth(*haptic).lateness, haptic_before, sum.haptic);
    AddGrowth(ReadWorldHealth(*world).lateness, world_before, sum.world);
  }
  Print("haptic, nobody looks on", alone.haptic);
  Print("haptic, four clients", watched.haptic);
  Print("world, nobody looks on", alone.world);
  Print("world, four clients", watched.world);
}
