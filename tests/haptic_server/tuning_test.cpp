// SPDX-License-Identifier: MIT
#include "haptic_server/tuning.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <thread>

#include "tests/common/tuning_page.h"

namespace rikiseki::haptic {
namespace {

ConfigValues ValuesWith(const std::vector<std::string>& set) {
  ConfigValues values;
  LoadSettings(std::string(RIKISEKI_SOURCE_DIR) + "/config/haptic_server.ini", set, nullptr,
               &values);
  return values;
}

// Something else that is allowed beside the shipped values.
double Other(const std::string& key, double value) {
  return key == "safety.force_cap_n" || key == "safety.fade_ms" ? value / 2 : 2 * value;
}

TEST_CASE("each live key is a key of the files, and moves its own value of the tuning alone") {
  const ConfigValues shipped = ValuesWith({});
  Settings settings =
      LoadSettings(std::string(RIKISEKI_SOURCE_DIR) + "/config/haptic_server.ini", {});
  const Tuning start = TuningOf(settings);
  for (const std::string& key : LiveKeys()) {
    CAPTURE(key);
    REQUIRE(shipped.count(key) == 1);
    const double other = Other(key, std::stod(shipped.at(key)));
    const Settings changed =
        LoadSettings(std::string(RIKISEKI_SOURCE_DIR) + "/config/haptic_server.ini",
                     {key + "=" + std::to_string(other)});
    const Tuning tuning = TuningOf(changed);
    CHECK_FALSE(tuning == start);
    Settings adopted = settings;
    Adopt(tuning, adopted);
    CHECK(TuningOf(adopted) == tuning);
    CHECK(Between(start, tuning, 0) == start);
    CHECK(Between(start, tuning, 1) == tuning);
    CHECK_FALSE(Between(start, tuning, 0.5) == start);
    CHECK_FALSE(Between(start, tuning, 0.5) == tuning);
  }
}

TEST_CASE("the page on tuning has every key of the haptic server, and says which are live") {
  for (const auto& [key, value] : ValuesWith({})) CheckTuningPage(key, LiveKeys());
}

TEST_CASE("the ramp takes its time and ends exactly at its target") {
  Tuning start;
  start.stiffness_n_per_m = 1000;
  Tuning target = start;
  target.stiffness_n_per_m = 3000;
  TuningRamp ramp(start, 1e-3);
  CHECK_FALSE(ramp.moves());
  ramp.Start(target);
  double before = 1000;
  int steps = 0;
  while (ramp.moves()) {
    const double now = ramp.Advance().stiffness_n_per_m;
    CHECK(now - before == Approx(4));  // 2000 N/m in 500 ticks
    before = now;
    ++steps;
  }
  CHECK(before == 3000);
  // 500 additions of 0.002 may end a rounding error below 1.
  CHECK(steps >= 500);
  CHECK(steps <= 501);
}

TEST_CASE("the slot hands over whole tunings, each once, and refuses while one is on its way") {
  TuningSlot slot;
  Tuning taken;
  CHECK_FALSE(slot.Take(taken));
  Tuning first;
  first.force_cap_n = 1;
  REQUIRE(slot.Offer(first));
  CHECK_FALSE(slot.Offer(Tuning{}));
  REQUIRE(slot.Take(taken));
  CHECK(taken == first);
  CHECK_FALSE(slot.Take(taken));

  constexpr int kOffers = 20000;
  std::atomic<int> torn{0};
  int count = 0;
  std::thread loop([&] {
    Tuning tuning;
    while (count < kOffers) {
      if (!slot.Take(tuning)) continue;
      ++count;
      if (tuning.stiffness_n_per_m != count || tuning.velocity_cutoff_hz != count) ++torn;
    }
  });
  for (int i = 1; i <= kOffers; ++i) {
    Tuning tuning;
    tuning.stiffness_n_per_m = tuning.velocity_cutoff_hz = i;
    while (!slot.Offer(tuning)) std::this_thread::yield();
  }
  loop.join();
  CHECK(torn == 0);
}

}  // namespace
}  // namespace rikiseki::haptic
