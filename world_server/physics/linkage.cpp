// SPDX-License-Identifier: MIT
#include "world_server/physics/linkage.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace rikiseki::world {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Added to each row's own mobility, relative: what makes rows that say the same twice solvable. The
// refinement takes its error out again.
constexpr double kRegularization = 1e-10;
constexpr int kRefinements = 2;
constexpr double kExact = 1e-13;   // m or rad: joints are no farther apart
constexpr double kPassed = 1e-12;  // m or rad: a limit is passed
constexpr double kAtLimit = 1e-9;  // m or rad: a limit is reached
constexpr int kLargestNewtonSteps = 40;
constexpr int kFrictionSweeps = 50;  // over the joints of a linkage
constexpr int kHalvings = 12;        // of a speed at which joints turn too far in a substep

Index At(std::size_t place) {
  return 6 * static_cast<Index>(place);
}

VectorXd Velocities(std::span<const BodyState> states) {
  VectorXd velocities(At(states.size()));
  for (std::size_t i = 0; i < states.size(); ++i) {
    velocities.segment<3>(At(i)) = states[i].velocity;
    velocities.segment<3>(At(i) + 3) = states[i].angular_velocity;
  }
  return velocities;
}

void SetVelocities(const VectorXd& velocities, std::span<BodyState> states) {
  for (std::size_t i = 0; i < states.size(); ++i) {
    states[i].velocity = velocities.segment<3>(At(i));
    states[i].angular_velocity = velocities.segment<3>(At(i) + 3);
  }
}

// M^-1 J^T.
MatrixXd Yields(const MatrixXd& jacobian, std::span<const BodyInertia> inertias,
                std::span<const BodyState> states) {
  MatrixXd yields(jacobian.cols(), jacobian.rows());
  for (std::size_t i = 0; i < inertias.size(); ++i) {
    yields.middleRows<3>(At(i)) = jacobian.middleCols<3>(At(i)).transpose() / inertias[i].mass_kg;
    yields.middleRows<3>(At(i) + 3) = inertias[i].InverseInertia(states[i].pose.orientation) *
                                      jacobian.middleCols<3>(At(i) + 3).transpose();
  }
  return yields;
}

// The angle nearest to `last` that looks like this one.
double Unwound(double angle, double last) {
  const double turn = 2 * std::numbers::pi;
  return angle + turn * std::round((last - angle) / turn);
}

}  // namespace

RowSystem::RowSystem(MatrixXd jacobian, std::span<const BodyInertia> inertias,
                     std::span<const BodyState> states)
    : jacobian_(std::move(jacobian)), yields_(Yields(jacobian_, inertias, states)) {
  mobility_ = jacobian_ * yields_;
  scale_ = mobility_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  MatrixXd scaled = scale_.asDiagonal() * mobility_ * scale_.asDiagonal();
  scaled.diagonal().array() += kRegularization;
  factors_.compute(scaled);
}

VectorXd RowSystem::Impulses(const VectorXd& rates) const {
  VectorXd impulses = VectorXd::Zero(rates.size());
  for (int i = 0; i <= kRefinements; ++i) {
    const VectorXd missing = rates - mobility_ * impulses;
    impulses += scale_.cwiseProduct(factors_.solve(scale_.cwiseProduct(missing)));
  }
  return impulses;
}

std::vector<Linkage> Linkage::Of(const Scene& scene) {
  std::vector<std::size_t> root(scene.bodies.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](std::size_t body) {
    while (root[body] != body) body = root[body];
    return body;
  };
  const auto moves = [&](std::size_t body) {
    return body != Joint::kWorld && !scene.bodies[body].fixed;
  };
  for (const Joint& joint : scene.joints) {
    if (moves(joint.parent) && moves(joint.child)) {
      const auto [low, high] = std::minmax({find(joint.parent), find(joint.child)});
      root[high] = low;
    }
  }
  std::vector<Linkage> linkages;
  std::vector<std::size_t> place(scene.bodies.size(), Joint::kWorld);       // within its linkage
  std::vector<std::size_t> linkage_of(scene.bodies.size(), Joint::kWorld);  // of a root
  for (const Joint& joint : scene.joints) {
    if (!moves(joint.parent) && !moves(joint.child)) continue;  // it holds what is held anyway
    for (const std::size_t body : {joint.parent, joint.child}) {
      if (!moves(body) || place[body] != Joint::kWorld) continue;
      std::size_t& own = linkage_of[find(body)];
      if (own == Joint::kWorld) {
        own = linkages.size();
        linkages.emplace_back();
      }
      Linkage& linkage = linkages[own];
      place[body] = linkage.bodies_.size();
      linkage.bodies_.push_back(body);
      linkage.inertias_.push_back(
          BodyInertia::Of(scene.bodies[body].mass_kg, scene.bodies[body].inertia));
    }
    const std::size_t mover = moves(joint.child) ? joint.child : joint.parent;
    Link link{.joint = joint};
    // A fixed body's frame becomes the world's.
    const auto attach = [&](std::size_t body, Pose& frame) {
      if (moves(body)) return place[body];
      if (body != Joint::kWorld) frame = scene.bodies[body].pose_WB * frame;
      return Joint::kWorld;
    };
    link.parent = attach(joint.parent, link.joint.pose_PJ);
    link.child = attach(joint.child, link.joint.pose_CJ);
    linkages[linkage_of[find(mover)]].links_.push_back(std::move(link));
  }
  return linkages;
}

JointFrames Linkage::FramesOf(const Link& link, std::span<const BodyState> states) const {
  JointFrames frames{.parent_WJ = link.joint.pose_PJ, .child_WJ = link.joint.pose_CJ};
  if (link.parent != Joint::kWorld) {
    frames.parent_WJ = states[link.parent].pose * link.joint.pose_PJ;
    frames.parent_centre = states[link.parent].pose.position;
  }
  if (link.child != Joint::kWorld) {
    frames.child_WJ = states[link.child].pose * link.joint.pose_CJ;
    frames.child_centre = states[link.child].pose.position;
  }
  return frames;
}

double Linkage::Position(const Link& link, std::span<const BodyState> states) const {
  const double position = FreeRow(link.joint.type, FramesOf(link, states)).position;
  return link.joint.type == Joint::Type::kRevolute ? Unwound(position, link.position) : position;
}

void Linkage::SetRow(const Link& link, const JointRow& row, Index place, MatrixXd& jacobian) const {
  if (link.child != Joint::kWorld) {
    jacobian.block<1, 3>(place, At(link.child)) += row.linear.transpose();
    jacobian.block<1, 3>(place, At(link.child) + 3) += row.angular_child.transpose();
  }
  if (link.parent != Joint::kWorld) {
    jacobian.block<1, 3>(place, At(link.parent)) -= row.linear.transpose();
    jacobian.block<1, 3>(place, At(link.parent) + 3) += row.angular_parent.transpose();
  }
}

MatrixXd Linkage::OneRow(const Link& link, const JointRow& row) const {
  MatrixXd jacobian = MatrixXd::Zero(1, At(bodies_.size()));
  SetRow(link, row, 0, jacobian);
  return jacobian;
}

// Whether the joint has a limit at which it does not stand yet.
bool Linkage::MayStop(std::size_t link, std::span<const Stop> stops) const {
  const Joint& joint = links_[link].joint;
  return (std::isfinite(joint.lower) || std::isfinite(joint.upper)) &&
         std::none_of(stops.begin(), stops.end(), [=](const Stop& s) { return s.link == link; });
}

// What the joints hold, then the stops.
RowSystem Linkage::Rows(std::span<const BodyState> states, std::span<const Stop> stops) const {
  std::vector<JointRow> rows;
  std::vector<std::size_t> owners;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    AppendHeldRows(links_[i].joint.type, FramesOf(links_[i], states), rows);
    owners.resize(rows.size(), i);
  }
  for (const Stop& stop : stops) {
    const Link& link = links_[stop.link];
    rows.push_back(FreeRow(link.joint.type, FramesOf(link, states)));
    owners.push_back(stop.link);
  }
  MatrixXd jacobian = MatrixXd::Zero(static_cast<Index>(rows.size()), At(bodies_.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    SetRow(links_[owners[i]], rows[i], static_cast<Index>(i), jacobian);
  }
  return RowSystem(std::move(jacobian), inertias_, states);
}

// How far the joints are apart in the order of Rows(), and beyond the stops.
VectorXd Linkage::Errors(std::span<const BodyState> states, std::span<const Stop> stops) const {
  std::vector<JointRow> rows;
  for (const Link& link : links_) AppendHeldRows(link.joint.type, FramesOf(link, states), rows);
  VectorXd errors(static_cast<Index>(rows.size() + stops.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) errors[static_cast<Index>(i)] = rows[i].position;
  for (std::size_t i = 0; i < stops.size(); ++i) {
    const Link& link = links_[stops[i].link];
    const double limit = stops[i].upper ? link.joint.upper : link.joint.lower;
    errors[static_cast<Index>(rows.size() + i)] = Position(link, states) - limit;
  }
  return errors;
}

// Adds the limits that are passed at these states; whether there were any.
bool Linkage::AddPassed(std::span<const BodyState> states, std::vector<Stop>& stops) const {
  const std::size_t before = stops.size();
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (!MayStop(i, stops)) continue;
    const Joint& joint = links_[i].joint;
    const double position = Position(links_[i], states);
    if (position > joint.upper + kPassed) stops.push_back({.link = i, .upper = true});
    if (position < joint.lower - kPassed) stops.push_back({.link = i, .upper = false});
  }
  return stops.size() > before;
}

void Linkage::Begin(std::span<const BodyState> start) {
  start_.assign(start.begin(), start.end());
  held_ = Rows(start, {});
  free_rows_.assign(links_.size(), {});
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (!links_[i].has_axis()) continue;
    free_rows_[i] = FreeRow(links_[i].joint.type, FramesOf(links_[i], start));
    links_[i].position = Position(links_[i], start);
  }
  if (impulses_.size() != held_.size()) impulses_ = VectorXd::Zero(held_.size());
}

std::vector<JointRow> Linkage::HeldRows(std::size_t link) const {
  std::vector<JointRow> rows;
  AppendHeldRows(links_[link].joint.type, FramesOf(links_[link], start_), rows);
  return rows;
}

double Linkage::Speed(std::size_t link) const {
  return OneRow(links_[link], free_rows_[link]).row(0).dot(Velocities(start_));
}

void Linkage::GiveLastImpulses(std::span<BodyState> states) const {
  SetVelocities(Velocities(states) + held_.yields() * impulses_, states);
}

// The impulses of damping and friction of each joint in a substep that leads from these velocities
// to those.
VectorXd Linkage::Resist(const VectorXd& before, const VectorXd& after, double step_s) const {
  struct Axis {
    Index link;
    Eigen::RowVectorXd row;
    VectorXd yield;  // of all bodies, as the joints let them
    double mobility = 0;
    double limit = 0;  // of friction, N s or N m s
    double friction = 0;
  };
  VectorXd impulses = VectorXd::Zero(static_cast<Index>(links_.size()));
  std::vector<Axis> axes;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const Joint& joint = links_[i].joint;
    if (!links_[i].has_axis() || !(joint.damping > 0 || joint.friction > 0)) continue;
    const MatrixXd row = OneRow(links_[i], free_rows_[i]);
    VectorXd yield = Yields(row, inertias_, start_);
    yield -= held_.yields() * held_.Impulses(held_.jacobian() * yield);
    const double mobility = row.row(0).dot(yield);
    if (!(mobility > 0)) continue;
    axes.push_back({.link = static_cast<Index>(i),
                    .row = row,
                    .yield = yield,
                    .mobility = mobility,
                    .limit = joint.friction * step_s});
  }
  if (axes.empty()) return impulses;
  VectorXd velocities = after - held_.yields() * held_.Impulses(held_.jacobian() * after);
  for (Axis& axis : axes) {
    const double rate = links_[static_cast<std::size_t>(axis.link)].joint.damping * axis.mobility;
    if (!(rate > 0)) continue;
    // Exact for a constant force: u1 = e u0 + (1 - e) / (rate h) du.
    const double first = axis.row.dot(before);
    const double change = axis.row.dot(velocities) - first;
    const double keeps = std::exp(-rate * step_s);
    const double last = keeps * first - std::expm1(-rate * step_s) / (rate * step_s) * change;
    const double impulse = (last - first - change) / axis.mobility;
    velocities += impulse * axis.yield;
    impulses[axis.link] += impulse;
  }
  for (int sweep = 0; sweep < (axes.size() > 1 ? kFrictionSweeps : 1); ++sweep) {
    for (Axis& axis : axes) {
      const double wanted = axis.friction - axis.row.dot(velocities) / axis.mobility;
      const double friction = std::clamp(wanted, -axis.limit, axis.limit);
      velocities += (friction - axis.friction) * axis.yield;
      axis.friction = friction;
    }
  }
  for (const Axis& axis : axes) impulses[axis.link] += axis.friction;
  return impulses;
}

// From the start with these velocities, and the impulses along the start's rows that make every
// joint exact at the end. Angular momentum stays on the way. False if none were found: a joint that
// turns by more than about a radian.
bool Linkage::Drift(const VectorXd& velocities, std::span<const Stop> stops, double step_s,
                    std::span<BodyState> states, VectorXd& impulses) const {
  const RowSystem with_stops = stops.empty() ? RowSystem() : Rows(start_, stops);
  const RowSystem& rows = stops.empty() ? held_ : with_stops;
  impulses = VectorXd::Zero(rows.size());
  double last_error = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kLargestNewtonSteps; ++i) {
    SetVelocities(velocities + rows.yields() * impulses, states);
    for (std::size_t j = 0; j < states.size(); ++j) {
      states[j].pose.position = start_[j].pose.position + step_s * states[j].velocity;
      states[j].pose.orientation = start_[j].pose.orientation;
      AdvanceRotation(inertias_[j], step_s, states[j]);
    }
    const VectorXd errors = Errors(states, stops);
    const double error = errors.cwiseAbs().maxCoeff();
    if (error <= kExact) return true;
    if (!(error < 0.9 * last_error)) return error < kAtLimit;  // as exact as numbers are
    last_error = error;
    impulses -= rows.Impulses(errors / step_s);
  }
  return false;
}

// Takes out what goes along the joints or beyond a limit that is reached; the impulses along `held`.
VectorXd Linkage::Project(const RowSystem& held, std::span<BodyState> states) const {
  const VectorXd given = Velocities(states);
  VectorXd impulses = held.Impulses(-(held.jacobian() * given));
  VectorXd velocities = given + held.yields() * impulses;
  std::vector<Stop> stops;
  const auto add_pushed = [&] {
    const std::size_t before = stops.size();
    for (std::size_t i = 0; i < links_.size(); ++i) {
      if (!MayStop(i, stops)) continue;
      const Joint& joint = links_[i].joint;
      const double position = Position(links_[i], states);
      const bool at_upper = position >= joint.upper - kAtLimit;
      const bool at_lower = position <= joint.lower + kAtLimit;
      if (!at_upper && !at_lower) continue;
      const JointRow free = FreeRow(joint.type, FramesOf(links_[i], states));
      const double rate = OneRow(links_[i], free).row(0).dot(velocities);
      if (at_upper && rate > 0) {
        stops.push_back({.link = i, .upper = true});
      } else if (at_lower && rate < 0) {
        stops.push_back({.link = i, .upper = false});
      }
    }
    return stops.size() > before;
  };
  while (add_pushed()) {
    const RowSystem rows = Rows(states, stops);
    const VectorXd all = rows.Impulses(-(rows.jacobian() * given));
    velocities = given + rows.yields() * all;
    impulses = all.head(held.size());
  }
  SetVelocities(velocities, states);
  return impulses;
}

void Linkage::ProjectVelocities(std::span<BodyState> states) const {
  Project(Rows(states, {}), states);
}

double Linkage::InverseEffectiveMass(std::span<const BodyState> states, std::size_t place,
                                     const Vec3& point_W, const Vec3& normal) const {
  std::vector<BodyState> pushed(states.begin(), states.end());
  for (BodyState& state : pushed) state.velocity = state.angular_velocity = Vec3::Zero();
  const Vec3 arm = point_W - states[place].pose.position;
  ApplyImpulse(inertias_[place], -normal, -arm.cross(normal), pushed[place]);
  Project(Rows(states, {}), pushed);
  return std::max(0.0, -normal.dot(pushed[place].VelocityAt(point_W)));
}

void Linkage::End(bool touches, double step_s, std::span<BodyState> states) {
  const double share = touches ? 1 : 0.5;  // of what else acts, at the start
  const VectorXd before = Velocities(start_);
  const VectorXd change = Velocities(states) - before;
  const VectorXd resistance = Resist(before, before + change, step_s);
  const auto along_axes = [&](std::span<const JointRow> rows, std::span<const BodyState> at) {
    MatrixXd row = MatrixXd::Zero(1, At(bodies_.size()));
    for (std::size_t i = 0; i < links_.size(); ++i) {
      row += resistance[static_cast<Index>(i)] * OneRow(links_[i], rows[i]);
    }
    return VectorXd(Yields(row, inertias_, at));
  };
  const bool resists = !resistance.isZero(0);
  VectorXd velocities = before + share * change;
  if (resists) velocities += share * along_axes(free_rows_, start_);

  std::vector<Stop> stops;
  VectorXd impulses;
  int halvings = 0;
  while (true) {
    if (!Drift(velocities, stops, step_s, states, impulses)) {
      if (++halvings <= kHalvings) {
        velocities /= 2;
        continue;
      }
      velocities.setZero();
      for (std::size_t i = 0; i < states.size(); ++i) states[i] = {.pose = start_[i].pose};
      impulses = VectorXd::Zero(held_.size());
      break;
    }
    if (!AddPassed(states, stops)) break;
  }
  if (share < 1 && halvings == 0) {
    VectorXd rest = (1 - share) * change;
    if (resists) {
      std::vector<JointRow> rows(links_.size());
      for (std::size_t i = 0; i < links_.size(); ++i) {
        if (links_[i].has_axis()) {
          rows[i] = FreeRow(links_[i].joint.type, FramesOf(links_[i], states));
        }
      }
      rest += (1 - share) * along_axes(rows, states);
    }
    SetVelocities(Velocities(states) + rest, states);
  }
  const VectorXd last = Project(Rows(states, {}), states);
  impulses_ = impulses.head(last.size()) + last;
}

double Linkage::Apart(std::span<const BodyState> states) const {
  return Errors(states, {}).cwiseAbs().maxCoeff();
}

void Linkage::ProjectPositions(std::span<BodyState> states) const {
  std::vector<Stop> stops;
  do {
    const RowSystem rows = Rows(states, stops);
    for (int i = 0; i < kLargestNewtonSteps; ++i) {
      const VectorXd errors = Errors(states, stops);
      if (errors.cwiseAbs().maxCoeff() <= kExact) break;
      const VectorXd moves = rows.yields() * rows.Impulses(-errors);
      for (std::size_t j = 0; j < states.size(); ++j) {
        Pose& pose = states[j].pose;
        pose.position += moves.segment<3>(At(j));
        pose.orientation = Turned(pose.orientation, moves.segment<3>(At(j) + 3));
      }
    }
  } while (AddPassed(states, stops));
}

}  // namespace rikiseki::world
