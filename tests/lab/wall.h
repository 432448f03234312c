// SPDX-License-Identifier: MIT
// A static wall: how stiff it may be until the sampled loop of device and wall is unstable.
// numerics section 2.
#pragma once

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// A device without a hand against a wall: m x'' + b x' = f, held from tick to tick, with
/// f_k = -(K x_(k-d) + B (x_(k-d) - x_(k-d-1))/T) while in contact.
struct WallLoop {
  double period_s = 1e-3;            // T
  double mass_kg = 0.03;             // m
  double damping_ns_per_m = 0.2;     // b, of the device
  double wall_damping_ns_per_m = 0;  // B
  int delay_samples = 0;             // d
};

/// Growth per tick of what deviates from a steady contact: the spectral radius of the loop's
/// transition matrix, whose columns are what one tick of contact solve, surface force and device
/// makes of a deviation in one state. While in contact the loop is linear, so that is exact.
double SpectralRadius(const WallLoop& loop, double stiffness_n_per_m);

/// The largest K with spectral radius <= 1, to 1e-9 of it; 0 if there is none above 1e-8 m/T^2.
double LargestStiffness(const WallLoop& loop);

/// Known rules for the same.
double LinearRule(const WallLoop& loop);      // Gil, Hulin: (b + B)/(T/2 + d T)
double PassivityBound(const WallLoop& loop);  // Colgate & Schenkel: 2 (b - B)/T; 0 with delay

/// Whether a small deviation from a steady contact dies out in the haptic tick that ships.
bool StaysInContact(const WallLoop& loop, double stiffness_n_per_m);

/// The study `wall`.
Case Wall();

}  // namespace rikiseki::lab
