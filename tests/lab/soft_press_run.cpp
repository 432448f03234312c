// SPDX-License-Identifier: MIT
#include "tests/lab/soft_press_run.h"

#include <algorithm>
#include <cmath>

#include "haptic_server/device/hand.h"
#include "tests/lab/prescribed_device.h"
#include "tests/world_server/scenes.h"
#include "world_server/physics/deformable_world.h"

namespace rikiseki::lab {
namespace {

// Of the press, on no line of symmetry.
const Vec3 kPlace(0.003, 0.004, kSoftTop);
const Vec3 kPlaceInBody = kPlace - kSoftTop / 2 * Vec3::UnitZ();

constexpr double kDownAt = 0.3;  // s
constexpr double kGap = 0.005;   // m, between finger and block until then

double Compliance(const world::Scene& scene) {
  const auto dynamics = world::MakeDynamics(scene, 1e-3);
  return dynamics->FindSoft(1)->YieldAt(kPlaceInBody, Vec3::UnitZ()).compliance_m_per_n;
}

}  // namespace

haptic::Settings SoftSettings() {
  haptic::Settings settings;
  settings.loop.longest_world_period_ms = 200;
  return settings;
}

world::Scene SoftBlock(double youngs_modulus_pa) {
  world::Scene scene;
  scene.name = "soft block";
  scene.gravity.setZero();
  world::SceneBody block = world::test::Cube(kSoftTop, 0.06, 0.5, {0, 0, kSoftTop / 2});
  block.colliders[0].shape = world::Box{Vec3(0.04, 0.04, kSoftTop / 2)};
  block.softness = world::Softness{.youngs_modulus_pa = youngs_modulus_pa, .element_m = 0.015};
  scene.bodies = {world::test::Floor(0.3), block};
  return scene;
}

std::unique_ptr<CoupledRun> StartSoft(const haptic::Settings& settings, const SoftLoops& loops,
                                      const world::Scene& scene, haptic::Device& device) {
  world::Settings world;
  world.loop.rate_hz = loops.rate_hz;
  world.coupling.coupling = loops.coupling;
  const auto latency = static_cast<int>(std::lround(loops.latency_periods * 1000 / loops.rate_hz));
  return std::make_unique<CoupledRun>(settings, device, world, scene,
                                      world::MakeDynamics(scene, 1e-3), 0, latency);
}

double ForceOf(const CoupledRun& run) {
  return ToVec3(run.haptic_tick().pointers[0].force).norm();
}

SoftPressed RunSoftPress(const SoftPress& press) {
  const world::Scene scene = SoftBlock(press.youngs_modulus_pa);
  const haptic::Settings settings = SoftSettings();
  const double compliance = Compliance(scene);
  const double series = 1 / (1 / settings.render.stiffness_n_per_m + compliance);
  const double depth = std::min(0.008, press.force_n / series);
  PrescribedDevice finger(
      [&](double t_s) -> Vec3 {
        const double down = haptic::MinimumJerk((t_s - kDownAt) / 0.2);
        return kPlace + (kSoftFinger + kGap - (kGap + depth) * down) * Vec3::UnitZ();
      },
      CoupledRun::StartNs(settings));
  const auto run = StartSoft(settings, press.loops, scene, finger);
  SoftPressed got{.expected_n = series * depth, .least_n = HUGE_VAL};
  for (int k = 0; k < 1500; ++k) {
    run->Tick();
    if (k < 1000) continue;
    got.least_n = std::min(got.least_n, ForceOf(*run));
    got.most_n = std::max(got.most_n, ForceOf(*run));
  }
  got.dent_m = compliance * (got.least_n + got.most_n) / 2;
  got.flagged = run->haptic_health().energy.flagged != 0;
  got.books = run->haptic_health().books;
  return got;
}

}  // namespace rikiseki::lab
