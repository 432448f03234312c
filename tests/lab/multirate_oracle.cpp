// SPDX-License-Identifier: MIT
#include "tests/lab/multirate_oracle.h"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

namespace rikiseki::lab::oracle {
namespace {

struct Frame {
  double x = 0, v = 0;
};

struct State {
  double y = 0, y_speed = 0;          // the finger
  double e_before = 0, c_before = 0;  // of the tick before
  Frame world;
  double world_e_before = 0;
  double previous = 0, last = 0;  // displayed
  Frame copy;
  std::deque<double> forces;    // on the body, newest last
  std::deque<Frame> in_flight;  // oldest first
};

// exp(A t) of y'' = (f - b y' - k y)/m with f held, by its series after halving.
Eigen::Matrix3d HandStep(const Rates& r) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  a(0, 1) = 1;
  a(1, 0) = -r.hand_stiffness / r.hand_mass;
  a(1, 1) = -r.hand_damping / r.hand_mass;
  a(1, 2) = 1 / r.hand_mass;
  a *= r.period;
  int halvings = 0;
  for (; a.cwiseAbs().rowwise().sum().maxCoeff() > 0.1; ++halvings) a /= 2;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d term = sum;
  for (int i = 1; i < 20; ++i) {
    term = term * a / i;
    sum += term;
  }
  for (int i = 0; i < halvings; ++i) sum = (sum * sum).eval();
  return sum;
}

class Loop {
 public:
  explicit Loop(const Rates& rates) : r_(rates), hand_(HandStep(rates)) {}

  std::size_t remembered() const {
    return static_cast<std::size_t>(std::max(r_.ticks, r_.latency));
  }
  std::size_t in_flight() const { return static_cast<std::size_t>(r_.latency / r_.ticks); }

  void Period(State& s) const {
    for (int j = 0; j < r_.ticks; ++j) {
      if (j == 0) WorldTick(s);
      if (j == r_.latency % r_.ticks) Arrive(s);
      Tick((j - r_.latency % r_.ticks + r_.ticks) % r_.ticks, s);
    }
  }

 private:
  bool Is(const char* method) const { return r_.method == method; }
  bool local() const { return r_.method.starts_with("local"); }

  void WorldTick(State& s) const {
    const double tw = r_.ticks * r_.period;
    double impulse = 0, moment = 0;
    for (auto f = s.forces.end() - r_.ticks; f != s.forces.end(); ++f) {
      impulse += *f * r_.period;
      moment += impulse * r_.period;
    }
    Frame& w = s.world;
    const double v = w.v;
    if (Is("conv") || Is("conv_worldkd")) {
      const double e = s.c_before - w.x;
      double force = r_.stiffness * e;
      if (Is("conv_worldkd")) force += r_.damping * (e - s.world_e_before) / tw;
      s.world_e_before = e;
      w.v += force * tw / r_.mass;
      w.x += tw * w.v;
    } else {
      w.v += impulse / r_.mass;
      if (Is("local_TR")) {
        w.x += tw * (v + w.v) / 2;
      } else if (local() && !Is("local_SE")) {
        w.x += tw * v + moment / r_.mass;
      } else {
        w.x += tw * w.v;
      }
    }
    s.in_flight.push_back(w);
  }

  void Arrive(State& s) const {
    const Frame frame = s.in_flight.front();
    s.in_flight.pop_front();
    s.previous = s.last;
    s.last = frame.x;
    s.copy = frame;
    if (Is("local_M1_noreplay")) return;
    for (auto f = s.forces.end() - r_.latency; f != s.forces.end(); ++f) {
      s.copy.v += *f * r_.period / r_.mass;
      s.copy.x += s.copy.v * r_.period;
    }
  }

  void Tick(int j, State& s) const {
    const double c = r_.clamped ? 0 : s.y;
    const double fraction = static_cast<double>(j) / r_.ticks;
    double surface = s.previous + fraction * (s.last - s.previous);
    if (Is("impulse_hold")) surface = s.last;
    if (Is("impulse_extrap")) surface = s.last + fraction * (s.last - s.previous);
    if (local()) surface = s.copy.x;
    const double e = c - surface;
    double force = r_.stiffness * e + r_.damping * (e - s.e_before) / r_.period;
    if (Is("local_M1_implicit")) {
      const double t = r_.period;
      const double v = (r_.mass * s.copy.v + t * r_.stiffness * e) /
                       (r_.mass + t * t * r_.stiffness + t * r_.damping);
      force = r_.mass * (v - s.copy.v) / t;
    }
    s.e_before = e;
    s.c_before = c;
    s.copy.v += force * r_.period / r_.mass;
    s.copy.x += s.copy.v * r_.period;
    s.forces.push_back(force);
    s.forces.pop_front();
    const Eigen::Vector3d moved = hand_ * Eigen::Vector3d(s.y, s.y_speed, -force);
    s.y = moved[0];
    s.y_speed = moved[1];
  }

  Rates r_;
  Eigen::Matrix3d hand_;
};

// All numbers that a method reads before it writes them.
std::vector<double*> Numbers(const Rates& r, State& s) {
  std::vector<double*> numbers{&s.e_before, &s.c_before, &s.world.x,
                               &s.world.v,  &s.previous, &s.last};
  if (!r.clamped) numbers.insert(numbers.end(), {&s.y, &s.y_speed});
  if (r.method == "conv_worldkd") numbers.push_back(&s.world_e_before);
  if (r.method.starts_with("local")) numbers.insert(numbers.end(), {&s.copy.x, &s.copy.v});
  for (double& force : s.forces) numbers.push_back(&force);
  for (Frame& frame : s.in_flight) numbers.insert(numbers.end(), {&frame.x, &frame.v});
  return numbers;
}

}  // namespace

double Growth(const Rates& rates) {
  const Loop loop(rates);
  State rest;
  rest.forces.resize(loop.remembered());
  rest.in_flight.resize(loop.in_flight());
  const std::size_t size = Numbers(rates, rest).size();
  Eigen::MatrixXd map(size, size);
  for (std::size_t i = 0; i < size; ++i) {
    State state = rest;
    *Numbers(rates, state)[i] = 1;
    loop.Period(state);
    const std::vector<double*> after = Numbers(rates, state);
    for (std::size_t j = 0; j < size; ++j) {
      map(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i)) = *after[j];
    }
  }
  return map.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace rikiseki::lab::oracle
