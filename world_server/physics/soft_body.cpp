// SPDX-License-Identifier: MIT
#include "world_server/physics/soft_body.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace rikiseki::world {
namespace {

constexpr double kTolerance = 1e-8;  // of the right side, in the norm of the preconditioner
constexpr int kMostIterations = 300;
constexpr int kMostSettlingSteps = 300;
constexpr double kSettled = 1e-13;      // of the size, the last settling step
constexpr double kDeepestSag = 0.5;     // of the size
constexpr double kRestingSpeed = 1e-5;  // m/s: nobody feels, nor sees, what is slower
constexpr double kRestingWay = 1e-6;    // m

// The rotation in F, from the one before: the fixed point of a turn that brings the axes of R onto the
// columns of F (Mueller, Bender, Chentanez, Macklin 2016). Follows an inverted element too.
Mat3 RotationIn(const Mat3& f, const Mat3& before) {
  Mat3 r = before;
  for (int i = 0; i < 60; ++i) {
    const Vec3 turn =
        r.col(0).cross(f.col(0)) + r.col(1).cross(f.col(1)) + r.col(2).cross(f.col(2));
    const double along = std::abs(r.cwiseProduct(f).sum());
    const Vec3 way = turn / (along + 1e-9);
    const double angle = way.norm();
    if (!(angle > 1e-8)) break;
    r = Eigen::AngleAxisd(angle, way / angle) * r;
  }
  return Quat(r).normalized().toRotationMatrix();
}

}  // namespace

SoftBody::SoftBody(TetrahedralMesh mesh, const SoftMaterial& material, double mass_kg,
                   std::vector<std::uint8_t> held, const Vec3& gravity)
    : mesh_(std::move(mesh)),
      relaxation_s_(material.relaxation_s),
      gravity_(gravity),
      held_(std::move(held)) {
  const double e = material.youngs_modulus_pa, nu = material.poisson_ratio;
  const bool sound = e > 0 && std::isfinite(e) && nu >= 0 && nu < 0.5 && relaxation_s_ >= 0 &&
                     std::isfinite(relaxation_s_) && mass_kg > 0 && std::isfinite(mass_kg);
  if (!sound || held_.size() != mesh_.nodes.size() || !gravity.allFinite()) {
    throw std::invalid_argument(
        "a soft body needs a mass, a modulus and a Poisson ratio below 0.5");
  }
  mu_ = e / (2 * (1 + nu));
  lambda_ = e * nu / ((1 + nu) * (1 - 2 * nu));
  MakeElements(mass_kg);
  if (free_count_ == 0) throw std::invalid_argument("a soft body needs a place that nothing holds");
  const bool something_holds =
      std::any_of(held_.begin(), held_.end(), [](std::uint8_t flag) { return flag != 0; });
  unloaded_ = positions_;
  stiffness_ = Stiffness();
  if (!something_holds) return;
  statics_ = std::make_unique<Factors>(stiffness_);
  // Held at a point or along a line it could still turn: a pivot is then nothing but rounding.
  const Eigen::VectorXd pivots = statics_->vectorD();
  if (statics_->info() != Eigen::Success || !(pivots.minCoeff() > 1e-12 * pivots.maxCoeff())) {
    throw std::invalid_argument("a soft body must be held at three points that lie on no line");
  }
  Settle();
}

void SoftBody::MakeElements(double mass_kg) {
  const auto count = static_cast<Eigen::Index>(mesh_.nodes.size());
  positions_.resize(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    positions_.col(i) = mesh_.nodes[static_cast<std::size_t>(i)];
  }
  velocities_ = NodeVectors::Zero(3, count);
  size_ = (positions_.rowwise().maxCoeff() - positions_.rowwise().minCoeff()).norm();
  place_.assign(mesh_.nodes.size(), -1);
  for (std::size_t i = 0; i < place_.size(); ++i) {
    if (held_[i] == 0) place_[i] = free_count_++;
  }
  const double density = mass_kg / mesh_.Volume();
  masses_ = Eigen::VectorXd::Zero(count);
  for (const Tetrahedron& nodes : mesh_.tetrahedra) {
    const Vec3 origin = mesh_.nodes[nodes[0]];
    Mat3 edges;
    for (int i = 0; i < 3; ++i) {
      edges.col(i) = mesh_.nodes[nodes[static_cast<std::size_t>(i) + 1]] - origin;
    }
    Element element{.nodes = nodes, .gradients = {}, .volume = edges.determinant() / 6};
    if (!(element.volume > 0) || !std::isfinite(density)) {
      throw std::invalid_argument("a soft body has an element without a volume");
    }
    element.gradients.rightCols<3>() = edges.inverse().transpose();
    element.gradients.col(0) = -element.gradients.rightCols<3>().rowwise().sum();
    for (const std::uint32_t node : nodes) masses_[node] += density * element.volume / 4;
    elements_.push_back(element);
  }
}

Mat3 SoftBody::Gradient(const Element& element, const NodeVectors& vectors) const {
  Mat3 gradient = Mat3::Zero();
  for (int i = 0; i < 4; ++i) {
    gradient += vectors.col(element.nodes[static_cast<std::size_t>(i)]) *
                element.gradients.col(i).transpose();
  }
  return gradient;
}

Mat3 SoftBody::Strain(const Element& element) const {
  const Mat3 stretch = element.rotation.transpose() * Gradient(element, positions_);
  return 0.5 * (stretch + stretch.transpose()) - Mat3::Identity();
}

Mat3 SoftBody::Stress(const Mat3& strain) const {
  return 2 * mu_ * strain + lambda_ * strain.trace() * Mat3::Identity();
}

void SoftBody::FindRotations() {
  for (Element& element : elements_) {
    element.rotation = RotationIn(Gradient(element, positions_), element.rotation);
  }
}

// Adds scale times the forces on the nodes that balance a stress, in the element's turned frame.
void SoftBody::AddForcesOf(const Element& element, double scale, const Mat3& stress,
                           NodeVectors& sum) {
  const Eigen::Matrix<double, 3, 4> forces =
      (scale * element.volume) * (element.rotation * stress) * element.gradients;
  for (int i = 0; i < 4; ++i) {
    sum.col(element.nodes[static_cast<std::size_t>(i)]) += forces.col(i);
  }
}

// Adds scale times the elastic forces on the nodes.
void SoftBody::AddForces(double scale, NodeVectors& sum) const {
  for (const Element& element : elements_) {
    AddForcesOf(element, -scale, Stress(Strain(element)), sum);
  }
}

// Adds scale times the forces that resist the displacements `way`.
void SoftBody::AddStiffness(double scale, const NodeVectors& way, NodeVectors& sum) const {
  for (const Element& element : elements_) {
    const Mat3 local = element.rotation.transpose() * Gradient(element, way);
    AddForcesOf(element, scale, Stress(0.5 * (local + local.transpose())), sum);
  }
}

// Of the free nodes, with the elements turned as they are.
Eigen::SparseMatrix<double> SoftBody::Stiffness() const {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(elements_.size() * 144);
  for (const Element& element : elements_) {
    const Mat3& r = element.rotation;
    for (int i = 0; i < 4; ++i) {
      const int row = place_[element.nodes[static_cast<std::size_t>(i)]];
      if (row < 0) continue;
      const Vec3 a = element.gradients.col(i);
      for (int j = 0; j < 4; ++j) {
        const int column = place_[element.nodes[static_cast<std::size_t>(j)]];
        if (column < 0) continue;
        const Vec3 b = element.gradients.col(j);
        const Mat3 block = element.volume * r *
                           (mu_ * (a.dot(b) * Mat3::Identity() + b * a.transpose()) +
                            lambda_ * a * b.transpose()) *
                           r.transpose();
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 3; ++l) {
            entries.emplace_back(3 * row + k, 3 * column + l, block(k, l));
          }
        }
      }
    }
  }
  Eigen::SparseMatrix<double> matrix(3 * free_count_, 3 * free_count_);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// Where its weight lets it come to rest; the factors are then of that shape.
void SoftBody::Settle() {
  const NodeVectors weight = gravity_ * masses_.transpose();
  const NodeVectors shape = positions_;
  if (!gravity_.isZero(0)) {
    double step = size_;
    for (int i = 0; i < kMostSettlingSteps && step > kSettled * size_; ++i) {
      NodeVectors forces = weight;
      AddForces(1, forces);
      const NodeVectors way = Solved(*statics_, forces);
      positions_ += way;
      step = way.cwiseAbs().maxCoeff();
      if (!((positions_ - shape).cwiseAbs().maxCoeff() < kDeepestSag * size_)) break;
      FindRotations();
    }
    if (!(step <= 1e-9 * size_)) {
      throw std::invalid_argument("a soft body collapses under its own weight");
    }
  }
  unloaded_ = positions_;
  stiffness_ = Stiffness();
  statics_->factorize(stiffness_);
}

SoftBody::NodeVectors SoftBody::Solved(const Factors& factors, const NodeVectors& right) const {
  Eigen::VectorXd packed(3 * free_count_);
  for (std::size_t i = 0; i < place_.size(); ++i) {
    if (place_[i] >= 0) packed.segment<3>(3 * place_[i]) = right.col(static_cast<Eigen::Index>(i));
  }
  packed = factors.solve(packed);
  NodeVectors solved = NodeVectors::Zero(3, right.cols());
  for (std::size_t i = 0; i < place_.size(); ++i) {
    if (place_[i] >= 0) solved.col(static_cast<Eigen::Index>(i)) = packed.segment<3>(3 * place_[i]);
  }
  return solved;
}

void SoftBody::ClearHeld(NodeVectors& vectors) const {
  for (std::size_t i = 0; i < held_.size(); ++i) {
    if (held_[i] != 0) vectors.col(static_cast<Eigen::Index>(i)).setZero();
  }
}

void SoftBody::Push(const NodeVectors& impulses) {
  if (!impulses.allFinite()) return;
  velocities_ += impulses * masses_.cwiseInverse().asDiagonal();
  ClearHeld(velocities_);
}

void SoftBody::Factorise(double step_s) {
  if (step_s == step_s_) return;
  Eigen::SparseMatrix<double> matrix = step_s * (step_s + relaxation_s_) * stiffness_;
  for (std::size_t i = 0; i < place_.size(); ++i) {
    if (place_[i] < 0) continue;
    for (int k = 0; k < 3; ++k) {
      matrix.coeffRef(3 * place_[i] + k, 3 * place_[i] + k) +=
          masses_[static_cast<Eigen::Index>(i)];
    }
  }
  dynamics_.compute(matrix);
  step_s_ = step_s;
}

void SoftBody::Step(double step_s) {
  Factorise(step_s);
  FindRotations();
  const double implicit = step_s * (step_s + relaxation_s_);
  const auto apply = [&](const NodeVectors& v) {
    NodeVectors sum = v * masses_.asDiagonal();
    AddStiffness(implicit, v, sum);
    ClearHeld(sum);
    return sum;
  };
  NodeVectors right = velocities_ * masses_.asDiagonal();
  right += step_s * gravity_ * masses_.transpose();
  AddForces(step_s, right);
  ClearHeld(right);

  NodeVectors v = Solved(dynamics_, right);
  NodeVectors residual = right - apply(v);
  const double enough = kTolerance * kTolerance * std::abs(right.cwiseProduct(v).sum());
  NodeVectors better = Solved(dynamics_, residual);
  NodeVectors way = better;
  double square = residual.cwiseProduct(better).sum();
  for (int i = 0; i < kMostIterations && square > enough; ++i) {
    const NodeVectors pushed = apply(way);
    const double length = square / way.cwiseProduct(pushed).sum();
    v += length * way;
    residual -= length * pushed;
    better = Solved(dynamics_, residual);
    const double next = residual.cwiseProduct(better).sum();
    way = better + next / square * way;
    square = next;
  }
  velocities_ = v;
  positions_ += step_s * velocities_;
  if (positions_.allFinite() && velocities_.allFinite()) return;
  positions_ = unloaded_;
  velocities_.setZero();
}

SoftBody::NodeVectors SoftBody::Displacements(const NodeVectors& forces) const {
  if (!is_held()) throw std::logic_error("a body that nothing holds gives way without an end");
  return Solved(*statics_, forces);
}

double SoftBody::ElasticEnergy() const {
  double energy = 0;
  for (Element element : elements_) {
    element.rotation = RotationIn(Gradient(element, positions_), element.rotation);
    const Mat3 strain = Strain(element);
    energy += 0.5 * element.volume * strain.cwiseProduct(Stress(strain)).sum();
  }
  return energy;
}

bool SoftBody::AtRest() const {
  return velocities_.cwiseAbs().maxCoeff() < kRestingSpeed &&
         (positions_ - unloaded_).cwiseAbs().maxCoeff() < kRestingWay;
}

}  // namespace rikiseki::world
