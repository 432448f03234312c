// SPDX-License-Identifier: MIT
#include "tests/lab/multirate_loop.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace rikiseki::lab {
namespace {

constexpr int kMostNumbers = 10 + 2 * (kLongestLatency + 1);

// A number of the loop as a linear form of the state at the start of the period: with one of them
// for every number of the state, one run through the period makes all columns of the map at once.
using Form = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kMostNumbers>;

struct Motion {
  Form x;  // m
  Form v;  // m/s
};

void Step(const BodyGains& gains, const Form& impulse, Motion& body) {
  body.x += gains.shift_per_speed * body.v + gains.shift_per_impulse * impulse;
  body.v += gains.speed_per_impulse * impulse;
}

haptic::DisplayRule RuleOf(LoopMethod method) {
  switch (method) {
    case LoopMethod::kHold:
      return haptic::DisplayRule::kHold;
    case LoopMethod::kExtrapolate:
      return haptic::DisplayRule::kExtrapolate;
    default:
      return haptic::DisplayRule::kInterpolate;
  }
}

// A similar matrix whose rows and columns are alike in size: numbers of different units would cost
// digits of the eigenvalues.
Eigen::MatrixXd Balanced(Eigen::MatrixXd matrix) {
  bool changed = true;
  for (int sweep = 0; changed && sweep < 100; ++sweep) {
    changed = false;
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      const double own = std::abs(matrix(i, i));
      const double column = matrix.col(i).cwiseAbs().sum() - own;
      const double row = matrix.row(i).cwiseAbs().sum() - own;
      if (!(column > 0) || !(row > 0)) continue;
      const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (factor == 1 || !std::isfinite(factor)) continue;
      matrix.col(i) *= factor;
      matrix.row(i) /= factor;
      changed = true;
    }
  }
  return matrix;
}

}  // namespace

std::optional<LoopMethod> FindLoopMethod(std::string_view name) {
  const auto* found = std::find(kLoopMethodNames.begin(), kLoopMethodNames.end(), name);
  if (found == kLoopMethodNames.end()) return std::nullopt;
  return static_cast<LoopMethod>(found - kLoopMethodNames.begin());
}

// Everything that lives from tick to tick. What a method does not need stays out of its state.
struct PeriodMap::State {
  Motion finger;
  Form depth_before;        // e of the tick before
  Form finger_before;       // C of the tick before, which the world samples
  Form world_depth_before;  // e of the world's tick before
  Form previous, last;      // what the display rule moves between
  Motion copy;              // the local body
  Motion world;
  Form impulse, moment;           // J and S since the last world tick
  Motion replayed;                // the world as the replay of these ticks will leave it
  std::vector<Motion> in_flight;  // frames, oldest first; local: with our own impulses since

  std::vector<Form*> Numbers(const MultirateLoop& loop) {
    const LoopMethod method = loop.method;
    std::vector<Form*> numbers{&depth_before};
    if (loop.hand) numbers.insert(numbers.end(), {&finger.x, &finger.v});
    const bool local = method >= LoopMethod::kLocalSemiImplicitWorld;
    if (local) {
      numbers.insert(numbers.end(), {&copy.x, &copy.v});
    } else {
      numbers.insert(numbers.end(), {&previous, &last});
    }
    switch (method) {
      case LoopMethod::kPositionWithWorldDamper:
        numbers.push_back(&world_depth_before);
        [[fallthrough]];
      case LoopMethod::kPosition:
        numbers.insert(numbers.end(), {&finger_before, &world.x, &world.v});
        break;
      case LoopMethod::kLocalReplay:
      case LoopMethod::kLocalImplicit:
        numbers.insert(numbers.end(), {&replayed.x, &replayed.v});
        break;
      case LoopMethod::kLocalBlock:
      case LoopMethod::kLocalOverwrite:
        numbers.push_back(&moment);
        [[fallthrough]];
      default:
        numbers.insert(numbers.end(), {&impulse, &world.x, &world.v});
    }
    for (Motion& frame : in_flight) {
      numbers.push_back(&frame.x);
      if (local) numbers.push_back(&frame.v);
    }
    return numbers;
  }

  // The state as the one at the start of what is run next.
  void SetUnits(const MultirateLoop& loop) {
    const std::vector<Form*> numbers = Numbers(loop);
    const auto size = static_cast<Eigen::Index>(numbers.size());
    for (Form* number : {&finger.x, &finger.v, &depth_before, &finger_before, &world_depth_before,
                         &previous, &last, &copy.x, &copy.v, &world.x, &world.v, &impulse, &moment,
                         &replayed.x, &replayed.v}) {
      *number = Form::Zero(size);
    }
    for (Motion& frame : in_flight) frame = {Form::Zero(size), Form::Zero(size)};
    Eigen::Index index = 0;
    for (Form* number : numbers) *number = Form::Unit(size, index++);
  }
};

PeriodMap::PeriodMap(const MultirateLoop& loop) : loop_(loop) {
  if (loop.ticks_per_period < 1 || loop.latency_ticks < 0 ||
      loop.latency_ticks > kLongestLatency * loop.ticks_per_period) {
    throw std::invalid_argument("a world period has ticks, and a latency is 0 to 8 of them long");
  }
  display_ = ReadDisplay(RuleOf(loop.method), loop.ticks_per_period);
  contact_ = ReadContact(loop.stiffness_n_per_m, loop.damping_ns_per_m, loop.period_s);
  penalty_ = ReadPenalty(loop.stiffness_n_per_m, loop.ticks_per_period * loop.period_s);
  if (loop.hand) hand_ = haptic::ExactStep(*loop.hand, loop.period_s);
}

// Everything up to the haptic tick before goes into the world, whose frame sets out.
void PeriodMap::WorldTick(double mass_kg, State& state) const {
  const double period_s = loop_.ticks_per_period * loop_.period_s;
  const BodyGains gains = ReadWorldStep(mass_kg, period_s);
  Motion& world = state.world;
  switch (loop_.method) {
    case LoopMethod::kPosition:
    case LoopMethod::kPositionWithWorldDamper: {
      const Form depth = state.finger_before - world.x;
      Form kick = penalty_ * depth;
      if (loop_.method == LoopMethod::kPositionWithWorldDamper) {
        kick += loop_.damping_ns_per_m * (depth - state.world_depth_before);
        state.world_depth_before = depth;
      }
      Step(gains, kick, world);
      break;
    }
    case LoopMethod::kInterpolate:
    case LoopMethod::kHold:
    case LoopMethod::kExtrapolate:
    case LoopMethod::kLocalSemiImplicitWorld:
      Step(gains, state.impulse, world);
      break;
    case LoopMethod::kLocalTrapezoidWorld: {
      const Form change = gains.speed_per_impulse * state.impulse;
      world.x += period_s * (world.v + change / 2);
      world.v += change;
      break;
    }
    case LoopMethod::kLocalBlock:
    case LoopMethod::kLocalOverwrite:
      world.x += period_s * world.v + state.moment / mass_kg;
      world.v += state.impulse / mass_kg;
      break;
    case LoopMethod::kLocalReplay:
    case LoopMethod::kLocalImplicit:
      world = state.replayed;
      break;
  }
  state.impulse.setZero();
  state.moment.setZero();
  state.in_flight.push_back(world);
}

void PeriodMap::Arrive(State& state) const {
  const Motion frame = state.in_flight.front();
  state.in_flight.erase(state.in_flight.begin());
  state.previous = state.last;
  state.last = frame.x;
  state.copy = frame;
}

void PeriodMap::HapticTick(const BodyGains& body, const ImplicitGains& implicit, int ticks_shown,
                           State& state) const {
  const DisplayWeights& weights = display_[static_cast<std::size_t>(ticks_shown)];
  const bool local = IsLocal();
  const Form depth =
      state.finger.x -
      (local ? state.copy.x : Form(weights.previous * state.previous + weights.last * state.last));
  Form impulse;
  if (loop_.method == LoopMethod::kLocalImplicit) {
    impulse = implicit.per_depth * depth + implicit.per_speed * state.copy.v;
  } else {
    impulse = loop_.period_s * (contact_.now * depth + contact_.before * state.depth_before);
  }
  state.depth_before = depth;
  state.finger_before = state.finger.x;

  state.impulse += impulse;
  state.moment += loop_.period_s * state.impulse;
  if (local) {
    Step(body, impulse, state.copy);
    Step(body, impulse, state.replayed);
    // A frame that is late is caught up with by the same step on the same impulses.
    if (loop_.method != LoopMethod::kLocalOverwrite) {
      for (Motion& frame : state.in_flight) Step(body, impulse, frame);
    }
  }
  if (loop_.hand) {
    const Form force = -impulse / loop_.period_s;  // on the finger
    const Form moved = hand_.yy * state.finger.x + hand_.yv * state.finger.v + hand_.yf * force;
    state.finger.v = Form(hand_.vy * state.finger.x + hand_.vv * state.finger.v + hand_.vf * force);
    state.finger.x = moved;
  }
}

// Ticks that are all alike, as a power of one. In extended precision, because a kick that is booked
// and the motion that it made cancel later, after as many ticks as there are.
void PeriodMap::AlikeTicks(const BodyGains& body, const ImplicitGains& implicit, int count,
                           State& state) const {
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  if (count == 0) return;
  State tick = state;
  const std::vector<Form*> numbers = state.Numbers(loop_);
  const auto size = static_cast<Eigen::Index>(numbers.size());
  tick.SetUnits(loop_);
  HapticTick(body, implicit, 0, tick);
  Matrix power(size, size);
  Eigen::Index index = 0;
  for (const Form* number : tick.Numbers(loop_)) power.row(index++) = number->cast<long double>();

  Matrix rows(size, numbers.front()->size());
  index = 0;
  for (const Form* number : numbers) rows.row(index++) = number->cast<long double>();
  for (; count > 0; count /= 2) {
    if (count % 2 == 1) rows = (power * rows).eval();
    if (count > 1) power = (power * power).eval();
  }
  index = 0;
  for (Form* number : numbers) *number = rows.row(index++).cast<double>();
}

double PeriodMap::SpectralRadius(double mass_kg) const {
  State state;
  const int ticks = loop_.ticks_per_period;
  const int arrival = loop_.latency_ticks % ticks;
  state.in_flight.resize(static_cast<std::size_t>(loop_.latency_ticks / ticks));
  state.SetUnits(loop_);
  const BodyGains body = ReadBodyStep(mass_kg, loop_.period_s);
  const ImplicitGains implicit =
      ReadImplicitStep(loop_.stiffness_n_per_m, loop_.damping_ns_per_m, mass_kg, loop_.period_s);
  WorldTick(mass_kg, state);
  if (IsLocal()) {
    AlikeTicks(body, implicit, arrival, state);
    Arrive(state);
    AlikeTicks(body, implicit, ticks - arrival, state);
  } else {
    for (int tick = 0; tick < ticks; ++tick) {
      if (tick == arrival) Arrive(state);
      HapticTick(body, implicit, (tick - arrival + ticks) % ticks, state);
    }
  }

  const std::vector<Form*> numbers = state.Numbers(loop_);
  const auto size = static_cast<Eigen::Index>(numbers.size());
  Eigen::MatrixXd map(size, size);
  Eigen::Index index = 0;
  for (const Form* number : numbers) map.row(index++) = *number;
  // Of the order of 1, so that nothing overflows on the way to the eigenvalues.
  const double scale = map.cwiseAbs().maxCoeff();
  if (!std::isfinite(scale)) return std::numeric_limits<double>::infinity();
  return scale * Balanced(map / scale).eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace rikiseki::lab
