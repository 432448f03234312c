// SPDX-License-Identifier: MIT
#include "tests/lab/planes.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <ostream>
#include <random>
#include <sstream>
#include <stdexcept>

namespace rikiseki::lab {
namespace {

using haptic::ContactSolution;
using haptic::HalfSpace;

constexpr double kLargestPlace = 1e12;  // m, of the finger
constexpr double kTouch = 1e-11;        // of the largest coordinate above 1 m
constexpr double kActAsOne = 1e-10;     // rad
constexpr double kPoorCondition = 1e8;
constexpr double kTolerance = 1e-9;      // of 1 m + |D|, up to that condition
constexpr double kPoorTolerance = 1e-6;  // ... beyond it

bool Counts(const HalfSpace& plane) {
  return plane.point.allFinite() && plane.normal.allFinite() && plane.normal.norm() >= 1e-12;
}

// n . (p - x): how deep x lies behind the plane.
double Depth(const HalfSpace& plane, const Vec3& x) {
  return plane.normal.normalized().dot(plane.point - x);
}

double TouchTolerance(const Vec3& finger, const ContactSolution& solution) {
  return kTouch *
         std::max({1.0, finger.cwiseAbs().maxCoeff(), solution.proxy.cwiseAbs().maxCoeff()});
}

}  // namespace

std::vector<HalfSpace> ParsePlanes(const std::string& text) {
  std::vector<HalfSpace> planes;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ';');) {
    std::istringstream words(part);
    std::vector<double> values;
    for (std::string word; words >> word;) {
      std::size_t used = 0;
      values.push_back(std::stod(word, &used));  // reads nan and inf, as streams do not
      if (used != word.size()) throw std::invalid_argument(word + " is not a number");
    }
    if (values.size() != 6) throw std::invalid_argument("a plane is px py pz nx ny nz");
    planes.push_back(
        {Vec3(values[0], values[1], values[2]), Vec3(values[3], values[4], values[5])});
  }
  return planes;
}

ContactCondition ConditionOf(const Vec3& finger, std::span<const HalfSpace> planes,
                             const ContactSolution& solution) {
  const double tolerance = TouchTolerance(finger, solution);
  Eigen::Matrix<double, Eigen::Dynamic, 3> normals(0, 3);
  bool all_push = true;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (!Counts(planes[i])) continue;
    const double depth = Depth(planes[i], solution.proxy);
    const bool holds = solution.feasible ? std::abs(depth) <= tolerance : depth >= -tolerance;
    if (!holds) continue;
    normals.conservativeResize(normals.rows() + 1, Eigen::NoChange);
    normals.bottomRows<1>() = planes[i].normal.normalized().transpose();
    all_push = all_push && solution.multiplier[i] > tolerance;
  }
  ContactCondition condition;
  condition.unique_count = solution.feasible && all_push && normals.rows() <= 3;
  if (normals.rows() == 0) return condition;
  const Eigen::VectorXd sizes =
      Eigen::JacobiSVD<Eigen::MatrixXd>(Eigen::MatrixXd(normals)).singularValues();
  for (Eigen::Index i = 0; i < sizes.size(); ++i) {
    if (sizes[i] > kActAsOne * sizes[0]) condition.condition = sizes[0] / sizes[i];
  }
  const double smallest = sizes[sizes.size() - 1];
  if (!(smallest * kPoorCondition > sizes[0])) condition.unique_count = false;
  return condition;
}

double ResidualOf(const Vec3& finger, std::span<const HalfSpace> planes,
                  const ContactSolution& solution) {
  double residual = 0;
  Vec3 sum = Vec3::Zero();
  Vec3 descent = Vec3::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (!Counts(planes[i])) continue;
    const double depth = Depth(planes[i], solution.proxy);
    const Vec3 normal = planes[i].normal.normalized();
    descent += std::max(depth, 0.0) * normal;
    sum += solution.multiplier[i] * normal;
    if (solution.feasible) residual = std::max(residual, depth);
    if (solution.multiplier[i] > 0) residual = std::max(residual, -depth);
  }
  if (!solution.feasible) residual = std::max(residual, descent.norm());
  return std::max({residual, (sum - solution.displacement).norm(),
                   (finger + solution.displacement - solution.proxy).norm()});
}

namespace {

enum Result : std::size_t { kFeasible, kDx, kDy, kDz, kDistance, kActive, kResidual, kCondition };

// The column's header tells its own format.
std::string PlanesColumn(const Table& table) {
  const auto& columns = table.columns();
  const auto found = std::find_if(columns.begin(), columns.end(), [](const std::string& column) {
    return column == "planes" || column.starts_with("planes ");
  });
  return found == columns.end() ? "planes" : *found;
}

struct Task {
  Vec3 finger;
  std::vector<HalfSpace> planes;
};

Task ParseTask(const Row& row) {
  Task task;
  const char* const axes[] = {"Cx", "Cy", "Cz"};
  for (int i = 0; i < 3; ++i) task.finger[i] = row.Number(axes[i], -kLargestPlace, kLargestPlace);
  const std::string column = PlanesColumn(row.table());
  try {
    task.planes = ParsePlanes(row.Find(column).value_or(""));
  } catch (const std::logic_error& error) {  // std::stod throws two kinds
    row.Refuse(column, error.what());
  }
  if (row.Find("n_planes") &&
      row.Integer("n_planes", 0, 1'000'000) != static_cast<int>(task.planes.size())) {
    row.Refuse("n_planes", "there are " + std::to_string(task.planes.size()) + " planes");
  }
  return task;
}

Outcome RunRow(const Row& row, std::uint64_t /*seed*/) {
  const Task task = ParseTask(row);
  // The solver takes no more: the haptic tick displays no more.
  if (task.planes.size() > haptic::kMaxContactPlanes) return {RowStatus::kUnsupported, {}};
  const ContactSolution solution = haptic::SolveContact(task.finger, 0, task.planes);
  const auto pushing = std::count_if(solution.multiplier.begin(), solution.multiplier.end(),
                                     [](double multiplier) { return multiplier > 0; });
  return {RowStatus::kOk,
          {solution.feasible ? 1.0 : 0.0, solution.proxy.x(), solution.proxy.y(),
           solution.proxy.z(), solution.displacement.norm(), static_cast<double>(pushing),
           ResidualOf(task.finger, task.planes, solution),
           ConditionOf(task.finger, task.planes, solution).condition}};
}

double DistanceTolerance(const Outcome& outcome) {
  const Vec3 proxy(outcome.values[kDx], outcome.values[kDy], outcome.values[kDz]);
  const bool poor = outcome.values[kCondition] > kPoorCondition;
  return (poor ? kPoorTolerance : kTolerance) * (1 + proxy.norm());
}

bool Agrees(const Row& row, const Outcome& outcome, std::size_t index) {
  constexpr const char* kAxes[] = {"Dx", "Dy", "Dz"};
  const double got = outcome.values[index];
  switch (index) {
    case kFeasible:
      return ExpectedNumber(row, "feasible") == got;
    case kDx:
    case kDy:
    case kDz: {  // as a vector, of which the axes that the row gives are known
      Vec3 error = Vec3::Zero();
      double rounding = 0;
      for (int i = 0; i < 3; ++i) {
        if (!row.Find(kAxes[i])) continue;
        error[i] =
            outcome.values[kDx + static_cast<std::size_t>(i)] - ExpectedNumber(row, kAxes[i]);
        rounding += RoundingOf(row.Text(kAxes[i]));
      }
      return error.norm() <= DistanceTolerance(outcome) + rounding;
    }
    case kDistance:
      return std::abs(got - ExpectedNumber(row, "dist")) <=
             DistanceTolerance(outcome) + RoundingOf(row.Text("dist"));
    case kActive: {
      const Task task = ParseTask(row);
      const ContactSolution solution = haptic::SolveContact(task.finger, 0, task.planes);
      return ExpectedNumber(row, "n_active") == got ||
             !ConditionOf(task.finger, task.planes, solution).unique_count;
    }
    default:  // what the laboratory says beside: nothing to compare with
      return true;
  }
}

std::string PlanesText(const std::vector<HalfSpace>& planes) {
  std::string text;
  for (const HalfSpace& plane : planes) {
    if (!text.empty()) text += ";";
    for (int i = 0; i < 3; ++i) text += ToField(plane.point[i]) + " ";
    for (int i = 0; i < 3; ++i) text += ToField(plane.normal[i]) + (i < 2 ? " " : "");
  }
  return text;
}

// Fingers and planes within centimetres of the origin, as a scene has them, by kind.
class TaskMaker {
 public:
  Task Random(int count) {
    Task task{Point(), {}};
    for (int i = 0; i < count; ++i) task.planes.push_back({Point(), Direction()});
    return task;
  }

  // Mostly from one side, like the shapes round a finger: mostly feasible.
  Task Convex(int count) {
    Task task{Point() - 0.02 * Vec3::UnitY(), {}};
    for (int i = 0; i < count; ++i) {
      task.planes.push_back({Point(), (Direction() + 1.2 * Vec3::UnitY()).normalized()});
    }
    return task;
  }

  Task Duplicates() {
    Task task = Convex(3);
    for (int i = 0; i < 3; ++i) task.planes.push_back(task.planes[static_cast<std::size_t>(i)]);
    return task;
  }

  // Two planes through one point, the second turned by `angle` from the first (or from its
  // opposite), and both violated.
  Task Wedge(double angle, bool opposed) {
    const Vec3 normal = Direction();
    const Vec3 across = normal.unitOrthogonal();
    const Vec3 point = Point();
    const Vec3 other =
        (opposed ? -std::cos(angle) : std::cos(angle)) * normal + std::sin(angle) * across;
    Task task{point - 0.002 * normal - 0.001 * across, {{point, normal}, {point, other}}};
    if (opposed) task.planes[1].point += 0.0005 * other;
    return task;
  }

  Task NotANumber() {
    Task task = Convex(2);
    task.planes.push_back({Vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0), Direction()});
    task.planes.push_back({Point(), Vec3::Zero()});
    return task;
  }

 private:
  Vec3 Direction() { return Gauss().normalized(); }
  Vec3 Point() { return 0.01 * Gauss(); }
  Vec3 Gauss() { return {gauss_(random_), gauss_(random_), gauss_(random_)}; }

  std::mt19937_64 random_{20240901};
  std::normal_distribution<double> gauss_;
};

Table Grid(bool quick) {
  Table table("the grid of planes",
              {"id", "category", "Cx", "Cy", "Cz", "n_planes", "planes px py pz nx ny nz;..."});
  TaskMaker make;
  const int repeats = quick ? 20 : 500;
  const auto add = [&](const std::string& category, const auto& task_of) {
    for (int i = 0; i < repeats; ++i) {
      const Task task = task_of();
      table.Append({std::to_string(table.size()), category, ToField(task.finger.x()),
                    ToField(task.finger.y()), ToField(task.finger.z()),
                    std::to_string(task.planes.size()), PlanesText(task.planes)});
    }
  };
  for (const int count : {1, 2, 3, 8, 32}) {
    add("random_" + std::to_string(count), [&] { return make.Random(count); });
    add("one_side_" + std::to_string(count), [&] { return make.Convex(count); });
  }
  add("duplicates", [&] { return make.Duplicates(); });
  for (const double angle : {0.1, 1e-3, 1e-6, 1e-9, 1e-12}) {
    add("nearly_parallel_" + ToField(angle), [&] { return make.Wedge(angle, false); });
  }
  for (const double angle : {0.1, 1e-3, 1.7453292519943e-4}) {
    add("thin_wedge_" + ToField(angle), [&] { return make.Wedge(angle, true); });
  }
  add("nan_and_zero", [&] { return make.NotANumber(); });
  return table;
}

struct Group {
  std::string category;
  int rows = 0;
  int infeasible = 0;
  double pushing = 0;
  double farthest = 0;
  double worst_condition = 1;
  double worst_residual = 0;
};

// By category: whether there was room, how far the proxy lies away, and how exact it is.
void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  std::vector<Group> groups;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& values = outcomes[i].values;
    if (values.empty()) continue;
    const std::string category = rows.row(i).Find("category").value_or("all");
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const Group& known) { return known.category == category; });
    if (group == groups.end()) {
      groups.push_back({.category = category});
      group = groups.end() - 1;
    }
    ++group->rows;
    group->infeasible += values[kFeasible] == 0 ? 1 : 0;
    group->pushing += values[kActive];
    group->farthest = std::max(group->farthest, values[kDistance]);
    group->worst_condition = std::max(group->worst_condition, values[kCondition]);
    group->worst_residual = std::max(group->worst_residual, values[kResidual]);
  }
  if (groups.empty()) return;
  out << "Contact solve by category: planes that push, largest |D - C|, worst condition of the "
         "normals that touch,\nworst distance from the conditions of an exact solution\n"
      << std::left << std::setw(30) << "category" << std::right << std::setw(6) << "rows"
      << std::setw(12) << "infeasible" << std::setw(9) << "pushing" << std::setw(13)
      << "|D - C| [m]" << std::setw(11) << "condition" << std::setw(14) << "residual [m]"
      << "\n";
  for (const Group& group : groups) {
    out << std::left << std::setw(30) << group.category << std::right << std::setw(6) << group.rows
        << std::setw(12) << group.infeasible << std::setw(9) << std::fixed << std::setprecision(2)
        << group.pushing / group.rows << std::scientific << std::setprecision(2) << std::setw(13)
        << group.farthest << std::setw(11) << std::setprecision(1) << group.worst_condition
        << std::setw(14) << group.worst_residual << "\n";
  }
  out << std::defaultfloat;
}

}  // namespace

Case Planes() {
  Case study;
  study.name = "planes";
  study.purpose = "the nearest point outside a set of planes (nothing random but the grid)";
  study.results = {{"feasible"}, {"Dx"},       {"Dy"},         {"Dz"},
                   {"dist"},     {"n_active"}, {"residual_m"}, {"condition"}};
  study.grid = Grid;
  study.run = RunRow;
  study.agrees = Agrees;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
