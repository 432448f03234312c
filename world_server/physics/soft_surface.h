// SPDX-License-Identifier: MIT
// The surface of a soft body as a finger meets it: where the planes are, how it gives way, and which
// nodes take a push. Everything in the body's frame B.
//
// Why the finger is not simply shown the deformed surface: it would yield one or two world periods after
// the push, and a spring k_p against a surface softer than k_p that answers late is a loop of gain above
// 1. So the world sends the surface where it would be without this push, and as its stiffness the two
// springs in series, 1/(1/k_p + c), where c is the body's own static compliance under the finger: at
// rest exactly the same force, and nothing that the finger does comes back to it late. Which point of
// the surface is under the finger, the deformed body says.
#pragma once

#include <vector>

#include "world_server/physics/soft_body.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class SoftSurface {
 public:
  /// `body` is held, and outlives this.
  explicit SoftSurface(const SoftBody& body);

  /// The surface nobody pushes.
  const Shape& unloaded() const { return unloaded_; }

  /// Where a finger at `p` would be had the material not moved under it: `p` less the displacement of
  /// the nearest point of the nearest triangle of the deformed surface. Continuous, but where two
  /// points are equally near.
  Vec3 WithoutDisplacement(const Vec3& p) const;

  /// How the unloaded surface yields to a push along `normal` at `point` of it.
  struct Yield {
    double compliance_m_per_n = 0;  // when it has come to rest
    double relaxation_s = 0;        // of its material
    double inverse_mass = 0;        // 1/kg, at once
  };
  Yield YieldAt(const Vec3& point, const Vec3& normal) const;

  /// What a finger feels of its own spring and damper before a body that yields: the springs in series,
  /// and of the damping, the material's with it, what a slow push meets; but no more than its own, which
  /// is what its loop is known to bear. A spring of 0 is none: rigid.
  struct Spring {
    double stiffness_n_per_m = 0;
    double damping_ns_per_m = 0;
  };
  static Spring InSeries(const Spring& own, const Yield& yield);

  /// Adds to `impulses` what each node takes of a push by its line of action: those of the pad under
  /// the point where the line meets the deformed surface from outside - all of the surface, where it
  /// does not. They add up to `impulse` [N s], and their moments about B's origin, with the nodes where
  /// they are, to `angular_impulse` [N m s], both to rounding.
  void Spread(const Vec3& impulse, const Vec3& angular_impulse,
              SoftBody::NodeVectors& impulses) const;

 private:
  // The nodes of a place and their weights, which add up to 1. A finger presses with a pad, not with a
  // needle: under the three corners of one triangle alone the compliance would depend on the mesh, and
  // by 40 % on where in the triangle the finger is.
  struct Pad {
    std::vector<std::uint32_t> nodes;
    std::vector<double> weights;
  };

  Pad PadAt(const Vec3& point, const Vec3& normal) const;
  Pad WholeSurface() const;
  Vec3 AsUnloaded(const Triangle& triangle, const Vec3& weights) const;
  static void Share(const Pad& pad, const SoftBody::NodeVectors& positions, const Vec3& impulse,
                    const Vec3& angular_impulse, SoftBody::NodeVectors& impulses);

  const SoftBody& body_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> nodes_;  // of the surface
  std::vector<Vec3> normals_;         // of them, unloaded
  double pad_radius_ = 0;             // m
  Shape unloaded_;
};

}  // namespace rikiseki::world
