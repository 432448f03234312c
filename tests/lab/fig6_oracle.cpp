// SPDX-License-Identifier: MIT
#include "tests/lab/fig6_oracle.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::lab::oracle {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kDuration = 3;    // s

// m y'' + b y' + k y = u with u held for T: y, v <- A (y, v) + B u. A and B are parts of the
// exponential of the 3 x 3 matrix of (y, v, u), summed as a power series (its norm times T stays
// below about 10).
struct Hand {
  double a[2][2] = {};
  double b[2] = {};

  Hand(double mass, double damping, double stiffness, double period) {
    const double rate[3][3] = {
        {0, 1, 0}, {-stiffness / mass, -damping / mass, 1 / mass}, {0, 0, 0}};
    double term[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double sum[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int order = 1; order < 40; ++order) {
      double next[3][3] = {};
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          for (int k = 0; k < 3; ++k) next[i][j] += term[i][k] * rate[k][j] * period / order;
        }
      }
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          term[i][j] = next[i][j];
          sum[i][j] += next[i][j];
        }
      }
    }
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) a[i][j] = sum[i][j];
      b[i] = sum[i][2];
    }
  }
};

double MinimumJerk(double q) {
  if (q <= 0) return 0;
  if (q >= 1) return 1;
  return q * q * q * (10 - 15 * q + 6 * q * q);
}

double Intention(bool poke, double t) {
  const double from = poke ? -0.040 : -0.050;
  const double to = poke ? 0.020 : 0.100;
  const double reach = poke ? 0.120 : 0.300;
  const double hold = poke ? 0.0 : 0.100;
  return from + (to - from) * (MinimumJerk(t / reach) - MinimumJerk((t - reach - hold) / reach));
}

}  // namespace

Result Simulate(const Push& push) {
  const double T = push.haptic_period;
  const int n = push.ticks_per_period;
  const double Tw = n * T;
  const Hand hand = push.poke ? Hand(0.13, 2.2, 50, T) : Hand(0.93, 15.2, 500, T);
  const double deceleration = push.friction * kGravity;

  double x = push.face_offset;
  double v = 0;
  double previous = x;
  double last = x;
  int j = n;
  double y = 0;
  double y_speed = 0;
  double finger = Intention(push.poke, 0);
  double e_previous = 0;
  double pending = 0;
  Result result;
  const int ticks = static_cast<int>(std::lround(kDuration / T));
  for (int k = 0; k < ticks; ++k) {
    if (k >= push.phase && (k - push.phase) % n == 0) {
      if (push.method == Method::kPosition) {
        v += push.stiffness * std::max(0.0, finger - x) * Tw / push.mass;  // finger of tick k - 1
      } else {
        v += pending / push.mass;
      }
      pending = 0;
      const double loss = deceleration * Tw;
      const double sign = v < 0 ? -1 : 1;
      if (push.rule == Rule::kSemiImplicit) {
        v = std::abs(v) <= loss ? 0 : v - sign * loss;
        x += Tw * v;
      } else if (std::abs(v) <= loss) {
        x += v * std::abs(v) / (2 * deceleration);
        v = 0;
      } else {
        x += Tw * v - sign * deceleration * Tw * Tw / 2;
        v -= sign * loss;
      }
      result.peak_speed = std::max(result.peak_speed, std::abs(v));
      previous = last;
      last = x;
      j = 0;
    }
    finger = Intention(push.poke, k * T) + y;
    const double share = static_cast<double>(j) / n;
    double surface = previous + share * (last - previous);
    if (push.method == Method::kImpulseHold) surface = last;
    if (push.method == Method::kImpulseExtrapolate) surface = last + share * (last - previous);
    const double e = std::max(0.0, finger - surface);
    const double g = push.stiffness * e + push.damping * (e - e_previous) / T;
    e_previous = e;
    pending += g * T;
    result.impulse += g * T;
    j = std::min(j + 1, n);
    const double y_next = hand.a[0][0] * y + hand.a[0][1] * y_speed - hand.b[0] * g;
    y_speed = hand.a[1][0] * y + hand.a[1][1] * y_speed - hand.b[1] * g;
    y = y_next;
  }
  result.position = x;
  return result;
}

}  // namespace rikiseki::lab::oracle
