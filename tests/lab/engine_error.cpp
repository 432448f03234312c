// SPDX-License-Identifier: MIT
#include "tests/lab/engine_error.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/lab/choose.h"
#include "tests/lab/pushed_shape.h"
#include "tests/lab/thread_cpu.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kFriction = 0.5;
constexpr double kSettling = 0.5;      // s, before anything moves
constexpr double kWorldPeriod = 0.05;  // s
constexpr double kEdge = 2 * kCubeHalf;
const Vec3 kTumblingInertia(1e-3, 2e-3, 3e-3);  // kg m^2

enum class Scenario { kSlide, kSpin, kTumble, kStack };
constexpr Named<Scenario> kScenarios[] = {{"slide", Scenario::kSlide},
                                          {"spin", Scenario::kSpin},
                                          {"tumble", Scenario::kTumble},
                                          {"stack", Scenario::kStack}};

struct Trial {
  Scenario scenario = Scenario::kSlide;
  double substep_s = 1e-3;
  int bodies = 1;         // of a stack
  double mass_ratio = 1;  // of the topmost to each other
};

world::Scene SceneOf(const Trial& trial) {
  world::Scene scene;
  scene.name = "engine-error";
  world::SceneBody floor;
  floor.name = "floor";
  floor.fixed = true;
  floor.colliders.push_back({.shape = world::HalfSpace{}, .friction = kFriction});
  scene.bodies.push_back(floor);
  for (int i = 0; i < trial.bodies; ++i) {
    const double mass_kg = i > 0 && i == trial.bodies - 1 ? trial.mass_ratio : 1;
    scene.bodies.push_back(
        MakePushed(PushedShape::kCube, mass_kg, kFriction, {0, 0, kCubeHalf + i * kEdge}));
  }
  if (trial.scenario == Scenario::kTumble) {
    scene.gravity.setZero();
    scene.bodies[1].pose_WB.position.z() = 10;
    scene.bodies[1].inertia = kTumblingInertia.asDiagonal();
  }
  return scene;
}

// The orientation of a body that nothing holds, `time_s` after it had `spin`: Euler's equations by
// Runge and Kutta, in steps whose error is below 1e-12.
Quat IntegrateTumble(const Mat3& inertia, const Vec3& spin, double time_s) {
  struct Motion {
    Eigen::Vector4d q;  // x y z w
    Vec3 spin_B;
  };
  const auto rate = [&](const Motion& motion) {
    const Quat q(motion.q);
    const Quat w(0, motion.spin_B.x(), motion.spin_B.y(), motion.spin_B.z());
    const Vec3 momentum = inertia * motion.spin_B;
    return Motion{0.5 * (q * w).coeffs(), inertia.inverse() * momentum.cross(motion.spin_B)};
  };
  const auto moved = [](const Motion& from, const Motion& by, double h) {
    return Motion{from.q + h * by.q, from.spin_B + h * by.spin_B};
  };
  constexpr int kSteps = 20'000;
  const double h = time_s / kSteps;
  Motion motion{Quat::Identity().coeffs(), spin};
  for (int i = 0; i < kSteps; ++i) {
    const Motion a = rate(motion);
    const Motion b = rate(moved(motion, a, h / 2));
    const Motion c = rate(moved(motion, b, h / 2));
    const Motion d = rate(moved(motion, c, h));
    motion.q += h / 6 * (a.q + 2 * b.q + 2 * c.q + d.q);
    motion.spin_B += h / 6 * (a.spin_B + 2 * b.spin_B + 2 * c.spin_B + d.spin_B);
  }
  return Quat(motion.q).normalized();
}

// One trial: the engine, and what its steps cost.
struct Run {
  explicit Run(const Trial& trial) : world(SceneOf(trial), trial.substep_s) {}

  void Step(double time_s) {
    const double start_s = ThreadCpu();
    for (long i = 0; i < std::lround(time_s / kWorldPeriod); ++i) {
      world.ApplyAndStep({}, kWorldPeriod);
    }
    cpu_s += ThreadCpu() - start_s;
    stepped_s += time_s;
  }
  Vec3 Place(std::size_t body) const { return world.State(body).pose.position; }

  world::BulletWorld world;
  double cpu_s = 0;
  double stepped_s = 0;
};

void Throw(world::BulletWorld& world, const Vec3& velocity, const Vec3& spin) {
  BodyState state = world.State(1);
  state.velocity = velocity;
  state.angular_velocity = spin;
  world.SetState(1, state);
}

double TurnAboutZ(const BodyState& state) {
  const Mat3 axes = state.pose.orientation.toRotationMatrix();
  return std::atan2(axes(1, 0), axes(0, 0));
}

// How far the engine is from the truth: m, or rad of spin and tumble.
double Error(const Trial& trial, Run& run) {
  if (trial.scenario != Scenario::kTumble) run.Step(kSettling);
  std::vector<Vec3> start;
  for (std::size_t i = 0; i < run.world.body_count(); ++i) start.push_back(run.Place(i));
  switch (trial.scenario) {
    case Scenario::kSlide: {
      const double speed = 2;  // m/s
      Throw(run.world, speed * Vec3::UnitX(), Vec3::Zero());
      run.Step(1);
      const double exact = speed * speed / (2 * kFriction * kGravity);
      return std::abs((run.Place(1) - start[1]).x() - exact);
    }
    case Scenario::kSpin: {
      // Each corner carries a quarter of the weight, at half the diagonal from the axis.
      const double arm = std::sqrt(2.0) * kCubeHalf;
      const double deceleration = kFriction * kGravity * arm / (kEdge * kEdge / 6);
      const double spin = 30;  // rad/s: it stops before half a turn
      Throw(run.world, Vec3::Zero(), spin * Vec3::UnitZ());
      run.Step(1);
      return std::abs(TurnAboutZ(run.world.State(1)) - spin * spin / (2 * deceleration));
    }
    case Scenario::kTumble: {
      const Vec3 spin(0.1, 10, 0.1);  // rad/s, about the axis that is not stable
      constexpr double kTime = 2;
      Throw(run.world, Vec3::Zero(), spin);
      run.Step(kTime);
      const Quat exact = IntegrateTumble(kTumblingInertia.asDiagonal(), spin, kTime);
      return run.world.State(1).pose.orientation.angularDistance(exact);
    }
    case Scenario::kStack: {
      // A nudge that must not topple it, so that it is not asleep.
      Throw(run.world, 0.01 * Vec3::UnitX(), Vec3::Zero());
      run.Step(5);
      double farthest = 0;
      for (std::size_t i = 1; i < start.size(); ++i) {
        farthest = std::max(farthest, (run.Place(i) - start[i]).norm());
      }
      return farthest;
    }
  }
  return 0;
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  Trial trial;
  trial.scenario = Choose(row, "scenario", kScenarios);
  trial.substep_s = row.Number("substep_s", 1e-5, kWorldPeriod);
  if (trial.scenario == Scenario::kStack) {
    trial.bodies = row.Integer("bodies", 1, 50);
    trial.mass_ratio = row.Number("mass_ratio", 1e-6, 1e6);
  }
  try {
    Run run(trial);
    const double error = Error(trial, run);
    const bool fell = trial.scenario == Scenario::kStack && !(error < kEdge / 2);
    return {fell || !std::isfinite(error) ? RowStatus::kUnstable : RowStatus::kOk,
            {error, run.cpu_s / run.stepped_s}};
  } catch (const std::invalid_argument& error) {
    row.Refuse("substep_s", error.what());
  }
}

Table Grid(bool quick) {
  Table table("the grid of engine-error", {"scenario", "substep_s", "bodies", "mass_ratio"});
  for (const double substep_s :
       quick ? std::vector{1e-3, 5e-3} : std::vector{2.5e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2}) {
    for (const char* scenario : {"slide", "spin", "tumble"}) {
      table.Append({scenario, ToField(substep_s), "", ""});
    }
    for (const int bodies : quick ? std::vector{3} : std::vector{3, 10}) {
      for (const double ratio :
           quick ? std::vector{1.0, 100.0} : std::vector{0.01, 1.0, 10.0, 100.0, 300.0}) {
        table.Append({"stack", ToField(substep_s), std::to_string(bodies), ToField(ratio)});
      }
    }
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "Error of the engine [m of slide and stack, rad of spin and tumble], CPU s per s\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (outcomes[i].values.size() != 2) continue;
    const Row row = rows.row(i);
    out << row.Text("scenario") << " " << row.Find("bodies").value_or("") << " "
        << row.Find("mass_ratio").value_or("") << " substep " << row.Text("substep_s") << " s: ";
    if (outcomes[i].status == RowStatus::kUnstable) {
      out << "fell";
    } else {
      out << outcomes[i].values[0];
    }
    out << ", " << outcomes[i].values[1] << "\n";
  }
}

}  // namespace

Case EngineError() {
  Case study;
  study.name = "engine-error";
  study.purpose = "the engine's own error and CPU by its substep: slide, spin, tumble, stack";
  study.results = {{"error"}, {"cpu_s_per_s"}};
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
