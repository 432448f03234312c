// SPDX-License-Identifier: MIT
// Bullet's solver, with as many sweeps as an island with joints takes: fifty are enough for contacts,
// but a wagon of 5 kg on wheels of 50 g would creep by 20 um/s where it stands. Friction of what is jointed
// acts in the directions in which it was aimed (bullet_joints.h), in both.
#pragma once

#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>

namespace rikiseki::world {

class JointedSolver : public btSequentialImpulseConstraintSolver {
 public:
  static constexpr int kMostSweeps = 1000;
  static constexpr double kSettled = 1e-16;  // (m/s)^2: nothing changes by more in a sweep

  btScalar solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds,
                      int manifold_count, btTypedConstraint** constraints, int constraint_count,
                      const btContactSolverInfo& info, btIDebugDraw* drawer,
                      btDispatcher* dispatcher) override {
    btContactSolverInfo own = info;
    if (constraint_count > 0) {
      own.m_numIterations = kMostSweeps;
      own.m_leastSquaresResidualThreshold = kSettled;
      own.m_solverMode |=
          SOLVER_USE_2_FRICTION_DIRECTIONS | SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
    }
    return btSequentialImpulseConstraintSolver::solveGroup(
        bodies, body_count, manifolds, manifold_count, constraints, constraint_count, own, drawer,
        dispatcher);
  }
};

}  // namespace rikiseki::world
