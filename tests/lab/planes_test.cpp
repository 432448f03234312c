// SPDX-License-Identifier: MIT
#include "tests/lab/planes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <sstream>

namespace rikiseki::lab {
namespace {

using haptic::HalfSpace;

StudyResult Run(const std::string& rows) {
  std::istringstream in(rows);
  return RunStudy(Planes(), Table::Read(in, "t.csv"), {});
}

std::string Refusal(const std::string& rows) {
  try {
    Run(rows);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

const std::string kInputs = "Cx,Cy,Cz,n_planes,planes px py pz nx ny nz;...";

}  // namespace

TEST_CASE("the reference planes come out") {
  const StudyResult result =
      RunStudy(Planes(), Table::Load(RIKISEKI_SOURCE_DIR "/tests/data/plane_cases.csv"), {});
  CHECK(result.rows.size() == 105);
  CHECK(result.Count(RowStatus::kOk) == 105);
  // Not by tolerance alone: each is the exact solution of its problem.
  for (const Outcome& outcome : result.outcomes) CHECK(outcome.values.at(6) <= 1e-12);
}

TEST_CASE("planes as text may hold what no number is") {
  const auto planes = ParsePlanes("0 1 2 3 4 5; nan -1e-3 inf 0 0 1");
  REQUIRE(planes.size() == 2);
  CHECK(planes[0].point == Vec3(0, 1, 2));
  CHECK(planes[0].normal == Vec3(3, 4, 5));
  CHECK(std::isnan(planes[1].point.x()));
  CHECK(std::isinf(planes[1].point.z()));
  CHECK(ParsePlanes("").empty());
  CHECK_THROWS_AS(ParsePlanes("0 0 0 0 1"), std::invalid_argument);
  CHECK_THROWS_AS(ParsePlanes("0 0 0 0 1 0 0"), std::invalid_argument);
  CHECK_THROWS_AS(ParsePlanes("0 0 0 0 1 1x"), std::invalid_argument);
}

TEST_CASE("an expected proxy is met within 1e-9 of 1 m + |D|, as a vector") {
  const auto status = [](const std::string& expected) {
    const std::string row = "0,-0.002,0,1,0 0 0 0 1 0," + expected + "\n";
    return Run(kInputs + ",Dx,Dy,Dz,dist,n_active,feasible\n" + row).outcomes.at(0).status;
  };
  CHECK(status("0,0,0,0.002,1,1") == RowStatus::kOk);
  CHECK(status("9e-10,0,0,0.002,1,1") == RowStatus::kOk);
  CHECK(status("9e-10,0,9e-10,0.002,1,1") == RowStatus::kMissed);
  CHECK(status("0,0,0,0.0020000012,1,1") == RowStatus::kMissed);
  CHECK(status("0,0,0,0.002,2,1") == RowStatus::kMissed);
  CHECK(status("0,0,0,0.002,1,0") == RowStatus::kMissed);
  CHECK(status("nan,0,0,0.002,1,1") == RowStatus::kMissed);
  CHECK(status(",,,,,") == RowStatus::kOk);
}

TEST_CASE("the condition is that of the normals that touch") {
  const auto condition = [](double angle) {
    const std::vector<HalfSpace> planes{
        {Vec3::Zero(), Vec3::UnitY()},
        {Vec3::Zero(), Vec3(std::sin(angle), std::cos(angle), 0)},
        {Vec3(0, -1, 0), Vec3::UnitY()}};  // far below: does not count
    const Vec3 finger(0, -0.001, 0);
    return ConditionOf(finger, planes, haptic::SolveContact(finger, 0, planes));
  };
  // Two unit normals at an angle a: singular values sqrt(1 +- cos a).
  CHECK(condition(0.1).condition == Approx(1 / std::tan(0.05)));
  CHECK(condition(1e-6).condition == Approx(2e6).epsilon(1e-3));
  CHECK(condition(1e-12).condition == Approx(1).epsilon(1e-9));  // they act as one
  CHECK(condition(M_PI / 2).condition == Approx(1));
}

TEST_CASE("how many planes push is compared only where that is unique") {
  const auto unique = [](const Vec3& finger, const std::vector<HalfSpace>& planes) {
    return ConditionOf(finger, planes, haptic::SolveContact(finger, 0, planes)).unique_count;
  };
  const HalfSpace floor{Vec3::Zero(), Vec3::UnitY()};
  const HalfSpace wall{Vec3::Zero(), Vec3::UnitX()};
  const HalfSpace ceiling{Vec3(0, -1e-3, 0), -Vec3::UnitY()};
  CHECK(unique(Vec3(0, 1, 0), {floor}));
  CHECK(unique(Vec3(0, -1, 0), {floor}));
  CHECK(unique(Vec3(-1, -1, 0), {floor, wall}));
  CHECK_FALSE(unique(Vec3(0, -1, 0), {floor, floor}));       // which of the two
  CHECK_FALSE(unique(Vec3(0, -1, 0), {floor, wall}));        // the wall touches, without a push
  CHECK_FALSE(unique(Vec3(0, -5e-4, 0), {floor, ceiling}));  // nothing lies outside both
}

TEST_CASE("the residual tells a solution from what is none") {
  const std::vector<HalfSpace> planes{{Vec3::Zero(), Vec3::UnitY()}, {Vec3::Zero(), Vec3(1, 1, 0)}};
  const Vec3 finger(0.001, -0.004, 0.002);
  haptic::ContactSolution solution = haptic::SolveContact(finger, 0, planes);
  CHECK(ResidualOf(finger, planes, solution) < 1e-15);
  solution.proxy += Vec3(1e-6, 0, 0);
  CHECK(ResidualOf(finger, planes, solution) == Approx(1e-6).epsilon(0.5));
}

TEST_CASE("rows of planes that make no sense are refused, and too many planes are not supported") {
  CHECK(Refusal(kInputs + "\n0,0,0,2,0 0 0 0 1 0\n").starts_with("t.csv:2: n_planes = 2: "));
  CHECK(Refusal(kInputs + "\n0,0,0,1,0 0 0 0 1\n").starts_with("t.csv:2: planes px py pz"));
  CHECK(Refusal(kInputs + "\nnan,0,0,0,\n").starts_with("t.csv:2: Cx = nan"));
  std::string many = "0 0 0 0 1 0";
  for (int i = 1; i < 33; ++i) many += ";0 0 0 0 1 0";
  CHECK(Run(kInputs + "\n0,0,0,33," + many + "\n").Count(RowStatus::kUnsupported) == 1);
  CHECK(Run("Cx,Cy,Cz,planes\n0,0,0,\n").outcomes.at(0).values.at(0) == 1);  // free everywhere
}

TEST_CASE("the grid of planes is solved exactly, also where planes are nearly parallel") {
  const StudyResult result = RunStudy(Planes(), Planes().grid(/*quick=*/true), {});
  std::ostringstream summary;
  Planes().summarise(result.rows, result.outcomes, summary);
  CHECK(summary.str().find("nearly_parallel_1e-09") != std::string::npos);
  int infeasible = 0;
  for (const Outcome& outcome : result.outcomes) {
    infeasible += outcome.values.at(0) == 0 ? 1 : 0;
    // The solver takes 1e-12 m for touching; planes that act as one are up to 1e-10 rad apart.
    CHECK(outcome.values.at(6) <= 1e-10 * (1 + outcome.values.at(4)));
  }
  CHECK(infeasible > 20);
}

}  // namespace rikiseki::lab
