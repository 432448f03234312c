// A soft block under the finger in both step functions, in virtual time: the force is that of the two
// springs in series, at any world rate, latency and coupling, and nothing buzzes.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "haptic_server/device/hand.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/ideal_device.h"
#include "tests/lab/prescribed_device.h"
#include "tests/world_server/scenes.h"
#include "world_server/physics/deformable_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kTop = 0.06;     // m, of the block that stands on the floor
constexpr double kRadius = 0.01;  // m, of the finger

// 80 x 80 x 60 mm, without weight: its surface is exactly where its box is.
world::Scene SoftBlock(double youngs_modulus_pa) {
  world::Scene scene;
  scene.name = "soft block";
  scene.gravity.setZero();
  world::SceneBody block = world::test::Cube(kTop, 0.06, 0.5, {0, 0, kTop / 2});
  block.colliders[0].shape = world::Box{Vec3(0.04, 0.04, kTop / 2)};
  block.softness = world::Softness{.youngs_modulus_pa = youngs_modulus_pa, .element_m = 0.015};
  scene.bodies = {world::test::Floor(0.3), block};
  return scene;
}

struct Loops {
  double rate_hz = 20;
  double latency_periods = 0;
  protocol::Coupling coupling = protocol::Coupling::kLocal;
};

struct Settings {
  haptic::Settings haptic;
  world::Settings world;
};

Settings SettingsOf(const Loops& loops) {
  Settings settings;
  settings.world.loop.rate_hz = loops.rate_hz;
  settings.world.coupling.coupling = loops.coupling;
  settings.haptic.loop.longest_world_period_ms = 200;
  return settings;
}

std::unique_ptr<CoupledRun> Start(const Settings& settings, const Loops& loops,
                                  const world::Scene& scene, haptic::Device& device) {
  const auto latency = static_cast<int>(std::lround(loops.latency_periods * 1000 / loops.rate_hz));
  return std::make_unique<CoupledRun>(settings.haptic, device, settings.world, scene,
                                      world::MakeDynamics(scene, 1e-3), 0, latency);
}

double ForceOf(const CoupledRun& run) {
  return ToVec3(run.haptic_tick().pointers[0].force).norm();
}

// N/m, of finger and body in series, at a place of the top.
double Series(const world::Scene& scene, double x, double y, double spring) {
  const auto dynamics = world::MakeDynamics(scene, 1e-3);
  const world::SoftSurface::Yield yield =
      dynamics->FindSoft(1)->YieldAt({x, y, kTop / 2}, Vec3::UnitZ());
  return 1 / (1 / spring + yield.compliance_m_per_n);
}

void CheckBooks(const CoupledRun& run) {
  const protocol::Books& books = run.haptic_health().books;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto pending = books.displayed[i] - books.covered[i] - books.peer_lost[i];
    const double pending_ns = static_cast<double>(pending) * protocol::kImpulseUnit;
    CHECK(std::abs(pending_ns) < 1);  // what the world has not acknowledged yet
    CHECK(books.covered[i] == books.applied[i] + books.discarded[i]);
    CHECK(books.discarded[i] == 0);
  }
  CHECK(books.applied[2] != 0);
}

}  // namespace

TEST_CASE("a static press gives the force of the two springs in series") {
  for (const double e : {3e3, 8e3, 1e6}) {
    const world::Scene scene = SoftBlock(e);
    for (const double rate_hz : {10.0, 20.0, 60.0}) {
      for (const double latency : {0.0, 1.0, 2.0}) {
        const Loops loops{.rate_hz = rate_hz, .latency_periods = latency};
        CAPTURE(e, rate_hz, latency);
        const Settings settings = SettingsOf(loops);
        const double series =
            Series(scene, 0.003, 0.004, settings.haptic.render.stiffness_n_per_m);
        const double depth = std::min(0.008, 4 / series);
        const std::int64_t start_ns = CoupledRun::StartNs(settings.haptic);
        PrescribedDevice finger(
            [&](double t_s) {
              const double down = haptic::MinimumJerk((t_s - 0.3) / 0.2);
              return Vec3(0.003, 0.004, kTop + kRadius + 0.005 - (0.005 + depth) * down);
            },
            start_ns);
        const auto run = Start(settings, loops, scene, finger);
        double least = 1e9, most = 0;
        for (int k = 0; k < 1500; ++k) {
          run->Tick();
          if (k < 1000) continue;
          least = std::min(least, ForceOf(*run));
          most = std::max(most, ForceOf(*run));
        }
        // The plane of the mesh's unloaded surface and its compliance are exact; what is left is the
        // pad's place, which the nearest point of the dented surface shifts.
        CHECK(least == Approx(series * depth).epsilon(0.01));
        CHECK(most == Approx(series * depth).epsilon(0.01));
        CHECK(run->haptic_health().energy.flagged == 0);
        CheckBooks(*run);
      }
    }
  }
}

}  // namespace rikiseki::lab
