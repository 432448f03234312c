// SPDX-License-Identifier: MIT
#include "haptic_server/safety/stability.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

using protocol::Coupling;

// Of B T/m, which may be 2 at most; a velocity filter at 100 Hz takes its part.
constexpr double kDampingMargin = 0.5;

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

// All roots of z^3 + a2 z^2 + a1 z + a0 within the unit circle.
bool IsStableCubic(double a2, double a1, double a0) {
  return 1 + a2 + a1 + a0 > 0 && -1 + a2 - a1 + a0 < 0 && std::abs(a0) < 1 &&
         std::abs(a0 * a0 - 1) > std::abs(a0 * a2 - a1);
}

// What a free mass does in a time: v' = keeps v + gains f, x' = x + way v + moves f.
struct FreeStep {
  double keeps = 1;
  double way = 0;
  double gains = 0;
  double moves = 0;
};

FreeStep StepOf(const HeldMass& device, double dt) {
  const double m = device.mass_kg;
  const double b = device.damping_ns_per_m;
  const double ratio = b * dt / m;
  FreeStep step{.keeps = std::exp(-ratio), .way = dt, .gains = dt / m, .moves = dt * dt / (2 * m)};
  if (ratio > 1e-6) {
    step.way = -std::expm1(-ratio) * m / b;
    step.gains = -std::expm1(-ratio) / b;
    // (dt - way)/b, whose digits cancel for small ratios: its series there.
    step.moves =
        ratio > 1e-2
            ? (dt - step.way) / b
            : dt * dt / m * (0.5 - ratio / 6 + ratio * ratio / 24 - ratio * ratio * ratio / 120);
  }
  return step;
}

// The loop x -> f = -(K x + B (x - x_before)/T) -> held -> m x'' + b x' = f.
bool IsStableWall(const HeldMass& device, double stiffness, double damping) {
  const FreeStep step = StepOf(device, device.period_s);
  const double now = stiffness + damping / device.period_s;
  const double before = damping / device.period_s;
  const double h = step.way * step.gains - step.moves * step.keeps;
  return IsStableCubic(now * step.moves - (1 + step.keeps),
                       step.keeps + now * h - before * step.moves, -before * h);
}

// The same where each force comes late: the forces that are on their way are part of the state,
// x, v, x_before, f_1 (of the tick before), f_2, ...
bool IsStableLateWall(const HeldMass& device, double stiffness, double damping) {
  const double T = device.period_s;
  const auto ticks = static_cast<Eigen::Index>(device.latency_s / T);
  const double rest = device.latency_s - static_cast<double>(ticks) * T;
  const Eigen::Index size = 3 + ticks + 1;
  Eigen::RowVectorXd force = Eigen::RowVectorXd::Zero(size);  // f_0, of this tick
  force[0] = -(stiffness + damping / T);
  force[2] = damping / T;
  const auto on_its_way = [&](Eigen::Index age) {
    return age == 0 ? force : Eigen::RowVectorXd(Eigen::RowVectorXd::Unit(size, 2 + age));
  };
  Eigen::RowVectorXd x = Eigen::RowVectorXd::Unit(size, 0);
  Eigen::RowVectorXd v = Eigen::RowVectorXd::Unit(size, 1);
  const auto advance = [&](double dt, const Eigen::RowVectorXd& acting) {
    const FreeStep step = StepOf(device, dt);
    x += step.way * v + step.moves * acting;
    v = step.keeps * v + step.gains * acting;
  };
  advance(rest, on_its_way(ticks + 1));
  advance(T - rest, on_its_way(ticks));
  Eigen::MatrixXd transition = Eigen::MatrixXd::Zero(size, size);
  transition.row(0) = x;
  transition.row(1) = v;
  transition(2, 0) = 1;
  transition.row(3) = force;
  for (Eigen::Index age = 2; age <= ticks + 1; ++age) transition(2 + age, 1 + age) = 1;
  return Eigen::EigenSolver<Eigen::MatrixXd>(transition, false)
             .eigenvalues()
             .cwiseAbs()
             .maxCoeff() < 1;
}

}  // namespace

HeldMass DeviceAlone(const Settings& settings) {
  return {.mass_kg = settings.spidar.moving_mass_kg,
          .damping_ns_per_m = settings.spidar.friction_damping_ns_per_m,
          .period_s = Seconds(settings.period_ns()),
          .latency_s = 1e-6 * settings.spidar.latency_us};
}

double LargestStableStiffness(const HeldMass& device, double damping_ns_per_m) {
  const bool is_late = device.latency_s > 0;
  const auto is_stable = [&](double stiffness) {
    return is_late ? IsStableLateWall(device, stiffness, damping_ns_per_m)
                   : IsStableWall(device, stiffness, damping_ns_per_m);
  };
  // No wall is stable beyond 4 m/T^2, plus what viscous damping adds.
  const double T = device.period_s;
  const double scale = device.mass_kg / (T * T) + device.damping_ns_per_m / T;
  // Stable stiffnesses form one interval above 0; without any damping it is empty. Eigenvalues near 1
  // are known to fewer digits.
  double low = (is_late ? 1e-6 : 1e-9) * scale;
  if (!is_stable(low)) return 0;
  double high = 8 * scale;
  for (int i = 0; i < (is_late ? 40 : 200); ++i) {
    const double middle = (low + high) / 2;
    (is_stable(middle) ? low : high) = middle;
  }
  return low;
}

std::string LargestStiffnessInWords(const Settings& settings) {
  const HeldMass device = DeviceAlone(settings);
  if (!(device.mass_kg > 0)) return "";
  const double scale = settings.mapping.force_scale * settings.mapping.motion_scale;
  const double damping = scale * settings.render.damping_ns_per_m;
  return "the device alone (" + Number(1e3 * device.mass_kg) + " g, " +
         Number(device.damping_ns_per_m) + " N s/m, " + Number(1e6 * device.latency_s) +
         " us late) bears " + Number(LargestStableStiffness(device, damping)) + " N/m at " +
         std::to_string(std::lround(settings.loop.rate_hz)) + " Hz with a damping of " +
         Number(damping) + " N s/m";
}

std::vector<std::string> DeviceWarnings(const Settings& settings) {
  const HeldMass device = DeviceAlone(settings);
  if (!(device.mass_kg > 0)) return {};
  std::vector<std::string> warnings;
  const double scale = settings.mapping.force_scale * settings.mapping.motion_scale;
  const double damping = scale * settings.render.damping_ns_per_m;
  const double most = LargestStableStiffness(device, damping);
  const auto judge = [&](const std::string& key, double stiffness) {
    if (scale * stiffness <= most) return;
    warnings.push_back(
        key + " is " + Number(scale * stiffness) + " N/m at the device, which alone bears " +
        Number(most) +
        " N/m at this rate and damping: without a hand that damps it, a contact buzzes");
  };
  judge("render.stiffness_n_per_m", settings.render.stiffness_n_per_m);
  judge("render.friction_stiffness_n_per_m", settings.render.friction_stiffness_n_per_m);
  const double light = settings.safety.light_damping_ns_per_m;
  if (light * device.period_s / device.mass_kg > kDampingMargin) {
    warnings.push_back(
        "safety.light_damping_ns_per_m is more than the device bears at this rate: " +
        Number(kDampingMargin * device.mass_kg / device.period_s) + " N s/m would be safe");
  }
  return warnings;
}

std::string CouplingAdvice(const RenderSettings& render, Coupling coupling, double world_period_s) {
  const double k = render.stiffness_n_per_m;
  const double d = render.damping_ns_per_m;
  const double Tw = world_period_s;
  const std::string held = " against a finger that is held still";
  if (coupling == Coupling::kPosition) {
    // kappa = k Tw^2/M < 4
    return "with coupling position at this rate, bodies below " + Number(k * Tw * Tw / 4) +
           " kg are unstable" + held;
  }
  if (coupling != Coupling::kImpulse) return "";
  switch (render.display) {
    case DisplayRule::kInterpolate:  // kappa/2 < beta < 2, beta = d Tw/M
      if (!(k * Tw / 2 < d)) {
        return "with coupling impulse at this rate and interpolated surfaces, bodies of any mass "
               "are "
               "unstable" +
               held + " unless render.damping_ns_per_m exceeds " + Number(k * Tw / 2);
      }
      return "with coupling impulse at this rate, bodies below " + Number(d * Tw / 2) +
             " kg are unstable" + held;
    case DisplayRule::kHold:  // kappa + 2 beta < 4
      return "with coupling impulse at this rate and held surfaces, bodies below " +
             Number((k * Tw * Tw + 2 * d * Tw) / 4) + " kg are unstable" + held;
    case DisplayRule::kExtrapolate:  // kappa < 2; known without damping only
      return "with coupling impulse at this rate and extrapolated surfaces, bodies below " +
             Number(k * Tw * Tw / 2) + " kg are unstable" + held;
  }
  return "";
}

}  // namespace rikiseki::haptic
