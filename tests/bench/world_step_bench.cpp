// SPDX-License-Identifier: MIT
// What a tick of the world costs with 10 to 10 000 cubes on a floor, of which the finger pushes one: cost
// grows with what is near or awake, not with what is there. WorldStep::Tick as a whole, at 20 Hz, the
// push replayed tick by tick, in ms of CPU per tick:
//
//   world_step_bench
//
// `first` is the first tick, in which all settle and fall asleep.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <memory>
#include <vector>

#include "tests/world_server/scenes.h"
#include "world_server/features/planes.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/step.h"

namespace rikiseki::world {
namespace {

constexpr double kPeriod = 0.05;
constexpr double kApart = 0.03;  // m, from middle to middle of cubes of 2 cm
constexpr double kForce = 0.2;   // N: the friction of a cube is 0.08 N, two of them move

// As config/scenes/thousand.sdf, of any size.
Scene Cubes(int count) {
  Scene scene;
  scene.bodies.push_back(test::Floor(0.4));
  const int side = static_cast<int>(std::ceil(std::sqrt(count)));
  for (int i = 0; i < count; ++i) {
    scene.bodies.push_back(
        test::Cube(0.02, 0.02, 0.4, {kApart * (i % side), kApart * (i / side), 0.01}));
  }
  return scene;
}

// CPU time: the figures are about one core of its own, whatever else runs.
double CpuMs() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

class Trial {
 public:
  explicit Trial(int count) : scene_(Cubes(count)) {
    auto dynamics = std::make_unique<BulletWorld>(scene_, 1e-3);
    world_ = dynamics.get();
    step_ = std::make_unique<WorldStep>(Settings(), scene_, std::move(dynamics), 0);
    step_->BeginHapticEpoch(1);
    pushed_ = scene_.bodies.size() / 2;
    Message({0, 0, 1});
    step_->Consume(message_);
  }

  /// ms per tick, while the finger is where it is and pushes with `force_n` along x.
  std::vector<double> Ticks(int count, const Vec3& finger, double force_n) {
    std::vector<double> took;
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < 50; ++k) {
        Message(finger);
        Push(force_n);
        step_->Consume(message_);
      }
      const double start = CpuMs();
      step_->Tick(kPeriod, frame_);
      took.push_back(CpuMs() - start);
    }
    return took;
  }

  /// Behind the cube that is pushed.
  Vec3 BehindPushed() const {
    return ToVec3(step_->Bodies()[pushed_].position) - Vec3(0.021, 0, 0);
  }
  const BulletWorld& world() const { return *world_; }
  const protocol::WorldFrame& frame() const { return frame_; }

 private:
  void Message(const Vec3& finger) {
    ++message_.tick;
    message_.start_ns += 1'000'000;
    message_.period_ns = 1'000'000;
    message_.stiffness = 2000;
    message_.pointer_count = 1;
    message_.pointers[0].radius = 0.01;
    message_.pointers[0].position = ToArray(finger);
  }

  void Push(double force_n) {
    if (force_n == 0) return;
    message_.channel_count = 1;
    protocol::Channel& channel = message_.channels[0];
    channel.body = static_cast<std::uint32_t>(pushed_);
    channel.generation = 1;
    channel.opened_tick = 1;
    const Vec3 impulse(force_n * 1e-3, 0, 0);
    impulse_ += impulse;
    angular_impulse_ += ToVec3(step_->Bodies()[pushed_].position).cross(impulse);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      channel.impulse[i] = std::llround(impulse_[axis] / protocol::kImpulseUnit);
      channel.angular_impulse[i] = std::llround(angular_impulse_[axis] / protocol::kImpulseUnit);
    }
  }

  Scene scene_;
  BulletWorld* world_ = nullptr;
  std::unique_ptr<WorldStep> step_;
  std::size_t pushed_ = 0;
  protocol::HapticTick message_;
  protocol::WorldFrame frame_;
  Vec3 impulse_ = Vec3::Zero();
  Vec3 angular_impulse_ = Vec3::Zero();
};

void Measure(int count) {
  const double start = CpuMs();
  Trial trial(count);
  const double built = CpuMs() - start;
  const Vec3 away(0, 0, 1);
  const std::vector<double> fresh = trial.Ticks(40, away, 0);
  const std::size_t still_awake = trial.world().awake();
  const std::vector<double> asleep = trial.Ticks(100, away, 0);
  const std::vector<double> near = trial.Ticks(100, trial.BehindPushed(), 0);
  // The finger follows, and the cube runs into its neighbours.
  std::vector<double> pushing;
  std::size_t awake = 0;
  for (int i = 0; i < 60; ++i) {
    pushing.push_back(trial.Ticks(1, trial.BehindPushed(), kForce).front());
    awake = std::max(awake, trial.world().awake());
  }
  std::printf("%6d  %8.1f  %8.3f  %8.3f  %8.3f  %8.3f  %8.3f  %5zu  %5zu  %6u\n", count, built,
              Quantile(fresh, 0.1), fresh.front(), Quantile(asleep, 0.5), Quantile(near, 0.5),
              Quantile(pushing, 0.5), still_awake, awake, trial.frame().plane_count);
}

}  // namespace
}  // namespace rikiseki::world

int main() {
  std::printf(
      " cubes  build ms  least ms     first    asleep      near   pushing  late   most  planes\n");
  for (const int count : {10, 100, 1000, 9999}) rikiseki::world::Measure(count);
}
