// SPDX-License-Identifier: MIT
#include "world_server/step.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "world_server/body_numbers.h"
#include "world_server/coupling/kick.h"
#include "world_server/coupling/ledger_reader.h"
#include "world_server/coupling/replay.h"
#include "world_server/features/local_bodies.h"
#include "world_server/features/planes.h"

namespace rikiseki::world {

namespace {

void RequireDynamics(const Scene& scene, const DynamicsWorld* dynamics) {
  if (dynamics != nullptr && dynamics->body_count() == scene.bodies.size()) return;
  throw std::invalid_argument("the dynamics must hold exactly the bodies of the scene");
}

// J. A body with a local copy moves as the finger felt it move, and its books agree but for rounding and the
// length of a tick. Where copy and world part - at many contacts, in a slow world - it got joules from
// nowhere: here the world stops following.
constexpr double kCopyOverdraft = 0.05;

// s. The finger can be given energy that is no body's: by a surface that appears where it is.
constexpr double kDebtFades = 0.1;

}  // namespace

struct WorldStep::State {
  Settings settings;
  Scene scene;
  std::unique_ptr<DynamicsWorld> dynamics;
  std::unique_ptr<PlaneFinder> plane_finder;  // of this scene
  std::vector<BodyState> states;
  BodyNumbers numbers;
  LedgerReader ledger;
  PushBudgets budgets;              // of the bodies that are pushed
  std::vector<std::size_t> copied;  // places of the newest frame's local bodies
  std::vector<Finger> fingers;      // of the newest message
  double stiffness_n_per_m = 0;     // that it renders with
  std::int64_t silence_ns = 0;      // world time since it came
  std::uint64_t frame = 0;
  std::int64_t world_time_ns = 0;
  std::vector<protocol::Body> bodies;
  protocol::WorldHealth health;

  State(const Settings& given, std::uint64_t own_epoch)
      : settings(given),
        ledger(own_epoch, given.coupling.coupling, given.coupling.force_cap_n * given.gap_s()) {
    health.coupling = given.coupling.coupling;
    health.period_ns = static_cast<std::uint64_t>(given.period_ns());
  }

  void Adopt(Scene new_scene, std::unique_ptr<DynamicsWorld> new_dynamics,
             std::span<const BodyChange> changes);
  void NameOnWire(protocol::WorldFrame& told) const;
  void ReadStates();
  void Advance(double period_s);
  void GrantBudgets(std::span<const OwedPush> owed, double period_s);
  void Penalise(double period_s);
  void Push(std::span<const Kick> kicks, double period_s);
};

void WorldStep::State::Adopt(Scene new_scene, std::unique_ptr<DynamicsWorld> new_dynamics,
                             std::span<const BodyChange> changes) {
  RequireDynamics(new_scene, new_dynamics.get());
  scene = std::move(new_scene);
  dynamics = std::move(new_dynamics);
  numbers.Advance(changes);
  auto finder = std::make_unique<PlaneFinder>(scene, dynamics.get());
  if (plane_finder) finder->Continue(*plane_finder, changes);
  plane_finder = std::move(finder);
  PutInPlace(changes, states, *dynamics);

  std::vector<BodyTag> tags(numbers.bound());
  bodies.assign(scene.bodies.size(), {});
  health.moving_bodies = 0;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    bodies[i].body = numbers.numbers()[i];
    bodies[i].generation = numbers.generations()[i];
    tags[bodies[i].body] = {.generation = bodies[i].generation, .movable = !body.fixed, .place = i};
    bodies[i].mass = body.fixed ? 0 : body.mass_kg;
    if (!body.fixed) ++health.moving_bodies;
  }
  ledger.SetBodies(std::move(tags));
  budgets.clear();
  copied.clear();
  health.scene = {};
  const std::size_t length = std::min(scene.name.size(), health.scene.size() - 1);
  std::copy_n(scene.name.begin(), length, health.scene.begin());
  ReadStates();
}

void WorldStep::State::ReadStates() {
  states.resize(scene.bodies.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    states[i] = dynamics->State(i);
    bodies[i].position = ToArray(states[i].pose.position);
    bodies[i].orientation = ToArray(states[i].pose.orientation);
    bodies[i].velocity = ToArray(states[i].velocity);
    bodies[i].angular_velocity = ToArray(states[i].angular_velocity);
  }
}

// The couplings of the experiments give the bodies everything; under `local` a rigid body takes what the
// finger's work allows.
void WorldStep::State::GrantBudgets(std::span<const OwedPush> owed, double period_s) {
  const double debt_kept = std::exp(-period_s / kDebtFades);
  PushBudgets granted;
  for (const OwedPush& owes : owed) {
    const std::size_t body = owes.push.body;
    if (scene.bodies[body].softness) continue;
    const bool has_copy = std::find(copied.begin(), copied.end(), body) != copied.end();
    const auto known = budgets.find(body);
    PushBudget& budget =
        granted.emplace(body, known != budgets.end() ? known->second : PushBudget()).first->second;
    budget.Grant({.work_j = owes.work_j,
                  .spring_j = owes.spring_j,
                  .debt_kept = debt_kept,
                  .overdraft_j = has_copy ? kCopyOverdraft : 0},
                 states[body]);
  }
  budgets = std::move(granted);
}

// `position`: a finger that has not been heard of for a gap pushes no longer.
void WorldStep::State::Penalise(double period_s) {
  std::vector<Kick> kicks;
  const double gap_s = settings.gap_s();
  if (silence_ns <= std::llround(gap_s * 1e9)) {
    kicks = PenaltyKicks(scene, states, fingers,
                         {.stiffness_n_per_m = stiffness_n_per_m,
                          .period_s = period_s,
                          .largest_impulse_ns = settings.coupling.force_cap_n * gap_s},
                         dynamics.get());
  }
  Vec3 penalty = ToVec3(health.penalty_impulse);
  for (const Kick& kick : kicks) penalty += kick.impulse;
  health.penalty_impulse = ToArray(penalty);
  Push(kicks, period_s);
}

// All at the start of the period.
void WorldStep::State::Push(std::span<const Kick> kicks, double period_s) {
  dynamics->ApplyAndStep(kicks, 0);
  const Stretch whole{.length_s = period_s};
  dynamics->Play({&whole, 1});
}

// Coupling and physics.
void WorldStep::State::Advance(double period_s) {
  const std::span<const OwedPush> owed = ledger.Take();
  if (settings.coupling.coupling == protocol::Coupling::kPosition) {
    Penalise(period_s);
  } else if (settings.coupling.coupling == protocol::Coupling::kLocal &&
             settings.coupling.replay == ReplayRule::kTicks) {
    GrantBudgets(owed, period_s);
    ReplayPush(ledger.replay(), period_s, settings.coupling.force_cap_n * settings.gap_s(),
               *dynamics, &budgets);
    for (const auto& [body, budget] : budgets) ledger.GiveBack(budget.refused());
  } else {
    Push(ImpulseKicks(owed, states), period_s);
  }
  ReadStates();
}

// Stations before this one know a body by its place in the scene.
void WorldStep::State::NameOnWire(protocol::WorldFrame& told) const {
  for (protocol::Plane& plane : std::span(told.planes).first(told.plane_count)) {
    plane.body = numbers.numbers()[plane.body];
  }
  for (protocol::LocalBody& local : std::span(told.local_bodies).first(told.local_body_count)) {
    local.body = numbers.numbers()[local.body];
    for (protocol::ContactPlane& contact : std::span(local.contacts).first(local.contact_count)) {
      if (contact.other_body == kNoBody) continue;
      contact.other_body = numbers.numbers()[contact.other_body];
    }
  }
}

WorldStep::WorldStep(const Settings& settings, Scene scene, std::unique_ptr<DynamicsWorld> dynamics,
                     std::uint64_t own_epoch)
    : state_(std::make_unique<State>(settings, own_epoch)) {
  const std::vector<BodyChange> all_new(scene.bodies.size());
  state_->Adopt(std::move(scene), std::move(dynamics), all_new);
}

WorldStep::~WorldStep() = default;

void WorldStep::BeginHapticEpoch(std::uint64_t epoch) {
  state_->ledger.BeginEpoch(epoch);
  state_->fingers.clear();
  state_->health.peer_epoch = epoch;
}

void WorldStep::Consume(const protocol::HapticTick& tick) {
  if (!state_->ledger.Consume(tick)) return;
  state_->fingers = FingersOf(tick, state_->settings.features.finger_friction);
  state_->stiffness_n_per_m = tick.stiffness;
  state_->silence_ns = 0;
}

void WorldStep::Tick(double period_s, protocol::WorldFrame& frame) {
  State& s = *state_;
  s.Advance(period_s);
  const std::int64_t period_ns = std::llround(period_s * 1e9);
  s.silence_ns += period_ns;
  s.world_time_ns += period_ns;

  frame = {};
  frame.frame = ++s.frame;
  frame.world_time_ns = static_cast<std::uint64_t>(s.world_time_ns);
  frame.period_ns = s.health.period_ns;
  frame.acked_epoch = s.ledger.acked_epoch();
  frame.acked_tick = s.ledger.acked_tick();
  frame.baseline_tick = s.ledger.baseline_tick();
  frame.applied = s.ledger.epoch_books().applied;
  frame.discarded = s.ledger.epoch_books().TotalDiscarded();
  frame.coupling = s.settings.coupling.coupling;
  const FeatureReach reach{.radius_m = s.settings.features.radius_mm * 1e-3,
                           .period_s = static_cast<double>(s.settings.period_ns()) * 1e-9};
  const std::vector<std::uint32_t>& generations = s.numbers.generations();
  frame.plane_count = s.plane_finder->Find(s.states, generations, s.fingers, reach, frame.planes);
  if (s.settings.coupling.coupling == protocol::Coupling::kLocal) {
    frame.local_body_count = FindLocalBodies(s.scene, *s.dynamics, s.states, generations,
                                             std::span(frame.planes).first(frame.plane_count),
                                             reach, frame.local_bodies);
    s.copied.clear();
    for (const protocol::LocalBody& local :
         std::span(frame.local_bodies).first(frame.local_body_count)) {
      s.copied.push_back(local.body);
    }
    frame.local_substep_ns =
        static_cast<std::uint64_t>(std::llround(s.settings.physics.substep_ms * 1e6));
  }
  s.NameOnWire(frame);

  s.health.frames = s.frame;
  s.health.applied = s.ledger.life_books().applied;
  s.health.discarded = s.ledger.life_books().discarded;
}

void WorldStep::Tune(const Settings& settings) {
  Settings& mine = state_->settings;
  mine.coupling.force_cap_n = settings.coupling.force_cap_n;
  mine.coupling.gap_ms = settings.coupling.gap_ms;
  mine.features.radius_mm = settings.features.radius_mm;
  state_->ledger.SetLargestImpulse(mine.coupling.force_cap_n * mine.gap_s());
}

void WorldStep::Replace(Successor successor) {
  State& s = *state_;
  RequireDynamics(successor.scene, successor.dynamics.get());
  if (!successor.prepared) Prepare(Now(), s.settings.physics.substep_ms * 1e-3, successor);
  const std::vector<BodyChange> changes = ChangesOf(s.scene, successor);
  s.Adopt(std::move(successor.scene), std::move(successor.dynamics), changes);
  ++s.health.resets;
}

Moment WorldStep::Now() const {
  return {.scene = state_->scene, .states = state_->states};
}

const Scene& WorldStep::scene() const {
  return state_->scene;
}

const std::vector<protocol::Body>& WorldStep::Bodies() const {
  return state_->bodies;
}

const protocol::WorldHealth& WorldStep::health() const {
  return state_->health;
}

}  // namespace rikiseki::world
