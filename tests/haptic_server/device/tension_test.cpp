// SPDX-License-Identifier: MIT
#include "haptic_server/device/tension.h"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "tests/haptic_server/csv.h"

namespace rikiseki::haptic {
namespace {

using Directions = std::array<Vec3, kTensionStrings>;

const std::array<Vec3, 4> kCube = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                                   Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};

Directions DirectionsAt(const Vec3& position) {
  Directions directions;
  for (std::size_t i = 0; i < 4; ++i) directions[i] = (kCube[i] - position).normalized();
  return directions;
}

double Sum(const FourStrings& tension) {
  return tension[0] + tension[1] + tension[2] + tension[3];
}

// The smallest sum that displays the force, or infinity: an optimum of a linear program is at a
// vertex, where one string is at a bound and the other three follow.
double SmallestSum(const Directions& directions, const Vec3& force, const TensionBounds& bounds) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t fixed = 0; fixed < 4; ++fixed) {
    Mat3 rest;
    std::array<std::size_t, 3> free{};
    for (std::size_t i = 0, column = 0; i < 4; ++i) {
      if (i == fixed) continue;
      free[column] = i;
      rest.col(static_cast<Eigen::Index>(column++)) = directions[i];
    }
    for (const double bound : {bounds.min_n, bounds.max_n}) {
      const Vec3 t = rest.fullPivLu().solve(Vec3(force - bound * directions[fixed]));
      if (t.minCoeff() >= bounds.min_n - 1e-10 && t.maxCoeff() <= bounds.max_n + 1e-10) {
        best = std::min(best, bound + t.sum());
      }
    }
  }
  return best;
}

// The smallest force error, by coordinate descent, which converges for a quadratic in a box.
double SmallestError(const Directions& directions, const Vec3& force, const TensionBounds& bounds) {
  FourStrings t;
  t.fill(bounds.min_n);
  for (int sweep = 0; sweep < 20'000; ++sweep) {
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3 missing = force - StringForce(directions, t);
      t[i] = std::clamp(t[i] + directions[i].dot(missing), bounds.min_n, bounds.max_n);
    }
  }
  return (StringForce(directions, t) - force).norm();
}

TEST_CASE("tensions match the independent reference") {
  const auto rows = ReadCsv(RIKISEKI_SOURCE_DIR "/tests/data/spidar_tension_cases.csv");
  REQUIRE(rows.size() == 120);
  for (const CsvRow& row : rows) {
    const auto number = [&](const char* column) { return std::stod(row.at(column)); };
    const Directions directions = DirectionsAt({number("px"), number("py"), number("pz")});
    const Vec3 force(number("Fx"), number("Fy"), number("Fz"));
    const TensionBounds bounds{number("tmin"), number("tmax")};
    CAPTURE(row.at("case"));
    const TensionAllocation got = AllocateTensions(directions, force, bounds);
    const bool feasible = row.at("feasible") == "1";
    REQUIRE(got.feasible == feasible);
    const char* columns[] = {"t0", "t1", "t2", "t3"};
    for (std::size_t i = 0; i < 4; ++i) {
      REQUIRE(std::abs(got.tension[i] - number(columns[i])) <= 1e-6);
      REQUIRE(got.tension[i] >= bounds.min_n);
      REQUIRE(got.tension[i] <= bounds.max_n);
    }
    const double error = (got.force - force).norm();
    if (feasible) {
      REQUIRE(error <= 1e-12 * std::max(1.0, force.norm()));
    } else {
      REQUIRE(error <= number("force_error_N") + 1e-6);
    }
  }
}

TEST_CASE(
    "random forces: bounds hold, feasible ones balance with the smallest sum, others miss least") {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-0.2, 0.2);
  std::normal_distribution<double> push(0, 6);
  const TensionBounds all_bounds[] = {{0, 20}, {0.5, 20}, {0.3, 10}, {0.25, 4}};
  int feasible_count = 0;
  int infeasible_count = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Directions directions = DirectionsAt({place(random), place(random), place(random)});
    const Vec3 force(push(random), push(random), push(random));
    const TensionBounds bounds = all_bounds[i % 4];
    const TensionAllocation got = AllocateTensions(directions, force, bounds);
    for (const double t : got.tension) {
      REQUIRE(t >= bounds.min_n);
      REQUIRE(t <= bounds.max_n);
    }
    REQUIRE((got.force - StringForce(directions, got.tension)).norm() == 0);
    const double smallest = SmallestSum(directions, force, bounds);
    if (std::isfinite(smallest)) {
      ++feasible_count;
      REQUIRE(got.feasible);
      REQUIRE((got.force - force).norm() <= 1e-12 * std::max(1.0, Sum(got.tension)));
      REQUIRE(Sum(got.tension) <= smallest + 1e-8);
    } else if (++infeasible_count % 10 == 0) {
      REQUIRE((got.force - force).norm() <= SmallestError(directions, force, bounds) + 1e-7);
    }
  }
  REQUIRE(feasible_count > 3000);
  REQUIRE(infeasible_count > 3000);
}

TEST_CASE("the displayed force is continuous where feasibility ends") {
  const Directions directions = DirectionsAt({0.05, -0.02, 0.08});
  const TensionBounds bounds{0.5, 10};
  Vec3 before = AllocateTensions(directions, Vec3::Zero(), bounds).force;
  for (int i = 1; i <= 40'000; ++i) {
    const Vec3 wanted = Vec3(0.6, -0.64, 0.48) * (i * 1e-3);
    const Vec3 now = AllocateTensions(directions, wanted, bounds).force;
    REQUIRE((now - before).norm() <=
            1.01e-3);  // a projection never moves more than what it projects
    before = now;
  }
}

TEST_CASE("degenerate strings and damaged forces still respect the bounds") {
  const TensionBounds bounds{0.5, 20};
  const Vec3 x = Vec3::UnitX();
  for (const Directions& directions :
       {Directions{x, x, x, x}, Directions{x, -x, Vec3::UnitY(), -Vec3::UnitY()},
        Directions{Vec3::Zero(), x, Vec3::UnitY(), Vec3::UnitZ()}}) {
    for (const Vec3& force : {Vec3(1, 2, 3), Vec3(1e9, 0, 0), Vec3(1e300, -1e308, 0),
                              Vec3(std::nan(""), 0, 0), Vec3(0, INFINITY, 0), Vec3(1e-310, 0, 0)}) {
      const TensionAllocation got = AllocateTensions(directions, force, bounds);
      for (const double t : got.tension) {
        REQUIRE(t >= bounds.min_n);
        REQUIRE(t <= bounds.max_n);
      }
      REQUIRE(got.force.allFinite());
    }
  }
}

TEST_CASE("directions that are no numbers leave the strings at their least") {
  Directions directions = DirectionsAt({0.01, 0.02, 0.03});
  directions[2] = Vec3::Constant(std::nan(""));
  const TensionAllocation got = AllocateTensions(directions, Vec3(1, 2, 3), {0.5, 20});
  REQUIRE(got.tension == FourStrings{0.5, 0.5, 0.5, 0.5});
  REQUIRE_FALSE(got.feasible);
}

TEST_CASE("a force beyond all numbers pulls as one that is merely far too large") {
  const Directions directions = DirectionsAt({0.01, 0.02, 0.03});
  const TensionBounds bounds{0.5, 20};
  const Vec3 along(1, -2, 0.5);
  const TensionAllocation far = AllocateTensions(directions, 1e6 * along, bounds);
  const TensionAllocation farther = AllocateTensions(directions, 1e300 * along, bounds);
  REQUIRE(farther.tension == far.tension);
  REQUIRE((far.force - 1e6 * along).norm() < 1e6 * along.norm());
}

}  // namespace
}  // namespace rikiseki::haptic
