// SPDX-License-Identifier: MIT
// A scene as the world runs it: bodies with shapes, masses and surfaces. sdf_loader.h reads it from SDF.
// Equality is that of the description, to the bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/geometry.h"
#include "world_server/geometry/triangle_mesh.h"

namespace rikiseki::world {

struct Box {
  Vec3 half_extents = Vec3::Zero();  // m
  bool operator==(const Box&) const = default;
};
struct Sphere {
  double radius = 0;  // m
  bool operator==(const Sphere&) const = default;
};
struct HalfSpace {
  Vec3 normal = Vec3::UnitZ();  // unit, out of the solid; through its origin
  bool operator==(const HalfSpace&) const = default;
};
struct Cylinder {
  double radius = 0, half_length = 0;  // m, axis z
  bool operator==(const Cylinder&) const = default;
};
struct Capsule {
  double radius = 0, half_length = 0;  // m, axis z, without the caps
  bool operator==(const Capsule&) const = default;
};
struct Ellipsoid {
  Vec3 radii = Vec3::Zero();  // m
  bool operator==(const Ellipsoid&) const = default;
};
/// Where triangles came from, for observers.
struct MeshFile {
  std::string path;
  std::array<std::uint8_t, 32> sha256{};  // of its bytes
  Vec3 scale = Vec3::Ones();
  bool operator==(const MeshFile&) const = default;
};
struct Hull {  // convex and closed
  std::shared_ptr<const TriangleMesh> mesh;
  MeshFile file = {};
  bool operator==(const Hull& other) const {
    return file == other.file && SameTriangles(mesh.get(), other.mesh.get());
  }
};
struct Mesh {  // any; of bodies that cannot move
  std::shared_ptr<const TriangleMesh> mesh;
  MeshFile file = {};
  bool operator==(const Mesh& other) const {
    return file == other.file && SameTriangles(mesh.get(), other.mesh.get());
  }
};
using Shape = std::variant<Box, Sphere, HalfSpace, Cylinder, Capsule, Ellipsoid, Hull, Mesh>;

/// One collision shape of a body.
struct Collider {
  Shape shape;
  Pose pose_BS = {};                             // shape in the body's centre-of-mass frame
  double friction = 1;                           // Coulomb; two surfaces combine as sqrt(mu1 mu2)
  double restitution = 0;                        // 0..1; two surfaces combine as the product
  std::optional<double> stiffness_n_per_m = {};  // rendered, where the scene says so
  std::optional<double> damping_ns_per_m = {};
  std::optional<double> static_friction = {};  // for the finger; none = as `friction`
  double recovery_s = 0;  // its force takes this long to come and go; 0 = the haptic side's own

  bool operator==(const Collider&) const = default;
};

/// What a body that deforms is made of; its mass is spread evenly over its one collider.
struct Softness {
  double youngs_modulus_pa = 0;
  double poisson_ratio = 0.3;
  double relaxation_s = 0.02;  // damping: stress = C (strain + relaxation strain rate)
  double element_m = 0;        // edge of the tetrahedra, roughly

  bool operator==(const Softness&) const = default;
};

struct SceneBody {
  std::string name;  // "model::link"
  bool fixed = false;
  double mass_kg = 0;           // > 0 unless fixed
  Mat3 inertia = Mat3::Zero();  // kg m^2, about the centre of mass, in the body frame
  Pose pose_WB = {};            // of the centre-of-mass frame at the start
  bool falls = true;            // whether gravity acts on it
  double drag_ns_per_m = 0;     // of the air: force = drag * (wind - velocity)
  double angular_drag_nms = 0;  // N m s/rad
  Vec3 wind = Vec3::Zero();     // m/s, of the air round this body
  std::vector<Collider> colliders = {};
  // Links of one model pass through each other unless one of them says otherwise; 0 = of none.
  std::uint32_t model = 0;
  bool self_collides = false;
  std::optional<Softness> softness = {};  // none: rigid

  bool operator==(const SceneBody&) const = default;
};

/// What leaves two bodies one freedom, or the three of a ball. Jointed bodies do not collide. All
/// positions are 0 at the start: there both frames are the same one in W.
struct Joint {
  enum class Type {
    kRevolute,   // turns about z; position in rad, damping in N m s, friction in N m
    kPrismatic,  // slides along z; position in m, damping in N s/m, friction in N
    kBall,       // neither limits nor friction
  };
  static constexpr std::size_t kWorld = static_cast<std::size_t>(-1);

  std::string name;  // "model::joint"
  Type type = Type::kRevolute;
  std::size_t parent = kWorld;  // a body, which may be fixed
  std::size_t child = kWorld;   // likewise; at least one of the two moves
  Pose pose_PJ = {};            // the joint in the parent's frame; in W, if that is the world
  Pose pose_CJ = {};            // ... in the child's
  double lower = -std::numeric_limits<double>::infinity();  // <= 0
  double upper = std::numeric_limits<double>::infinity();   // >= 0
  double damping = 0;
  double friction = 0;  // Coulomb: the force or torque against which it moves

  bool operator==(const Joint&) const = default;
};

struct Scene {
  std::string name;
  Vec3 gravity = Vec3(0, 0, -9.81);
  std::vector<SceneBody> bodies;  // what they are called on the wire: body_numbers.h
  std::vector<Joint> joints = {};

  bool operator==(const Scene&) const = default;
};

/// Whether two bodies of a scene touch where they meet: not if they are jointed, nor as links of one
/// model that does not collide with itself.
bool Collide(const Scene& scene, std::size_t a, std::size_t b);

/// Whether a joint holds the body.
bool IsJointed(const Scene& scene, std::size_t body);

/// Whether some body is soft.
bool Deforms(const Scene& scene);

}  // namespace rikiseki::world
