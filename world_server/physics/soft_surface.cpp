// SPDX-License-Identifier: MIT
#include "world_server/physics/soft_surface.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "world_server/geometry/triangle.h"

namespace rikiseki::world {
namespace {

// Radius of a pad: of a fingertip's, which presses like a punch of half of it, but not finer than the
// mesh can tell, in mean edges of the surface.
constexpr double kPadRadius = 0.02;  // m
constexpr double kPadEdges = 2;
constexpr double kLeastCompliance = 1e-9;  // m/N: stiffer is no surface that can be rendered

// Where a line meets a triangle from its outer side: the way along the line, and the corners' weights.
struct Hit {
  double way = 0;
  Vec3 weights = Vec3::Zero();
};

std::optional<Hit> Meet(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& origin,
                        const Vec3& direction) {
  const Vec3 area = (b - a).cross(c - a);
  const double facing = -area.dot(direction);
  if (!(facing > 0)) return std::nullopt;
  const double way = area.dot(origin - a) / facing;
  const Vec3 at = origin + way * direction;
  Vec3 weights((b - at).cross(c - at).dot(area), (c - at).cross(a - at).dot(area),
               (a - at).cross(b - at).dot(area));
  weights /= area.squaredNorm();
  if (!(weights.minCoeff() >= -1e-12)) return std::nullopt;
  return Hit{way, weights};
}

}  // namespace

SoftSurface::SoftSurface(const SoftBody& body) : body_(body), triangles_(SurfaceOf(body.mesh())) {
  const SoftBody::NodeVectors& at = body.unloaded();
  std::vector<Vec3> normals(static_cast<std::size_t>(at.cols()), Vec3::Zero());
  double edges = 0;
  for (const Triangle& t : triangles_) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 to_next = at.col(t[(i + 1) % 3]) - at.col(t[i]);
      const Vec3 to_last = at.col(t[(i + 2) % 3]) - at.col(t[i]);
      const Vec3 across = to_next.cross(to_last);
      // By their angles: how a plane face is cut into triangles does not show.
      normals[t[i]] += std::atan2(across.norm(), to_next.dot(to_last)) * across.stableNormalized();
      edges += to_next.norm();
    }
    nodes_.insert(nodes_.end(), t.begin(), t.end());
  }
  std::sort(nodes_.begin(), nodes_.end());
  nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
  for (const std::uint32_t node : nodes_) normals_.push_back(normals[node].stableNormalized());
  pad_radius_ =
      std::max(kPadRadius, kPadEdges * edges / (3 * static_cast<double>(triangles_.size())));

  std::vector<Vec3> corners;
  for (Eigen::Index i = 0; i < at.cols(); ++i) corners.emplace_back(at.col(i));
  unloaded_ = Hull{.mesh = std::make_shared<TriangleMesh>(corners, triangles_)};
}

Vec3 SoftSurface::AsUnloaded(const Triangle& t, const Vec3& weights) const {
  const SoftBody::NodeVectors& at = body_.unloaded();
  return weights[0] * at.col(t[0]) + weights[1] * at.col(t[1]) + weights[2] * at.col(t[2]);
}

Vec3 SoftSurface::WithoutDisplacement(const Vec3& p) const {
  const SoftBody::NodeVectors& at = body_.positions();
  double nearest = std::numeric_limits<double>::infinity();
  Vec3 displacement = Vec3::Zero();
  for (const Triangle& t : triangles_) {
    const TriangleFoot foot = FootOnTriangle(at.col(t[0]), at.col(t[1]), at.col(t[2]), p);
    const double square = (foot.point - p).squaredNorm();
    if (!(square < nearest)) continue;
    nearest = square;
    displacement = foot.point - AsUnloaded(t, foot.weights);
  }
  return p - displacement;
}

SoftSurface::Pad SoftSurface::PadAt(const Vec3& point, const Vec3& normal) const {
  const SoftBody::NodeVectors& at = body_.unloaded();
  Pad pad;
  double total = 0;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const double square = (at.col(nodes_[i]) - point).squaredNorm();
    const double facing =
        normals_[i].dot(normal);  // not what lies on the other side of something thin
    if (!(square < pad_radius_ * pad_radius_) || !(facing > 0)) continue;
    const double inside = facing * (1 - square / (pad_radius_ * pad_radius_));
    pad.nodes.push_back(nodes_[i]);
    pad.weights.push_back(inside * inside);
    total += pad.weights.back();
  }
  if (pad.nodes.size() < 3 || !(total > 0)) return WholeSurface();
  for (double& weight : pad.weights) weight /= total;
  return pad;
}

SoftSurface::Pad SoftSurface::WholeSurface() const {
  return {nodes_, std::vector<double>(nodes_.size(), 1 / static_cast<double>(nodes_.size()))};
}

// To every node its weight of the impulse, and a turn of the pad as a whole that mends the moment.
void SoftSurface::Share(const Pad& pad, const SoftBody::NodeVectors& positions, const Vec3& impulse,
                        const Vec3& angular_impulse, SoftBody::NodeVectors& impulses) {
  Vec3 centre = Vec3::Zero();
  for (std::size_t i = 0; i < pad.nodes.size(); ++i) {
    centre += pad.weights[i] * positions.col(pad.nodes[i]);
  }
  Mat3 inertia = Mat3::Zero();  // of the weights
  for (std::size_t i = 0; i < pad.nodes.size(); ++i) {
    const Vec3 arm = positions.col(pad.nodes[i]) - centre;
    inertia += pad.weights[i] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
  }
  const Vec3 turn = inertia.fullPivLu().solve(angular_impulse - centre.cross(impulse));
  for (std::size_t i = 0; i < pad.nodes.size(); ++i) {
    const Vec3 arm = positions.col(pad.nodes[i]) - centre;
    impulses.col(pad.nodes[i]) += pad.weights[i] * (impulse + turn.cross(arm));
  }
}

SoftSurface::Yield SoftSurface::YieldAt(const Vec3& point, const Vec3& normal) const {
  const SoftBody::NodeVectors& at = body_.unloaded();
  SoftBody::NodeVectors force = SoftBody::NodeVectors::Zero(3, at.cols());
  Share(PadAt(point, normal), at, normal, point.cross(normal), force);
  const SoftBody::NodeVectors way = body_.Displacements(force);
  Yield yield{.compliance_m_per_n = force.cwiseProduct(way).sum(),
              .relaxation_s = body_.relaxation_s()};
  for (const std::uint32_t node : nodes_) {
    if (body_.is_held(node)) continue;
    yield.inverse_mass += force.col(node).squaredNorm() / body_.masses()[node];
  }
  return yield;
}

// A slow push at speed v moves the own spring by a = stiffness/own of it and the body by the rest:
// damping force = (d_own a^2 + relaxation/c (1-a)^2) v.
SoftSurface::Spring SoftSurface::InSeries(const Spring& own, const Yield& yield) {
  const double spring = own.stiffness_n_per_m > 0 ? 1 / own.stiffness_n_per_m : 0;
  const double compliance = std::max(yield.compliance_m_per_n, kLeastCompliance);
  const double stiffness = 1 / (spring + compliance);
  const double damping = stiffness * stiffness *
                         (own.damping_ns_per_m * spring * spring + yield.relaxation_s * compliance);
  return {stiffness, std::min(damping, own.damping_ns_per_m)};
}

void SoftSurface::Spread(const Vec3& impulse, const Vec3& angular_impulse,
                         SoftBody::NodeVectors& impulses) const {
  const SoftBody::NodeVectors& at = body_.positions();
  Pad pad;
  const double size = impulse.stableNorm();
  if (size > 0) {
    const Vec3 direction = impulse / size;
    // The part of the moment that a force along a line can have says which line.
    const Vec3 on_line = direction.cross(angular_impulse) / size;
    double first = std::numeric_limits<double>::infinity();
    Vec3 point = Vec3::Zero();
    for (const Triangle& t : triangles_) {
      const auto hit = Meet(at.col(t[0]), at.col(t[1]), at.col(t[2]), on_line, direction);
      if (!hit || !(hit->way < first)) continue;
      first = hit->way;
      point = AsUnloaded(t, hit->weights);
    }
    if (std::isfinite(first)) pad = PadAt(point, -direction);
  }
  if (pad.nodes.empty()) pad = WholeSurface();
  Share(pad, at, impulse, angular_impulse, impulses);
}

}  // namespace rikiseki::world
