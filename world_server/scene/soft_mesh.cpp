// SPDX-License-Identifier: MIT
#include "world_server/scene/soft_mesh.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <variant>

#include "world_server/features/nearest_point.h"

namespace rikiseki::world {
namespace {

constexpr double kUsualNodes = 200;
constexpr double kTouch = 1e-3;    // of an element: as near is touching
constexpr double kMostSag = 0.2;   // of the height, where the body's weight strains it most
constexpr double kOnALine = 1e-6;  // of the extent

Vec3 RadiiOf(const Shape& shape) {
  if (const auto* ball = std::get_if<Sphere>(&shape)) return Vec3::Constant(ball->radius);
  return std::get<Ellipsoid>(shape).radii;
}

bool Holds(const Scene& scene, const Vec3& p_W, double touch_m) {
  for (const SceneBody& body : scene.bodies) {
    if (!body.fixed) continue;
    for (const Collider& collider : body.colliders) {
      const Pose pose_WS = body.pose_WB * collider.pose_BS;
      if (FindNearestPoint(collider.shape, pose_WS.Inverse() * p_W).distance <= touch_m)
        return true;
    }
  }
  return false;
}

// Whether points span a plane at least.
bool SpanAPlane(const std::vector<Vec3>& points) {
  if (points.size() < 3) return false;
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : points) centre += p / static_cast<double>(points.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : points) spread += (p - centre) * (p - centre).transpose();
  const Vec3 squares = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvalues();
  return squares[1] > kOnALine * kOnALine * squares[2];
}

}  // namespace

double UsualElement(const Shape& shape) {
  // Counts fall with the edge's length; a third of the smallest extent is coarse enough.
  double extent = 0;
  if (const auto* box = std::get_if<Box>(&shape)) {
    extent = 2 * box->half_extents.maxCoeff();
  } else {
    extent = 2 * RadiiOf(shape).maxCoeff();
  }
  double edge = extent;
  while (SoftNodeCount(shape, edge / 1.05) <= kUsualNodes) edge /= 1.05;
  return edge;
}

double SoftNodeCount(const Shape& shape, double element_m) {
  if (const auto* box = std::get_if<Box>(&shape)) return BoxNodeCount(box->half_extents, element_m);
  if (std::holds_alternative<Sphere>(shape) || std::holds_alternative<Ellipsoid>(shape)) {
    return EllipsoidNodeCount(RadiiOf(shape), element_m);
  }
  return 0;
}

SoftMesh MeshSoftBody(const Scene& scene, const SceneBody& body) {
  const Collider& collider = body.colliders.at(0);
  const double element = body.softness.value().element_m;
  SoftMesh soft;
  if (const auto* box = std::get_if<Box>(&collider.shape)) {
    soft.mesh = MeshBox(box->half_extents, element);
  } else {
    soft.mesh = MeshEllipsoid(RadiiOf(collider.shape), element);
  }
  for (Vec3& node : soft.mesh.nodes) {
    node = collider.pose_BS * node;
    soft.held.push_back(Holds(scene, body.pose_WB * node, kTouch * element) ? 1 : 0);
  }
  return soft;
}

std::string WhyNotSoft(const Scene& scene, const SceneBody& body) {
  const SoftMesh soft = MeshSoftBody(scene, body);
  std::vector<Vec3> held;
  double low = 0, high = 0;
  const Vec3 down = scene.gravity.stableNormalized();
  for (std::size_t i = 0; i < soft.held.size(); ++i) {
    if (soft.held[i] != 0) held.push_back(soft.mesh.nodes[i]);
    const double depth = down.dot(body.pose_WB.orientation * soft.mesh.nodes[i]);
    low = i == 0 ? depth : std::min(low, depth);
    high = i == 0 ? depth : std::max(high, depth);
  }
  if (!SpanAPlane(held)) {
    return "nothing holds it: fixed bodies must touch it at three points that lie on no line, "
           "and " +
           std::to_string(held.size()) + " of its nodes touch one";
  }
  if (held.size() == soft.held.size())
    return "it lies within fixed bodies, so that nothing can move";
  // A column of this height, on its foot: strain of its lowest layer.
  const double density = body.mass_kg / soft.mesh.Volume();
  const double needed = body.falls ? density * scene.gravity.norm() * (high - low) / kMostSag : 0.0;
  if (body.softness->youngs_modulus_pa < needed) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "it would collapse under its own weight; at least %.3g Pa are right for its "
                  "density and height, or <gravity>false</gravity>",
                  needed);
    return text;
  }
  return "";
}

}  // namespace rikiseki::world
