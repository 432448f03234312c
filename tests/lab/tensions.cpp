// SPDX-License-Identifier: MIT
#include "tests/lab/tensions.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <numeric>
#include <ostream>
#include <random>
#include <string>
#include <vector>

namespace rikiseki::lab {
namespace {

using haptic::FourStrings;
using haptic::kTensionStrings;
using haptic::TensionAllocation;
using haptic::TensionBounds;
using Directions = std::array<Vec3, kTensionStrings>;

constexpr double kHalfSide = 0.265;    // m, of the cube whose alternate corners hold the motors
constexpr double kFarthest = 10;       // m, of a grip
constexpr double kLargestForce = 1e6;  // N, in a row, and as a bound
constexpr double kAgreement = 1e-6;    // N, with a reference
constexpr double kBalance = 1e-12;     // of the force or the sum of tensions, whichever is larger
constexpr double kOptimal = 1e-9;      // ... that the residual may be

Directions DirectionsFrom(const Vec3& grip) {
  const double h = kHalfSide;
  const std::array<Vec3, kTensionStrings> motors = {Vec3(-h, h, h), Vec3(h, h, -h),
                                                    Vec3(-h, -h, -h), Vec3(h, -h, h)};
  Directions directions;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    directions[i] = (motors[i] - grip).stableNormalized();
  }
  return directions;
}

double Sum(const FourStrings& tension) {
  return std::accumulate(tension.begin(), tension.end(), 0.0);
}

}  // namespace

double TensionResidual(const Directions& directions, const Vec3& force, const TensionBounds& bounds,
                       const TensionAllocation& allocation) {
  Vec3 missing = force;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    missing -= directions[i] * allocation.tension[i];
  }
  if (!allocation.feasible) {
    double residual = 0;
    for (std::size_t i = 0; i < kTensionStrings; ++i) {
      const double t = allocation.tension[i];
      const double downhill =
          std::clamp(t + directions[i].dot(missing), bounds.min_n, bounds.max_n);
      residual = std::max(residual, std::abs(downhill - t));
    }
    return residual;
  }
  Eigen::Matrix<double, 3, 4> strings;
  for (Eigen::Index i = 0; i < 4; ++i) strings.col(i) = directions[static_cast<std::size_t>(i)];
  const Eigen::FullPivLU<Eigen::Matrix<double, 3, 4>> factors(strings);
  if (factors.rank() < 3) return missing.norm();  // more than one direction: nothing is said
  Eigen::Vector4d balanced = factors.kernel().col(0);
  if (balanced.sum() < 0) balanced = -balanced;
  double room = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    const double along = balanced[static_cast<Eigen::Index>(i)];
    const double t = allocation.tension[i];
    if (along > 0) room = std::min(room, (t - bounds.min_n) / along);
    if (along < 0) room = std::min(room, (t - bounds.max_n) / along);
  }
  return std::max(missing.norm(), room * balanced.sum());
}

namespace {

enum Result : std::size_t { kFeasible, kFirst, kLast = kFirst + 3, kError, kResidual };

struct Task {
  Vec3 grip;
  Vec3 force;
  TensionBounds bounds;
};

Task ParseTask(const Row& row) {
  Task task;
  const char* const places[] = {"px", "py", "pz"};
  const char* const forces[] = {"Fx", "Fy", "Fz"};
  for (int i = 0; i < 3; ++i) {
    task.grip[i] = row.Number(places[i], -kFarthest, kFarthest);
    task.force[i] = row.Number(forces[i], -kLargestForce, kLargestForce);
  }
  task.bounds.min_n = row.Number("tmin", 0, kLargestForce);
  task.bounds.max_n = row.Number("tmax", task.bounds.min_n, kLargestForce);
  return task;
}

// What holds for every row, whatever it expects.
bool KeepsItsWord(const Task& task, const TensionAllocation& allocation, double residual) {
  for (const double t : allocation.tension) {
    if (!(t >= task.bounds.min_n && t <= task.bounds.max_n)) return false;
  }
  const double size = std::max(task.force.norm(), Sum(allocation.tension));
  const double error = (allocation.force - task.force).norm();
  return (!allocation.feasible || error <= kBalance * size) && residual <= kOptimal * (1 + size);
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const Task task = ParseTask(row);
  const Directions directions = DirectionsFrom(task.grip);
  const TensionAllocation allocation =
      haptic::AllocateTensions(directions, task.force, task.bounds);
  const double residual = TensionResidual(directions, task.force, task.bounds, allocation);
  const FourStrings& t = allocation.tension;
  return {KeepsItsWord(task, allocation, residual) ? RowStatus::kOk : RowStatus::kMissed,
          {allocation.feasible ? 1.0 : 0.0, t[0], t[1], t[2], t[3],
           (allocation.force - task.force).norm(), residual}};
}

bool Agrees(const Row& row, const Outcome& outcome, std::size_t index) {
  constexpr const char* kTensions[] = {"t0", "t1", "t2", "t3"};
  const double got = outcome.values[index];
  if (index == kFeasible) return ExpectedNumber(row, "feasible") == got;
  if (index >= kFirst && index <= kLast) {
    const char* const column = kTensions[index - kFirst];
    return std::abs(got - ExpectedNumber(row, column)) <= kAgreement + RoundingOf(row.Text(column));
  }
  if (index == kError) return got <= ExpectedNumber(row, "force_error_N") + kAgreement;
  return true;  // what the laboratory says beside: nothing to compare with
}

Table Grid(bool quick) {
  Table table("the grid of tensions",
              {"case", "category", "px", "py", "pz", "Fx", "Fy", "Fz", "tmin", "tmax"});
  std::mt19937_64 random(20241101);
  std::uniform_real_distribution<double> within(-1, 1);
  std::normal_distribution<double> gauss;
  const auto vector = [&](auto& distribution, double scale) {
    const double x = distribution(random);
    const double y = distribution(random);
    const double z = distribution(random);
    return Vec3(scale * x, scale * y, scale * z);
  };
  const TensionBounds bounds[] = {{0, 20}, {0.5, 20}, {0.3, 10}, {0.25, 10}};
  const int repeats = quick ? 50 : 2000;
  const auto add = [&](const std::string& category, double place_m, double force_n) {
    for (int i = 0; i < repeats; ++i) {
      const Vec3 grip = vector(within, place_m);
      const Vec3 force = vector(gauss, force_n);
      const TensionBounds& bound = bounds[i % 4];
      table.Append({std::to_string(table.size()), category, ToField(grip.x()), ToField(grip.y()),
                    ToField(grip.z()), ToField(force.x()), ToField(force.y()), ToField(force.z()),
                    ToField(bound.min_n), ToField(bound.max_n)});
    }
  };
  add("centre, no force", 0, 0);
  add("centre", 0, 5);
  add("light", 0.15, 0.5);
  add("common", 0.15, 5);
  add("strong", 0.15, 50);
  add("beyond all motors", 0.15, 1e5);
  add("anywhere in the cube", kHalfSide, 5);
  add("outside the cube", 3 * kHalfSide, 5);
  return table;
}

struct Group {
  std::string category;
  int rows = 0;
  int infeasible = 0;
  double worst_balance = 0;  // of the feasible
  double worst_residual = 0;
};

// By category: how often the strings cannot, how exact they are where they can.
void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::vector<Group> groups;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& values = outcomes[i].values;
    const std::string category = rows.row(i).Find("category").value_or("all");
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const Group& known) { return known.category == category; });
    if (group == groups.end()) {
      groups.push_back({.category = category});
      group = groups.end() - 1;
    }
    ++group->rows;
    if (values[kFeasible] == 0) {
      ++group->infeasible;
    } else {
      group->worst_balance = std::max(group->worst_balance, values[kError]);
    }
    group->worst_residual = std::max(group->worst_residual, values[kResidual]);
  }
  out << "Tensions by category: worst force error where the force is feasible, worst distance from "
         "the conditions\nof an exact solution\n"
      << std::left << std::setw(24) << "category" << std::right << std::setw(8) << "rows"
      << std::setw(12) << "infeasible" << std::setw(14) << "error [N]" << std::setw(14)
      << "residual [N]"
      << "\n";
  for (const Group& group : groups) {
    out << std::left << std::setw(24) << group.category << std::right << std::setw(8) << group.rows
        << std::setw(12) << group.infeasible << std::scientific << std::setprecision(1)
        << std::setw(14) << group.worst_balance << std::setw(14) << group.worst_residual << "\n";
  }
  out << std::defaultfloat;
}

}  // namespace

Case Tensions() {
  Case study;
  study.name = "tensions";
  study.purpose = "the string tensions that display a force (nothing random but the grid)";
  study.results = {{"feasible"}, {"t0"}, {"t1"}, {"t2"}, {"t3"}, {"force_error_N"}, {"residual_N"}};
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
