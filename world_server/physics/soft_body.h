// SPDX-License-Identifier: MIT
// A solid that deforms: linear-elastic tetrahedra, each in a frame that turns with it (corotational),
// stepped implicitly, so that any stiffness is stable at any step.
//
// Method: strain of an element = sym(R^T F) - I, where F is its deformation gradient and R the rotation
// in it (polar decomposition); stress = 2 mu strain + lambda tr(strain) I, damping alike in the strain's
// rate. One step solves (M + (h^2 + h relaxation) K) v' = M v + h (f + weight), backward Euler with the
// rotations at its start, by conjugate gradients preconditioned with the factors of the same matrix of
// the unloaded body. Forces of an element add up to nothing and have no moment, so nothing pushes the
// body but what pushes it from outside; of the spin of a free body a step takes a part that goes with its
// length and the strain, and such a body wants steps short against the turn it makes. A held one, as
// worlds have, bears any, and its energy never grows. Mass is lumped at the nodes. Same calls, same bits.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/tetrahedra.h"

namespace rikiseki::world {

struct SoftMaterial {
  double youngs_modulus_pa = 1e4;
  double poisson_ratio = 0.3;  // 0 to below 0.5
  double relaxation_s = 0;     // damping: stress = C (strain + relaxation strain rate)
};

class SoftBody {
 public:
  using NodeVectors = Eigen::Matrix3Xd;  // a column for each node

  /// At rest, the mass spread evenly over the volume. Nodes whose `held` is not 0 never move. A body
  /// that is held against turning as well starts where `gravity` [m/s^2, in the mesh's frame] lets it
  /// settle; one that nothing holds, in the shape of the mesh. Throws std::invalid_argument on a mass
  /// or material that is none, an element without a volume, or a body too soft to bear its weight.
  SoftBody(TetrahedralMesh mesh, const SoftMaterial& material, double mass_kg,
           std::vector<std::uint8_t> held, const Vec3& gravity);

  /// v += impulse/m of every node, N s; held ones take theirs away. Not finite ones are ignored.
  void Push(const NodeVectors& impulses);

  /// Advances by `step_s` > 0; steps as long as the one before need no new factors. Should numbers
  /// overflow, the body is back in its unloaded shape.
  void Step(double step_s);

  /// The static displacement of every node per force, m, for small forces [N] on the unloaded body.
  /// Only of one that is held against turning as well: throws std::logic_error.
  NodeVectors Displacements(const NodeVectors& forces) const;

  const TetrahedralMesh& mesh() const { return mesh_; }
  const NodeVectors& positions() const { return positions_; }    // m
  const NodeVectors& velocities() const { return velocities_; }  // m/s
  const NodeVectors& unloaded() const { return unloaded_; }      // m, where it settles unpushed
  const Eigen::VectorXd& masses() const { return masses_; }      // kg
  double relaxation_s() const { return relaxation_s_; }
  bool is_held() const { return statics_ != nullptr; }
  bool is_held(std::size_t node) const { return held_[node] != 0; }

  /// J, in the elements, as they are now.
  double ElasticEnergy() const;

  /// Whether it neither moves nor is deformed, as far as anybody could tell.
  bool AtRest() const;

 private:
  struct Element {
    Tetrahedron nodes{};
    Eigen::Matrix<double, 3, 4> gradients;  // 1/m, of the nodes' shape functions
    double volume = 0;                      // m^3
    Mat3 rotation = Mat3::Identity();
  };
  using Factors = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;

  void MakeElements(double mass_kg);
  void FindRotations();
  Mat3 Gradient(const Element& element, const NodeVectors& vectors) const;
  Mat3 Strain(const Element& element) const;
  Mat3 Stress(const Mat3& strain) const;
  static void AddForcesOf(const Element& element, double scale, const Mat3& stress,
                          NodeVectors& sum);
  void AddForces(double scale, NodeVectors& sum) const;
  void AddStiffness(double scale, const NodeVectors& way, NodeVectors& sum) const;
  Eigen::SparseMatrix<double> Stiffness() const;
  void Settle();
  void Factorise(double step_s);
  NodeVectors Solved(const Factors& factors, const NodeVectors& right) const;
  void ClearHeld(NodeVectors& vectors) const;

  TetrahedralMesh mesh_;
  double mu_ = 0, lambda_ = 0;  // Pa
  double relaxation_s_ = 0;
  double size_ = 0;  // m, across
  Vec3 gravity_ = Vec3::Zero();
  std::vector<std::uint8_t> held_;
  std::vector<int> place_;  // of a node among the free ones; -1 = held
  int free_count_ = 0;
  std::vector<Element> elements_;
  Eigen::VectorXd masses_;
  NodeVectors positions_, velocities_, unloaded_;
  std::unique_ptr<Factors> statics_;  // of the unloaded body, if it is held
  Eigen::SparseMatrix<double> stiffness_;
  Factors dynamics_;
  double step_s_ = 0;  // that it is for
};

}  // namespace rikiseki::world
