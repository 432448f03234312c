#include "haptic_server/safety/stability.h"

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

// The loop x -> f = -(K x + B (x - x_before)/T) -> held -> m x'' + b x' = f.
bool IsStableWall(const HeldMass& device, double stiffness, double damping) {
  const double m = device.mass_kg;
  const double b = device.damping_ns_per_m;
  const double T = device.period_s;
  const double ratio = b * T / m;
  const double a = std::exp(-ratio);  // of the velocity, over a tick
  double way = T;                     // of a unit velocity, over a tick
  double v_f = T / m;                 // velocity by a unit force
  double x_f = T * T / (2 * m);       // way by a unit force
  if (ratio > 1e-6) {
    way = -std::expm1(-ratio) * m / b;
    v_f = -std::expm1(-ratio) / b;
    // (T - way)/b, whose digits cancel for small ratios: its series there.
    x_f = ratio > 1e-2
              ? (T - way) / b
              : T * T / m * (0.5 - ratio / 6 + ratio * ratio / 24 - ratio * ratio * ratio / 120);
  }
  const double now = stiffness + damping / T;
  const double before = damping / T;
  const double h = way * v_f - x_f * a;
  return IsStableCubic(now * x_f - (1 + a), a + now * h - before * x_f, -before * h);
}

}  // namespace

double LargestStableStiffness(const HeldMass& device, double damping_ns_per_m) {
  // No wall is stable beyond 4 m/T^2, plus what viscous damping adds.
  const double T = device.period_s;
  const double scale = device.mass_kg / (T * T) + device.damping_ns_per_m / T;
  // Stable stiffnesses form one interval above 0; without any damping it is empty.
  double low = 1e-9 * scale;
  if (!IsStableWall(device, low, damping_ns_per_m)) return 0;
  double high = 8 * scale;
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (IsStableWall(device, middle, damping_ns_per_m) ? low : high) = middle;
  }
  return low;
}

std::vector<std::string> DeviceWarnings(const Settings& settings) {
  const HeldMass device{.mass_kg = settings.spidar.moving_mass_kg,
                        .damping_ns_per_m = settings.spidar.friction_damping_ns_per_m,
                        .period_s = Seconds(settings.period_ns())};
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
