// SPDX-License-Identifier: MIT
#include "haptic_server/safety/split_energy.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace rikiseki::haptic {
namespace {

constexpr std::uint64_t kEpoch = 5;
constexpr std::uint64_t kWorld = 9;
constexpr double kTwoKilograms = 0.5;  // 1/kg

// A body that moves along x, pushed by a finger on its face, which looks against x.
struct Bench {
  SplitEnergy split{{.stiffness_n_per_m = 2000, .finger_radius_m = 0.01}, 256, kEpoch};
  LocalBodies copies{1'000'000, 256, kEpoch, PositionRule{}};
  std::uint64_t tick = 0;
  protocol::Coupling coupling = protocol::Coupling::kImpulse;
  double inverse_mass = kTwoKilograms;
  double face = 0.01;  // m
  double finger = 0;   // m

  // One tick of the loop: `impulse` [N s] on the body, `work` [J] of its surface on the finger.
  void Tick(double impulse, double work) {
    split.Moved(work);
    const BodyImpulse push{
        .body = 3, .generation = 1, .impulse = {impulse, 0, 0}, .angular_impulse = Vec3::Zero()};
    split.Book(tick, Vec3(finger, 0, 0), std::span(&push, impulse != 0 ? 1 : 0));
    ++tick;
  }

  // The frame comes in the present tick, before Book.
  double Frame(std::uint64_t acked, double velocity, std::uint64_t world = kWorld) {
    protocol::WorldFrame frame;
    frame.period_ns = 50'000'000;
    frame.acked_epoch = kEpoch;
    frame.acked_tick = acked;
    frame.coupling = coupling;
    frame.plane_count = 1;
    frame.planes[0].body = 3;
    frame.planes[0].generation = 1;
    frame.planes[0].point = {face, 0, 0};
    frame.planes[0].normal = {-1, 0, 0};
    frame.planes[0].velocity = {velocity, 0, 0};
    frame.planes[0].inverse_mass = inverse_mass;
    return split.Receive(world, frame, copies, tick);
  }
};

TEST_CASE("what a body took is its energy, less what its surface took from the finger") {
  Bench bench;
  bench.Tick(0, 0);
  CHECK(bench.Frame(0, 0.1) == 0);  // the first tells nothing
  for (int k = 0; k < 10; ++k) bench.Tick(0.02, -0.003);
  // 0.2 N s on 2 kg: from 0.1 to 0.2 m/s, 0.03 J. The work of the tick after the last ack, which has
  // not been booked yet, belongs to it: 10 of 0.003 J by then.
  bench.split.Moved(-0.001);
  CHECK(bench.Frame(10, 0.2) == Approx(0.03 - 10 * 0.003 - 0.001).epsilon(1e-12));
}

TEST_CASE("ticks that a late frame does not acknowledge wait for the next") {
  Bench bench;
  bench.Tick(0, 0);
  bench.Frame(0, 0);
  for (int k = 1; k <= 20; ++k) bench.Tick(0.01 * k, -0.001 * k);
  // Acknowledged: ticks 1..8, 0.36 N s; their forces worked in the ticks to 9: 0.045 J.
  CHECK(bench.Frame(8, 0.18) == Approx(0.36 * 0.36 / 4 - 0.045).epsilon(1e-12));
  // Then 9..20, 1.74 N s onto 0.18 m/s; the surface in ticks 10..20: 0.165 J.
  CHECK(bench.Frame(20, 1.05) == Approx(1.74 * (0.18 + 1.74 / 4) - 0.165).epsilon(1e-12));
}

TEST_CASE("the sum over all frames is the energy of the free body less the work of the surface") {
  Bench bench;
  double velocity = -0.3;
  double pushed = 0;
  double work = 0;
  double added = 0;
  bench.Tick(0, 0);
  bench.Frame(0, velocity);
  for (int k = 1; k <= 400; ++k) {
    const double impulse = 0.004 * std::sin(0.05 * k);
    const double step = 1e-3 * std::cos(0.03 * k);
    bench.Tick(impulse, step);
    pushed += impulse;
    work += step;
    if (k % 7 == 0) {
      velocity += pushed * kTwoKilograms;
      pushed = 0;
      added += bench.Frame(static_cast<std::uint64_t>(k), velocity);
    }
  }
  bench.Tick(0, 0);
  added += bench.Frame(bench.tick - 1, velocity + pushed * kTwoKilograms);
  velocity += pushed * kTwoKilograms;
  // Mass 2 kg: m v^2/2 = v^2.
  CHECK(added == Approx(velocity * velocity - 0.09 + work).epsilon(1e-9));
}

TEST_CASE(
    "a kick that the floor takes is no energy of the body, one that brakes it gives some back") {
  Bench bench;
  bench.Tick(0, 0);
  bench.Frame(0, 0);
  for (int k = 0; k < 5; ++k) bench.Tick(0.1, 0);
  CHECK(bench.Frame(5, 0) == 0);  // it sticks
  bench.Tick(0.1, 0);
  CHECK(bench.Frame(6, 0.02) == Approx(0.0004));  // slides, with what friction left it
  bench.Tick(0.1, 0);
  CHECK(bench.Frame(7, -0.4) == 0);  // something else threw it at the finger
  bench.Tick(0.2, 0);
  // The finger brakes it, the floor too: only the finger's part is given to it, 0.2 (-0.4 + 0.05).
  CHECK(bench.Frame(8, -0.1) == Approx(-0.07));
}

TEST_CASE("with `position` the world's own kick is judged, as far as the body shows it") {
  Bench bench;
  bench.coupling = protocol::Coupling::kPosition;
  bench.finger = 0.005;  // 5 mm deep: 10 N for 50 ms, 0.5 N s on 2 kg
  bench.Tick(0, 0);
  bench.Frame(0, 0);
  bench.Tick(0.3, 0);
  CHECK(bench.Frame(1, 0.25) == Approx(0.0625));
  bench.Tick(0.3, 0);
  CHECK(bench.Frame(2, 0.35) == Approx(0.1225 - 0.0625));  // it capped its kick
  bench.Tick(0.3, 0);
  CHECK(bench.Frame(3, 3) == Approx(0.5 * (0.35 + 0.125)));  // gravity did the rest
}

TEST_CASE("what cannot be judged adds nothing") {
  SECTION("a world that does not tell mobility") {
    Bench bench;
    bench.inverse_mass = protocol::kMobilityNotSaid;
    bench.Tick(0, 0);
    bench.Frame(0, 0);
    bench.Tick(0.1, -0.5);
    CHECK(bench.Frame(1, 0.05) == 0);
  }
  SECTION("the first frame of another world") {
    Bench bench;
    bench.Tick(0, 0);
    bench.Frame(0, 0);
    bench.Tick(0.1, -0.5);
    CHECK(bench.Frame(1, 0.05, kWorld + 1) == 0);
    bench.Tick(0.1, 0);
    CHECK(bench.Frame(2, 0.1, kWorld + 1) == Approx(0.01 - 0.0025));
  }
  SECTION("acks of the future, of the past, of what is forgotten") {
    Bench bench;
    bench.Tick(0, 0);
    bench.Frame(0, 0);
    bench.Tick(0.1, -0.5);
    CHECK(bench.Frame(7, 0.05) == 0);
    bench.Tick(0.1, -0.5);
    CHECK(bench.Frame(2, 0.05) == 0);  // begins anew
    for (int k = 0; k < 300; ++k) bench.Tick(0.1, -0.5);
    CHECK(bench.Frame(3, 0.05) == 0);
  }
  SECTION("nonsense") {
    Bench bench;
    bench.Tick(0, 0);
    bench.Frame(0, 1e200);
    bench.Tick(1e200, 0);
    CHECK(std::isfinite(bench.Frame(1, -1e300)));
  }
}

TEST_CASE("more bodies than can be watched: nothing is said until they are acknowledged") {
  Bench bench;
  bench.Tick(0, 0);
  bench.Frame(0, 0);
  std::array<BodyImpulse, kMaxSplitBodies + 1> pushes;
  for (std::size_t i = 0; i < pushes.size(); ++i) {
    pushes[i] = {.body = static_cast<std::uint32_t>(10 + i), .impulse = Vec3::UnitX()};
  }
  bench.split.Book(bench.tick++, Vec3::Zero(), pushes);
  CHECK(bench.Frame(1, 0) == 0);
  bench.Tick(0.2, -0.01);
  CHECK(bench.Frame(2, 0.1) == Approx(0.01 - 0.01).margin(1e-12));
  bench.Tick(0.2, -0.01);
  CHECK(bench.Frame(3, 0.2) == Approx(0.04 - 0.01 - 0.01));
}

}  // namespace
}  // namespace rikiseki::haptic
