// SPDX-License-Identifier: MIT
// Bodies held together by joints, moved as one: a direct solver of the joints' directions, so that
// no chain is too long, no mass ratio too large and no pin drifts.
//
// A substep is RATTLE: the joints' impulses of its first half act at its start, in the directions of
// the start, as large as it takes for every joint to be exact at its end; then bodies fly freely, each
// with its own angular momentum; then the impulses of the second half, in the directions of the end,
// take out what velocity is left along them. That is second order and keeps energy over long times.
// What else acts on the bodies (gravity, drag, friction of the joints) acts half at the start and
// half at the end. While something touches one of the bodies, all of it acts at the start: there the
// new velocity is what keeps bodies apart (common/rigid_body.h says so of single ones), and half of
// what friction undoes would be left as creep.
#pragma once

#include <Eigen/Cholesky>
#include <cstddef>
#include <span>
#include <vector>

#include "common/rigid_body.h"
#include "world_server/physics/joint_rows.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// Rows of several joints over several bodies, and the impulses along them that change their rates.
/// Rows may say the same twice, as two hinges of one door do.
class RowSystem {
 public:
  RowSystem() = default;
  /// Six columns for each body: v, then w, in W.
  RowSystem(Eigen::MatrixXd jacobian, std::span<const BodyInertia> inertias,
            std::span<const BodyState> states);

  Eigen::Index size() const { return jacobian_.rows(); }
  const Eigen::MatrixXd& jacobian() const { return jacobian_; }
  /// The bodies' velocities for each unit of impulse along a row.
  const Eigen::MatrixXd& yields() const { return yields_; }
  Eigen::VectorXd Impulses(const Eigen::VectorXd& rates) const;

 private:
  Eigen::MatrixXd jacobian_, yields_, mobility_;
  Eigen::VectorXd scale_;
  Eigen::LLT<Eigen::MatrixXd> factors_;
};

class Linkage {
 public:
  /// A joint between two of these bodies, or one of them and what does not move.
  struct Link {
    Joint joint;
    std::size_t parent = Joint::kWorld;  // place in bodies()
    std::size_t child = Joint::kWorld;
    double position = 0;  // m or rad; angles go on beyond pi

    bool has_axis() const { return joint.type != Joint::Type::kBall; }
  };

  /// All of a scene: moving bodies that joints connect belong to one.
  static std::vector<Linkage> Of(const Scene& scene);

  const std::vector<std::size_t>& bodies() const { return bodies_; }  // of the scene
  const std::vector<BodyInertia>& inertias() const { return inertias_; }
  const std::vector<Link>& links() const { return links_; }

  // States go with bodies().

  /// Takes out of the velocities what the joints do not let happen, by impulses along them: what is
  /// left after a kick. Stops at limits included.
  void ProjectVelocities(std::span<BodyState> states) const;

  /// 1/kg, at a point of one of the bodies for an impulse against `normal`: what the joints leave of
  /// its mobility.
  double InverseEffectiveMass(std::span<const BodyState> states, std::size_t place,
                              const Vec3& point_W, const Vec3& normal) const;

  /// Remembers the start of a substep, and what the joints' directions are there.
  void Begin(std::span<const BodyState> start);
  /// Of one of links(), at the start.
  std::vector<JointRow> HeldRows(std::size_t link) const;
  const JointRow& FreeRowOf(std::size_t link) const { return free_rows_[link]; }
  double Speed(std::size_t link) const;
  /// Changes of velocity by what the joints gave in the last substep, in the directions of now.
  void GiveLastImpulses(std::span<BodyState> states) const;

  /// Ends the substep. In: velocities as all but the joints left them. Out: states at its end.
  void End(bool touches, double step_s, std::span<BodyState> states);

  /// m or rad, how far any joint is from what it holds.
  double Apart(std::span<const BodyState> states) const;

  /// Puts right what moved bodies otherwise, without giving velocity.
  void ProjectPositions(std::span<BodyState> states) const;

 private:
  struct Stop {
    std::size_t link = 0;
    bool upper = false;
  };

  JointFrames FramesOf(const Link& link, std::span<const BodyState> states) const;
  double Position(const Link& link, std::span<const BodyState> states) const;
  void SetRow(const Link& link, const JointRow& row, Eigen::Index place,
              Eigen::MatrixXd& jacobian) const;
  Eigen::MatrixXd OneRow(const Link& link, const JointRow& row) const;
  bool MayStop(std::size_t link, std::span<const Stop> stops) const;
  RowSystem Rows(std::span<const BodyState> states, std::span<const Stop> stops) const;
  Eigen::VectorXd Errors(std::span<const BodyState> states, std::span<const Stop> stops) const;
  bool AddPassed(std::span<const BodyState> states, std::vector<Stop>& stops) const;
  Eigen::VectorXd Resist(const Eigen::VectorXd& before, const Eigen::VectorXd& after,
                         double step_s) const;
  bool Drift(const Eigen::VectorXd& velocities, std::span<const Stop> stops, double step_s,
             std::span<BodyState> states, Eigen::VectorXd& impulses) const;
  Eigen::VectorXd Project(const RowSystem& held, std::span<BodyState> states) const;

  std::vector<std::size_t> bodies_;
  std::vector<BodyInertia> inertias_;
  std::vector<Link> links_;

  std::vector<BodyState> start_;
  RowSystem held_;
  std::vector<JointRow> free_rows_;  // unset for a ball
  Eigen::VectorXd impulses_;         // along the held rows, in the last substep
};

}  // namespace rikiseki::world
