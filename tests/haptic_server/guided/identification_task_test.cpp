// SPDX-License-Identifier: MIT
#include "haptic_server/guided/identification_task.h"

#include <catch2/catch.hpp>
#include <map>

#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/guided/simulated_hands.h"
#include "tests/haptic_server/guided/guided_drive.h"

namespace rikiseki::haptic {
namespace {

struct Truth {
  double mass_kg;
  double damping;
  double friction_n;
  double latency_us;
};

Settings DeviceWith(const Truth& truth) {
  Settings settings;
  settings.spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                              Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  settings.spidar.moving_mass_kg = truth.mass_kg;
  settings.spidar.friction_damping_ns_per_m = truth.damping;
  settings.spidar.friction_n = truth.friction_n;
  settings.spidar.latency_us = truth.latency_us;
  return settings;
}

std::map<std::string, double> Values(const Finding& finding) {
  std::map<std::string, double> values;
  for (const auto& [key, value] : finding.values) values[key] = std::stod(value);
  return values;
}

TEST_CASE("identification finds mass, damping, friction and latency of the simulated device") {
  const Truth truth =
      GENERATE(Truth{0.03, 0.2, 0, 0}, Truth{0.03, 0.2, 0.1, 0}, Truth{0.03, 0.2, 0.1, 700},
               Truth{0.1, 0.5, 0.3, 1500}, Truth{0.15, 1, 0.2, 2000}, Truth{0.02, 0.1, 0.05, 300});
  CAPTURE(truth.mass_kg, truth.damping, truth.friction_n, truth.latency_us);
  const Settings settings = DeviceWith(truth);
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  IdentificationTask task(settings, device);
  CHECK(Drive(task, 30) < 30'000);
  const Finding finding = task.Result();
  INFO(finding.text);
  std::map<std::string, double> found = Values(finding);
  // 5 % of each, and where there is next to none of it, 5 % of what would matter.
  CHECK(found["spidar.moving_mass_kg"] == Approx(truth.mass_kg).epsilon(0.05));
  CHECK(found["spidar.friction_damping_ns_per_m"] == Approx(truth.damping).epsilon(0.05));
  CHECK(found["spidar.friction_n"] == Approx(truth.friction_n).epsilon(0.05).margin(0.005));
  CHECK(found["spidar.latency_us"] == Approx(truth.latency_us).epsilon(0.05).margin(50));
}

TEST_CASE("a grip that is held is not taken for the device") {
  Settings settings = DeviceWith({0.03, 0.2, 0, 0});
  settings.hand.script = HandScript::kStir;
  settings.hand.home_mm = Vec3::Zero();
  settings.hand.stroke_mm = Vec3(20, 20, 20);
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, MakeHand(settings)));
  IdentificationTask task(settings, device);
  Drive(task, 30);
  CHECK_THROWS_WITH(task.Result(), Catch::Contains("did somebody hold the grip?"));
}

// Watches what a procedure does to a device.
class Watched final : public Device {
 public:
  explicit Watched(Device& device) : device_(device) {}
  DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept override {
    return device_.Read(now_ns, sample);
  }
  Vec3 Write(const Vec3& force) noexcept override {
    largest_force = std::max(largest_force, force.norm());
    largest_step = std::max(largest_step, (force - last_).norm());
    last_ = force;
    return device_.Write(force);
  }
  void Release() noexcept override {
    ++releases;
    device_.Release();
  }
  std::string Name() const override { return device_.Name(); }

  double largest_force = 0;
  double largest_step = 0;
  int releases = 0;

 private:
  Device& device_;
  Vec3 last_ = Vec3::Zero();
};

TEST_CASE("the shaking stays within cap and slew limit, and a stop ends it") {
  Settings settings = DeviceWith({0.03, 0.2, 0.1, 0});
  settings.safety.force_cap_n = 1;
  Spidar device(settings.spidar,
                std::make_unique<SimulatedBoard>(settings.spidar, AbsentHand(settings)));
  Watched watched(device);
  IdentificationTask task(settings, watched);
  Drive(task, 8);
  CHECK(watched.largest_force > 0.3);
  CHECK(watched.largest_force <= 1);
  CHECK(watched.largest_step <= settings.safety.slew_limit_n_per_s * 1e-3);
  CHECK(watched.releases == 0);
  CHECK_FALSE(
      task.Tick({.start_ns = 9'000'000'000, .previous_duration_ns = 1'000'000}, {.stop = true}));
  CHECK(watched.releases > 0);
  CHECK_THROWS_AS(task.Result(), NothingFound);
}

}  // namespace
}  // namespace rikiseki::haptic
