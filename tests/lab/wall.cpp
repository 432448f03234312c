// SPDX-License-Identifier: MIT
#include "tests/lab/wall.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <vector>

#include "common/clock.h"
#include "haptic_server/device/hand.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/feature_track.h"
#include "haptic_server/render/surface_force.h"
#include "tests/lab/wall_run.h"

namespace rikiseki::lab {
namespace {

constexpr double kDepth = 0.01;           // m, of the steady contact
constexpr double kSimulatedKappa = 1e-3;  // numerics section 6: below, growth is too slow to tell
constexpr double kMargin = 0.03;          // of K_max, on both sides

// x_k, v_k, x_(k-1) .. x_(k-d-1), relative to the face and at most a few centimetres.
using LoopState = Eigen::VectorXd;

haptic::ImpedanceStep DeviceStep(const WallLoop& loop) {
  return haptic::ExactStep({loop.mass_kg, loop.damping_ns_per_m, 0}, loop.period_s);
}

// The force on the device when the samples of two ticks are x_before and x.
double DisplayedForce(const WallLoop& loop, double stiffness, double x_before, double x) {
  haptic::RenderSettings settings;
  settings.stiffness_n_per_m = stiffness;
  settings.damping_ns_per_m = loop.wall_damping_ns_per_m;
  settings.adhesion = true;
  haptic::SurfaceForce surface_force(settings, loop.period_s);
  haptic::Surface surface;
  surface.plane = {Vec3::Zero(), -Vec3::UnitX()};
  double force = 0;
  for (const double sample : {x_before, x}) {
    const auto contact = haptic::SolveContact(Vec3(sample, 0, 0), 0, {&surface.plane, 1});
    force = 0;
    for (const haptic::BodyShare& share : surface_force.Update({&surface, 1}, contact, 0, 1)) {
      force += share.force.x();
    }
  }
  return force;
}

LoopState Tick(const WallLoop& loop, const haptic::ImpedanceStep& device, double stiffness,
               const LoopState& state) {
  // Positions in the order of their age.
  const auto position = [&](int age) { return state[age == 0 ? 0 : age + 1]; };
  const double force = DisplayedForce(loop, stiffness, position(loop.delay_samples + 1),
                                      position(loop.delay_samples));
  LoopState next(state.size());
  next[0] = state[0] + device.yv * state[1] + device.yf * force;
  next[1] = device.vv * state[1] + device.vf * force;
  for (int age = 1; age <= loop.delay_samples + 1; ++age) next[age + 1] = position(age - 1);
  return next;
}

}  // namespace

double SpectralRadius(const WallLoop& loop, double stiffness_n_per_m) {
  const haptic::ImpedanceStep device = DeviceStep(loop);
  const Eigen::Index size = loop.delay_samples + 3;
  LoopState steady = LoopState::Constant(size, kDepth);
  steady[1] = 0;
  const LoopState base = Tick(loop, device, stiffness_n_per_m, steady);
  Eigen::MatrixXd transition(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    // Half the depth, so that the contact holds; speeds as positions per tick.
    const double deviation = i == 1 ? kDepth / 2 / loop.period_s : kDepth / 2;
    LoopState moved = steady;
    moved[i] += deviation;
    transition.col(i) = (Tick(loop, device, stiffness_n_per_m, moved) - base) / (kDepth / 2);
  }
  transition.row(1) *= loop.period_s;
  return transition.eigenvalues().cwiseAbs().maxCoeff();
}

double LargestStiffness(const WallLoop& loop) {
  // A polynomial of degree d + 3 with all roots within the unit circle has no coefficient above
  // 2^(d + 3), and (K + B/T) times the device's response to a force is one.
  const double high = std::exp2(loop.delay_samples + 4) / DeviceStep(loop).yf;
  const double low = 1e-8 * loop.mass_kg / (loop.period_s * loop.period_s);
  constexpr double kStep = 1.01;
  double unstable = high;
  double stable = high / kStep;
  while (stable >= low && !(SpectralRadius(loop, stable) <= 1)) {
    unstable = stable;
    stable /= kStep;
  }
  if (stable < low) return 0;
  while (unstable - stable > 1e-9 * stable) {
    const double middle = (stable + unstable) / 2;
    (SpectralRadius(loop, middle) <= 1 ? stable : unstable) = middle;
  }
  return stable;
}

double LinearRule(const WallLoop& loop) {
  return (loop.damping_ns_per_m + loop.wall_damping_ns_per_m) /
         (loop.period_s * (0.5 + loop.delay_samples));
}

double PassivityBound(const WallLoop& loop) {
  if (loop.delay_samples > 0) return 0;
  return std::max(0.0, 2 * (loop.damping_ns_per_m - loop.wall_damping_ns_per_m) / loop.period_s);
}

bool StaysInContact(const WallLoop& loop, double stiffness_n_per_m) {
  constexpr double kNudge = 1e-3;  // of the depth
  const WallSurface wall{.period_s = loop.period_s,
                         .stiffness_n_per_m = stiffness_n_per_m,
                         .damping_ns_per_m = loop.wall_damping_ns_per_m};
  const std::int64_t period_ns = WallRun::HapticSettings(wall).period_ns();
  // It starts in the wall, whose surface then rises to its place within the recovery time.
  const auto wait = static_cast<std::int64_t>(1.2 * haptic::kRecoveryTime / loop.period_s) + 2;
  PressedDevice device({.impedance = {loop.mass_kg, loop.damping_ns_per_m, 0},
                        .start_m = kDepth * (1 + kNudge),
                        .press_n = stiffness_n_per_m * kDepth,
                        .release_ns = (kMeetingTicks + wait) * period_ns,
                        .delay_samples = loop.delay_samples});
  WallRun run(wall, device);
  for (std::int64_t k = 0; k <= wait; ++k) run.Tick();

  // Long enough for a factor of e^3 in the middle of the four quarters, as far as that is known.
  const double growth = std::abs(std::log(SpectralRadius(loop, stiffness_n_per_m)));
  const auto quarter = static_cast<std::int64_t>(std::clamp(1.5 / growth, 500.0, 200'000.0));
  const double frequency = std::sqrt(stiffness_n_per_m / loop.mass_kg);
  double early = 0;
  double late = 0;
  for (std::int64_t k = 0; k < 4 * quarter; ++k) {
    run.Tick();
    const double size =
        std::hypot(device.position() - kDepth, device.velocity() / frequency) / kDepth;
    if (!(size < 0.5)) return false;
    if (k / quarter == 1) early = std::max(early, size);
    if (k / quarter == 3) late = std::max(late, size);
  }
  return late <= early;
}

namespace {

enum Result : std::size_t { kLargest, kLinear, kPassive, kKappa, kBracketed };

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  WallLoop loop;
  loop.period_s = row.Number("T_s", 1e-5, 0.1);
  loop.mass_kg = row.Number("m_kg", 1e-4, 1e4);
  loop.damping_ns_per_m = row.Number("b_Ns_m", 0, 1e4);
  loop.wall_damping_ns_per_m = row.Number("B_Ns_m", 0, 1e5);
  loop.delay_samples = row.Integer("delay_samples", 0, 20);
  const double largest = LargestStiffness(loop);
  const double kappa = largest * loop.period_s * loop.period_s / loop.mass_kg;
  std::string verdict;
  if (kappa > kSimulatedKappa) {
    const bool bracketed = StaysInContact(loop, (1 - kMargin) * largest) &&
                           !StaysInContact(loop, (1 + kMargin) * largest);
    verdict.push_back(bracketed ? '1' : '0');
  }
  return {RowStatus::kOk, {largest, LinearRule(loop), PassivityBound(loop), kappa}, {verdict}};
}

// Stiffnesses come from different methods: to 1e-4 of them. That no stiffness is stable may be
// written as 0 or nan.
bool Agrees(const Row& row, const Outcome& outcome, std::size_t index) {
  static const std::vector<ResultColumn> results = Wall().results;
  const std::string& column = results[index].name;
  const double expected = ExpectedNumber(row, column);
  if (index == kBracketed) return !(expected == 1) || outcome.texts[0] != "0";
  const double got = outcome.values[index];
  if (!std::isfinite(expected)) return got == 0;
  return std::abs(got - expected) <= 1e-4 * std::abs(expected) + RoundingOf(row.Text(column));
}

Table Grid(bool quick) {
  Table table("the grid of wall", {"T_s", "m_kg", "b_Ns_m", "B_Ns_m", "delay_samples"});
  const std::vector<double> periods =
      quick ? std::vector{1e-3, 1e-2} : std::vector{1.25e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 1e-2};
  struct Held {
    double mass_kg;
    double damping_ns_per_m;
  };
  // The device alone, and with a light, a medium and a firm hand.
  const std::vector<Held> devices =
      quick ? std::vector<Held>{{0.03, 0.2}, {0.58, 6.7}}
            : std::vector<Held>{{0.03, 0.2}, {0.13, 2.2}, {0.58, 6.7}, {0.93, 15.2}};
  const std::vector<double> dampings =
      quick ? std::vector{0.0, 2.0} : std::vector{0.0, 1.0, 2.0, 5.0, 10.0, 20.0};
  for (const Held& held : devices) {
    for (const double period_s : periods) {
      for (const double damping : dampings) {
        for (int delay = 0; delay <= (quick ? 1 : 3); ++delay) {
          table.Append({ToField(period_s), ToField(held.mass_kg), ToField(held.damping_ns_per_m),
                        ToField(damping), std::to_string(delay)});
        }
      }
    }
  }
  return table;
}

// For every device and rate: what each sample of delay costs, and what the known rules would allow.
void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "Largest stable stiffness of a wall [kN/m]; beside it as a part of the linear rule and of "
         "the passivity bound\n"
      << std::setw(9) << "T [ms]" << std::setw(9) << "m [kg]" << std::setw(11) << "b [Ns/m]"
      << std::setw(11) << "B [Ns/m]" << std::setw(7) << "delay" << std::setw(12) << "K_max"
      << std::setw(10) << "linear" << std::setw(10) << "passive" << std::setw(13) << "simulated"
      << "\n"
      << std::fixed;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row row = rows.row(i);
    const std::vector<double>& got = outcomes[i].values;
    const auto number = [&](const char* column) { return ExpectedNumber(row, column); };
    const auto part = [&](double whole) {
      if (whole > 0) {
        out << std::setprecision(2) << std::setw(10) << got[kLargest] / whole;
      } else {
        out << std::setw(10) << "-";
      }
    };
    out << std::setprecision(3) << std::setw(9) << number("T_s") * 1e3 << std::setw(9)
        << number("m_kg") << std::setprecision(2) << std::setw(11) << number("b_Ns_m")
        << std::setw(11) << number("B_Ns_m") << std::setw(7) << row.Text("delay_samples")
        << std::setprecision(4) << std::setw(12) << got[kLargest] * 1e-3;
    part(got[kLinear]);
    part(got[kPassive]);
    const std::string& simulated = outcomes[i].texts[0];
    out << std::setw(13)
        << (got[kLargest] == 0  ? "-"
            : simulated.empty() ? "too slow"
            : simulated == "1"  ? "+-3 %"
                                : "OTHERWISE")
        << "\n";
  }
  out << std::defaultfloat;
}

// The linear loop and the running one must agree on every limit.
std::size_t Judge(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::size_t missed = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (outcomes[i].texts[0] != "0") continue;
    ++missed;
    const Row row = rows.row(i);
    out << "not stable below and unstable above the limit: T = " << row.Text("T_s")
        << ", m = " << row.Text("m_kg") << ", b = " << row.Text("b_Ns_m")
        << ", B = " << row.Text("B_Ns_m") << ", delay " << row.Text("delay_samples") << "\n";
  }
  return missed;
}

}  // namespace

Case Wall() {
  Case study;
  study.name = "wall";
  study.purpose = "the largest stable stiffness of a static wall (nothing random)";
  study.results = {{"Kmax_eig_N_m"},
                   {"Kmax_gil_linear_N_m"},
                   {"Kmax_colgate_passive_N_m"},
                   {"kappa=Kmax*T^2/m"},
                   {"sim_bracketed"}};
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = Summarise;
  study.judge = Judge;
  return study;
}

}  // namespace rikiseki::lab
