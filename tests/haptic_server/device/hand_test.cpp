// SPDX-License-Identifier: MIT
#include "haptic_server/device/hand.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

namespace rikiseki::haptic {
namespace {

using Matrix = std::array<std::array<long double, 3>, 3>;

Matrix Times(const Matrix& a, const Matrix& b) {
  Matrix product{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) product[i][j] += a[i][k] * b[k][j];
    }
  }
  return product;
}

// The same step from the exponential of the matrix of d/dt (y, v, F): its power series over a small
// fraction of the time, squared up.
ImpedanceStep ByMatrixExponential(const Impedance& impedance, double dt_s) {
  constexpr int kSquarings = 16;
  const long double dt = std::ldexp(static_cast<long double>(dt_s), -kSquarings);
  const long double m = impedance.mass_kg;
  const Matrix a = {
      {{0, dt, 0},
       {-impedance.stiffness_n_per_m / m * dt, -impedance.damping_ns_per_m / m * dt, dt / m},
       {0, 0, 0}}};
  // Without the identity, which would drown it: exp(2 a) - 1 = 2 e + e e, with e = exp(a) - 1.
  Matrix term = a;
  Matrix e = a;
  for (int order = 2; order < 20; ++order) {
    term = Times(term, a);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) e[i][j] += term[i][j] /= order;
    }
  }
  for (int squaring = 0; squaring < kSquarings; ++squaring) {
    const Matrix square = Times(e, e);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) e[i][j] = 2 * e[i][j] + square[i][j];
    }
  }
  const auto at = [&](std::size_t i, std::size_t j) {
    return static_cast<double>(e[i][j] + (i == j ? 1 : 0));
  };
  return {at(0, 0), at(0, 1), at(0, 2), at(1, 0), at(1, 1), at(1, 2)};
}

void RequireClose(double got, double expected, double scale) {
  REQUIRE(std::abs(got - expected) <= 1e-11 * scale);
}

TEST_CASE("the hand's step is exact at every damping and every length") {
  const Impedance impedances[] = {{0.13, 2.2, 50},     {0.58, 6.7, 135}, {1.53, 30.2, 1000},
                                  {0.038, 3.2, 300},   {1, 20, 100},  // critical
                                  {1, 20.000001, 100},                // nearly
                                  {1, 200, 100},                      // overdamped
                                  {0.5, 0, 0},         {0.5, 3, 0},      {0.5, 0, 800},
                                  {1, 50, 1e-7}};
  for (const Impedance& impedance : impedances) {
    for (const double dt_s : {1e-6, 1e-3, 1.37e-3, 0.02, 0.3}) {
      CAPTURE(impedance.mass_kg, impedance.damping_ns_per_m, impedance.stiffness_n_per_m, dt_s);
      const ImpedanceStep got = ExactStep(impedance, dt_s);
      const ImpedanceStep expected = ByMatrixExponential(impedance, dt_s);
      RequireClose(got.yy, expected.yy, 1);
      RequireClose(got.yv, expected.yv, dt_s);
      RequireClose(got.yf, expected.yf, std::abs(expected.yf) + 1e-30);
      RequireClose(got.vy, expected.vy, 1 + std::abs(expected.vy));
      RequireClose(got.vv, expected.vv, 1);
      RequireClose(got.vf, expected.vf, dt_s / impedance.mass_kg);
    }
  }
}

TEST_CASE("steps of any length compose: many short ones end where a long one does") {
  const Impedance impedance{0.9, 15, 500};
  const Vec3 force(1, -2, 0.5);
  Hand once([](double) { return Vec3(Vec3::Zero()); }, impedance);
  Hand often([](double) { return Vec3(Vec3::Zero()); }, impedance);
  once.Advance(100'000'000, force);
  std::int64_t left = 100'000'000;
  for (std::int64_t dt = 100'000; left > 0; dt = dt * 13 / 11) {
    often.Advance(std::min(dt, left), force);
    left -= std::min(dt, left);
  }
  REQUIRE((once.position() - often.position()).norm() < 1e-14);
  REQUIRE((once.yielding_velocity() - often.yielding_velocity()).norm() < 1e-12);
  REQUIRE(once.now_ns() == often.now_ns());
}

TEST_CASE("under a constant force the hand settles at F/k") {
  Hand hand([](double t_s) { return Vec3(t_s, 0, 0); }, {0.9, 15, 500});
  hand.Advance(20'000'000'000, Vec3(5, 0, -1));
  REQUIRE((hand.position() - hand.target() - Vec3(0.01, 0, -0.002)).norm() < 1e-12);
  REQUIRE(hand.target().x() == Approx(20));
}

TEST_CASE("a stirring hand goes everywhere in its box, and the same way for the same seed") {
  const Vec3 corner(-0.06, 0.05, -0.02), opposite(0.06, -0.05, 0.04);
  const auto strokes = StirringStrokes(corner, opposite, 0.3, 0.1, 1, 400);
  REQUIRE(strokes.size() == 800);
  Vec3 low = strokes[0].to, high = strokes[0].to;
  for (std::size_t i = 0; i < strokes.size(); i += 2) {
    CHECK(strokes[i].duration_s == 0.3);
    CHECK(strokes[i + 1].duration_s == 0.1);
    CHECK(strokes[i].to == strokes[i + 1].to);
    low = low.cwiseMin(strokes[i].to);
    high = high.cwiseMax(strokes[i].to);
  }
  const Vec3 box_low = corner.cwiseMin(opposite), box_high = corner.cwiseMax(opposite);
  CHECK((low - box_low).minCoeff() >= 0);
  CHECK((box_high - high).minCoeff() >= 0);
  // The chance that 400 places leave 5 % of an axis empty is 1e-9.
  CHECK((low - box_low).maxCoeff() < 0.05 * 0.12);
  CHECK((box_high - high).maxCoeff() < 0.05 * 0.12);
  CHECK(StirringStrokes(corner, opposite, 0.3, 0, 1, 2)[1].to == strokes[2].to);
  CHECK(StirringStrokes(corner, opposite, 0.3, 0, 2, 2)[1].to != strokes[2].to);
}

TEST_CASE("a stroke follows the minimum-jerk profile") {
  REQUIRE(MinimumJerk(-1) == 0);
  REQUIRE(MinimumJerk(0.5) == 0.5);
  REQUIRE(MinimumJerk(2) == 1);
  MotorProgram program({.home = Vec3(-0.04, 0, 0),
                        .strokes = {{Vec3(0.02, 0, 0), 0.12}, {Vec3(-0.04, 0, 0), 0.12}}});
  REQUIRE(program(0).x() == -0.04);
  REQUIRE(program(0.06).x() == Approx(-0.01));
  REQUIRE(program(0.12).x() == Approx(0.02));
  REQUIRE(program(0.18).x() == Approx(-0.01));
  REQUIRE(program(100).x() == -0.04);
}

TEST_CASE("rests are random within their bounds, and alike for the same seed") {
  const MotorProgram::Script script{.home = Vec3::Zero(),
                                    .strokes = {{Vec3(0.1, 0, 0), 0.1}, {Vec3::Zero(), 0.1}},
                                    .repeats = true,
                                    .rest_s = 0.5,
                                    .rest_jitter_s = 0.1,
                                    .seed = 7};
  MotorProgram one(script);
  MotorProgram two(script);
  std::vector<double> starts;
  bool moving = false;
  for (int ms = 0; ms < 20'000; ++ms) {
    const double t_s = 0.001 * ms;
    const Vec3 position = one(t_s);
    REQUIRE(position == two(t_s));
    if (position.x() > 0 && !moving) starts.push_back(t_s);
    moving = position.x() > 0;
  }
  REQUIRE(starts.size() > 20);
  double shortest = 10;
  double longest = 0;
  for (std::size_t i = 1; i < starts.size(); ++i) {
    shortest = std::min(shortest, starts[i] - starts[i - 1]);
    longest = std::max(longest, starts[i] - starts[i - 1]);
  }
  REQUIRE(shortest >= 0.7 - 0.0015);
  REQUIRE(longest <= 0.8 + 0.0015);
  REQUIRE(longest - shortest > 0.05);
}

TEST_CASE("hands and programs that make no sense are refused") {
  const auto still = [](double) { return Vec3(Vec3::Zero()); };
  REQUIRE_THROWS_AS(Hand(still, Impedance{0, 1, 1}), std::invalid_argument);
  REQUIRE_THROWS_AS(Hand(still, Impedance{1, -1, 1}), std::invalid_argument);
  REQUIRE_THROWS_AS(Hand(still, Impedance{1, 1, std::nan("")}), std::invalid_argument);
  REQUIRE_THROWS_AS(MotorProgram({.home = Vec3::Zero(), .strokes = {}, .repeats = true}),
                    std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
