// SPDX-License-Identifier: MIT
#include "tests/lab/tensions.h"

#include <catch2/catch.hpp>
#include <sstream>

namespace rikiseki::lab {
namespace {

using haptic::TensionAllocation;
using haptic::TensionBounds;

StudyResult Run(const std::string& rows) {
  std::istringstream in(rows);
  return RunStudy(Tensions(), Table::Read(in, "t.csv"), {});
}

std::string Refusal(const std::string& rows) {
  try {
    Run(rows);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

const std::string kInputs = "px,py,pz,Fx,Fy,Fz,tmin,tmax";

}  // namespace

TEST_CASE("the reference tensions come out") {
  const StudyResult result = RunStudy(
      Tensions(), Table::Load(RIKISEKI_SOURCE_DIR "/tests/data/spidar_tension_cases.csv"), {});
  CHECK(result.rows.size() == 120);
  CHECK(result.Count(RowStatus::kOk) == 120);
}

TEST_CASE("an expected tension is met within 1e-6 N, an expected error may be undercut") {
  const auto status = [](const std::string& expected) {
    const std::string row = "0,0,0,0,0,0,0.5,20," + expected + "\n";
    return Run(kInputs + ",t0,t1,t2,t3,feasible,force_error_N\n" + row).outcomes.at(0).status;
  };
  CHECK(status("0.5,0.5,0.5,0.5,1,0") == RowStatus::kOk);
  CHECK(status("0.5,0.5,0.5,0.5,1,3") == RowStatus::kOk);
  CHECK(status("0.5,0.5000009,0.5,0.5,1,0") == RowStatus::kOk);
  CHECK(status("0.5,0.5000012,0.5,0.5,1,0") == RowStatus::kMissed);
  CHECK(status("0.5,0.5,0.5,nan,1,0") == RowStatus::kMissed);
  CHECK(status("0.5,0.5,0.5,0.5,0,0") == RowStatus::kMissed);
  CHECK(status(",,,,,") == RowStatus::kOk);
  const auto beyond = [](const std::string& error) {
    return Run(kInputs + ",force_error_N\n0,0,0,1000,0,0,0.5,20," + error + "\n").outcomes.at(0);
  };
  const Outcome outcome = beyond("");
  CHECK(outcome.values.at(0) == 0);
  CHECK(beyond(ToField(outcome.values.at(5) - 2e-6)).status == RowStatus::kMissed);
  CHECK(beyond(ToField(outcome.values.at(5))).status == RowStatus::kOk);
}

TEST_CASE("the residual tells the smallest sum and the smallest error from what is neither") {
  const double s = 1 / std::sqrt(3.0);
  const std::array<Vec3, 4> corners = {Vec3(-s, s, s), Vec3(s, s, -s), Vec3(-s, -s, -s),
                                       Vec3(s, -s, s)};
  const TensionBounds bounds{0.5, 20};
  TensionAllocation allocation{{0.5, 0.5, 0.5, 0.5}, Vec3::Zero(), true};
  CHECK(TensionResidual(corners, Vec3::Zero(), bounds, allocation) < 1e-15);
  allocation.tension.fill(0.75);  // the force is as good, the sum is 1 N too much
  CHECK(TensionResidual(corners, Vec3::Zero(), bounds, allocation) == Approx(1));
  allocation.tension[2] = 0.85;  // 0.1 N along a string is not balanced, 1 N of the sum is spare
  CHECK(TensionResidual(corners, Vec3::Zero(), bounds, allocation) == Approx(1));
  allocation.tension = {0.5, 0.5, 0.6, 0.5};
  CHECK(TensionResidual(corners, Vec3::Zero(), bounds, allocation) == Approx(0.1));

  // 1000 N along x: both strings that pull so at the most, the others at the least.
  allocation = {{0.5, 20, 0.5, 20}, Vec3::Zero(), false};
  const Vec3 far(1000, 0, 0);
  CHECK(TensionResidual(corners, far, bounds, allocation) == 0);
  allocation.tension[1] = 19;
  CHECK(TensionResidual(corners, far, bounds, allocation) == Approx(1));
  allocation.tension = {0.5, 20, 0.7, 20};
  CHECK(TensionResidual(corners, far, bounds, allocation) == Approx(0.2));
}

TEST_CASE("rows of tensions that make no sense are refused") {
  CHECK(Refusal(kInputs + "\n0,0,0,0,0,0,2,1\n").starts_with("t.csv:2: tmax = 1"));
  CHECK(Refusal(kInputs + "\n0,0,0,nan,0,0,0,1\n").starts_with("t.csv:2: Fx = nan"));
  CHECK(Refusal(kInputs + "\n11,0,0,0,0,0,0,1\n").starts_with("t.csv:2: px = 11"));
}

TEST_CASE("the grid of tensions is solved exactly, also beyond motors and outside the cube") {
  const StudyResult result = RunStudy(Tensions(), Tensions().grid(/*quick=*/true), {});
  CHECK(result.Count(RowStatus::kOk) == result.rows.size());
  int infeasible = 0;
  for (const Outcome& outcome : result.outcomes) infeasible += outcome.values.at(0) == 0 ? 1 : 0;
  CHECK(infeasible > 50);
  CHECK(infeasible < 350);
  std::ostringstream summary;
  Tensions().summarise(result.rows, result.outcomes, summary);
  CHECK(summary.str().find("outside the cube") != std::string::npos);
}

}  // namespace rikiseki::lab
