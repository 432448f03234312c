// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_world.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include "common/body_step.h"
#include "world_server/physics/bullet_bodies.h"
#include "world_server/physics/bullet_contacts.h"
#include "world_server/physics/contact_impulses.h"
#include "world_server/physics/contact_pairs.h"
#include "world_server/physics/group_substep.h"
#include "world_server/physics/islands.h"
#include "world_server/physics/push_budget.h"
#include "world_server/physics/sleep.h"
#include "world_server/physics/substep_choice.h"

namespace rikiseki::world {
namespace {

// Groups are worked out anew so often: longer, and slow bodies far from each other become one group;
// shorter, and finding groups costs more than stepping.
constexpr double kWindow = 0.01;  // s
// Where something may come farther in a window, of the size of the smallest, that ends sooner: the bodies
// within reach grow as the cube of the way, and a push reaches as the square of the time.
constexpr double kFarWay = 0.25;
// A window of ticks that are a little too long by rounding is still one window.
constexpr double kSameTime = 1e-9;  // relative

// Tells Bullet's sweeps which pairs have contacts already.
class KnownPairs final : public btNullPairCache {
 public:
  explicit KnownPairs(const ContactPairs& pairs) : pairs_(pairs) {}

  btBroadphasePair* findPair(btBroadphaseProxy* a, btBroadphaseProxy* b) override {
    const ContactPair* pair = pairs_.Find(*static_cast<btCollisionObject*>(a->m_clientObject),
                                          *static_cast<btCollisionObject*>(b->m_clientObject));
    if (pair == nullptr) return nullptr;
    found_.m_algorithm = pair->algorithm;
    return &found_;
  }

 private:
  const ContactPairs& pairs_;
  btBroadphasePair found_;
};

// m/s, that an impulse may add anywhere on a body.
double AddedSpeed(const MovingBody& body, const Vec3& impulse, const Vec3& angular_impulse) {
  return impulse.norm() / body.inertia.mass_kg +
         body.outer_radius * body.inertia.inverse_B.diagonal().maxCoeff() * angular_impulse.norm();
}

// A part of a window in which what a push reaches is stepped, and the pushes at its start.
struct FineStep {
  double length_s = 0;
  std::span<const PlacedImpulse> pushes;
};

}  // namespace

struct BulletWorld::Engine {
  // Members are destroyed from the last to the first: the world before what it points to.
  EngineParts parts;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  std::vector<PairContact> contacts = ReplaceContacts(dispatcher);
  BulletBodies bodies;
  ContactPairs pairs{dispatcher, bodies.moving.size()};
  KnownPairs known_pairs{pairs};
  btDbvtBroadphase broadphase{&known_pairs};
  std::unique_ptr<btSequentialImpulseConstraintSolver> solver = MakeSolver(parts);
  double resting_depth;  // m, how deep bodies rest in each other
  Sleepers sleepers;
  GroupedWorld world;
  Islands islands{bodies, pairs, sleepers, broadphase, world, parts.contacts};

  std::vector<char> pushed;          // of each moving body: in this window
  std::vector<char> reached;         // ... or before, and it has not come to rest since
  std::vector<double> pushed_speed;  // m/s, that it may add
  std::vector<std::size_t> all_pushed;
  std::vector<FineStep> fine_steps;
  std::vector<std::size_t> moved;  // since the states were read
  std::uint64_t substeps = 0;

  Engine(const Scene& scene, const EngineParts& given)
      : parts(given),
        bodies(scene),
        resting_depth(1e-4 * bodies.smallest),
        sleepers(bodies.moving, parts.sleeping),
        world(scene, dispatcher, broadphase, *solver, configuration, bodies, pairs, sleepers, parts,
              resting_depth),
        pushed(bodies.moving.size()),
        reached(bodies.moving.size()),
        pushed_speed(bodies.moving.size()) {
    broadphase.m_deferedcollide = true;  // never asked for pairs: islands.h asks by itself
    broadphase.optimize();
  }

  Kick KickOn(const PlacedImpulse& push) const;
  double FastestSpeed();
  double PushedSpeed(const PlacedImpulse& push) const;
  std::size_t WindowEnd(std::size_t first);
  void Mark(std::size_t body, const Vec3& impulse, const Vec3& angular_impulse);
  void Apply(const Kick& kick);
  void Apply(const PlacedImpulse& push);
  void Advance(std::span<const Stretch> stretches, double substep_s, bool long_substeps);
  void PassWindow(std::span<const FineStep> steps, double window_s, double substep_s,
                  bool long_substeps);
  void StepGroup(const Group& group, std::size_t place, std::span<const FineStep> steps,
                 double window_s, double substep_s, bool long_substeps);
  void Step(const Group& group, double length_s, double longest_s, int sweeps);
};

// Of a body that moves, as it is now.
Kick BulletWorld::Engine::KickOn(const PlacedImpulse& push) const {
  const MovingBody& body = bodies.moving[bodies.moving_of[push.body]];
  const Vec3 centre = body.State().pose.position;
  return KickOf(WithinReach(push, centre, body.outer_radius), centre);
}

// A push is on its way, or has come: its body wakes.
void BulletWorld::Engine::Mark(std::size_t body, const Vec3& impulse, const Vec3& angular_impulse) {
  if (impulse.isZero(0) && angular_impulse.isZero(0)) return;
  sleepers.Wake(body);
  if (pushed[body] == 0) all_pushed.push_back(body);
  pushed[body] = 1;
  pushed_speed[body] += AddedSpeed(bodies.moving[body], impulse, angular_impulse);
}

void BulletWorld::Engine::Apply(const Kick& kick) {
  const std::size_t body = bodies.moving_of[kick.body];
  if (body == BulletBodies::kFixed) return;
  Mark(body, kick.impulse, kick.angular_impulse);
  ApplyKick(bodies.moving[body], kick.impulse, kick.angular_impulse);
  moved.push_back(body);
  const std::span<const std::size_t> settled = world.joints().Settle(body);
  moved.insert(moved.end(), settled.begin(), settled.end());
}

void BulletWorld::Engine::Apply(const PlacedImpulse& push) {
  const std::size_t place = bodies.moving_of[push.body];
  Kick kick = KickOn(push);
  if (push.budget != nullptr) {
    push.budget->Limit(bodies.moving[place].inertia, bodies.moving[place].State(), kick);
  }
  ApplyKick(bodies.moving[place], kick.impulse, kick.angular_impulse);
  world.joints().Settle(place);
}

// Of a group alone.
void BulletWorld::Engine::Step(const Group& group, double length_s, double longest_s, int sweeps) {
  const int count = SubstepCount(length_s, longest_s);
  for (int done = 0; done < count; ++done) world.Step(group, length_s / count, sweeps);
  substeps += static_cast<std::uint64_t>(count);
}

void BulletWorld::Engine::StepGroup(const Group& group, std::size_t place,
                                    std::span<const FineStep> steps, double window_s,
                                    double substep_s, bool long_substeps) {
  const GroupMotion motion = MotionOf(group, bodies, sleepers);
  const int sweeps = Sweeps(motion);
  // What a push has set in motion goes on in the substeps of its local copy until it rests.
  const bool is_reached =
      std::any_of(group.members.begin(), group.members.end(),
                  [this](std::size_t body) { return pushed[body] != 0 || reached[body] != 0; });
  if (!is_reached && long_substeps) {
    if (window_s > 0) Step(group, window_s, CoarseSubstep(motion, substep_s, window_s), sweeps);
    return;
  }
  const double longest_s = PushedSubstep(motion, substep_s);
  for (const FineStep& step : steps) {
    for (const PlacedImpulse& push : step.pushes) {
      const std::size_t body = bodies.moving_of[push.body];
      if (body != BulletBodies::kFixed && islands.GroupOf(body) == place) Apply(push);
    }
    if (step.length_s > 0) Step(group, step.length_s, longest_s, sweeps);
  }
  if (!is_reached) return;
  for (const std::size_t body : group.members) {
    reached[body] = bodies.moving[body].Speed() > kResting ? 1 : 0;
  }
}

void BulletWorld::Engine::PassWindow(std::span<const FineStep> steps, double window_s,
                                     double substep_s, bool long_substeps) {
  for (const FineStep& step : steps) {
    for (const PlacedImpulse& push : step.pushes) {
      const std::size_t body = bodies.moving_of[push.body];
      if (body == BulletBodies::kFixed) continue;
      // About a centre that may move a little until then.
      const Kick kick = KickOn(push);
      Mark(body, kick.impulse, kick.angular_impulse);
    }
  }
  const std::span<Group> groups = islands.Plan(window_s, pushed_speed);
  for (std::size_t place = 0; place < groups.size(); ++place) {
    const Group& group = groups[place];
    StepGroup(group, place, steps, window_s, substep_s, long_substeps);
    for (const std::size_t body : group.members) {
      if (!sleepers.Sleeps(body)) moved.push_back(body);
    }
    if (window_s > 0) {
      sleepers.Watch(group.members, group.pairs, group.joints, pushed, window_s);
    }
  }
  if (!(window_s > 0)) return;
  for (const std::size_t body : all_pushed) {
    pushed[body] = 0;
    pushed_speed[body] = 0;
  }
  all_pushed.clear();
}

void BulletWorld::Engine::Advance(std::span<const Stretch> stretches, double substep_s,
                                  bool long_substeps) {
  fine_steps.clear();
  for (const Stretch& stretch : stretches) {
    const int count = SubstepCount(stretch.length_s, substep_s);
    for (int i = 0; i < count; ++i) {
      fine_steps.push_back({.length_s = stretch.length_s / count,
                            .pushes = i == 0 ? stretch.pushes : std::span<const PlacedImpulse>()});
    }
  }
  std::size_t first = 0;
  while (first < fine_steps.size()) {
    const std::size_t end = WindowEnd(first);
    const std::span<const FineStep> steps = std::span(fine_steps).subspan(first, end - first);
    double window_s = 0;
    for (const FineStep& step : steps) window_s += step.length_s;
    PassWindow(steps, window_s, substep_s, long_substeps);
    first = end;
  }
}

double BulletWorld::Engine::FastestSpeed() {
  double fastest = 0;
  for (const std::size_t body : sleepers.awake()) {
    fastest = std::max(fastest, bodies.moving[body].Speed());
  }
  return fastest;
}

double BulletWorld::Engine::PushedSpeed(const PlacedImpulse& push) const {
  const std::size_t place = bodies.moving_of[push.body];
  if (place == BulletBodies::kFixed) return 0;
  const MovingBody& body = bodies.moving[place];
  const Kick kick = KickOn(push);
  return AddedSpeed(body, kick.impulse, kick.angular_impulse);
}

// The window that begins with fine step `first` ends before this one.
std::size_t BulletWorld::Engine::WindowEnd(std::size_t first) {
  double speed = FastestSpeed();
  double window_s = 0;
  std::size_t end = first;
  for (; end < fine_steps.size(); ++end) {
    for (const PlacedImpulse& push : fine_steps[end].pushes) speed += PushedSpeed(push);
    window_s += fine_steps[end].length_s;
    if (end == first) continue;  // at least one
    if (window_s > kWindow * (1 + kSameTime) || speed * window_s > kFarWay * bodies.smallest) break;
  }
  return end;
}

BulletWorld::BulletWorld(const Scene& scene, double substep_s)
    : BulletWorld(scene, substep_s, EngineParts::Of(scene)) {}

BulletWorld::BulletWorld(const Scene& scene, double substep_s, const EngineParts& parts)
    : scene_(scene), substep_s_(substep_s) {
  if (!(substep_s > 0)) throw std::invalid_argument("a substep must be longer than 0 s");
  bool moves = false;
  for (const SceneBody& body : scene.bodies) {
    states_.push_back({.pose = body.pose_WB});
    moves = moves || !body.fixed;
  }
  if (moves) engine_ = std::make_unique<Engine>(scene, parts);
}

BulletWorld::~BulletWorld() = default;

std::size_t BulletWorld::body_count() const {
  return states_.size();
}

bool BulletWorld::simulates() const {
  return engine_ != nullptr;
}

std::size_t BulletWorld::awake() const {
  return engine_ ? engine_->sleepers.awake().size() : 0;
}

std::uint64_t BulletWorld::substeps() const {
  return engine_ ? engine_->substeps : 0;
}

BodyState BulletWorld::State(std::size_t body) const {
  return states_[body];
}

void BulletWorld::ReadStates() {
  for (const std::size_t place : engine_->moved) {
    const MovingBody& body = engine_->bodies.moving[place];
    states_[static_cast<std::size_t>(body.rigid->getUserIndex2())] = body.State();
    engine_->islands.UpdateBox(place);
  }
  engine_->moved.clear();
}

void BulletWorld::SetState(std::size_t body, const BodyState& state) {
  if (!engine_ || scene_.bodies[body].fixed) return;
  const std::size_t place = engine_->bodies.moving_of[body];
  if (!engine_->sleepers.SleepsOn(place, state)) {
    engine_->sleepers.Wake(place);
    engine_->reached[place] = 1;  // for all that is known of it
  }
  engine_->bodies.moving[place].SetState(state);
  engine_->islands.UpdateBox(place);
  states_[body] = state;
}

void BulletWorld::ApplyAndStep(std::span<const Kick> kicks, double period_s) {
  if (!engine_) return;
  for (const Kick& kick : kicks) engine_->Apply(kick);
  const Stretch whole{.length_s = period_s};
  if (period_s > 0) engine_->Advance({&whole, 1}, substep_s_, false);
  ReadStates();
}

void BulletWorld::Play(std::span<const Stretch> stretches) {
  if (!engine_) return;
  engine_->Advance(stretches, substep_s_, engine_->parts.long_substeps);
  ReadStates();
}

bool BulletWorld::FindContacts(std::size_t body, double reach_m,
                               std::vector<ContactSite>& sites) const {
  if (!engine_ || scene_.bodies[body].fixed) return false;
  const std::size_t place = engine_->bodies.moving_of[body];
  const std::vector<std::size_t> others = engine_->islands.NearTo(place, reach_m);
  const std::size_t first = sites.size();
  if (!site_finder_.Find(states_, body, reach_m, others, sites)) return false;
  const std::span<ContactSite> found = std::span(sites).subspan(first);
  for (ContactSite& site : found) site.gap += engine_->resting_depth;
  const MovingBody& moving = engine_->bodies.moving[place];
  // Of a substep as long as those of what is pushed, however long the last one was.
  const double scale = moving.last_step_s > substep_s_ ? substep_s_ / moving.last_step_s : 1;
  AddImpulses(moving, states_[body].pose, engine_->pairs.Of(place), scale, found);
  return true;
}

}  // namespace rikiseki::world
