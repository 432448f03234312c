// SPDX-License-Identifier: MIT
#include "world_server/physics/contact_sites.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/body_step.h"
#include "world_server/features/nearest_point.h"
#include "world_server/physics/shape_contact.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kSameGap = 1e-3;  // m
constexpr double kTurns = 0.3;     // rad/s: slower, the way in which it will roll is not known

// The corners come in the order of the engine's contact points (box_plane_contact.cpp). Four corners
// share their load in more than one way, the order of the sweeps decides which, and with it how a
// cube turns that is pushed beside its middle: by up to 15 %. Copy and world must do the same.
// All eight, not the lowest face alone: it may tip over an edge before the next frame.
void BoxOverHalfSpace(const Box& box, const Pose& pose_WS, const Vec3& normal, double offset,
                      std::vector<ContactPoint>& found) {
  const Vec3 normal_S = pose_WS.orientation.conjugate() * normal;
  int axis = 0;
  normal_S.cwiseAbs().maxCoeff(&axis);
  const double near_side = normal_S[axis] > 0 ? -1 : 1;
  for (const double side : {near_side, -near_side}) {
    for (const double sign_u : {-1, 1}) {
      for (const double sign_v : {-1, 1}) {
        Vec3 sign;
        sign[axis] = side;
        sign[(axis + 1) % 3] = sign_u;
        sign[(axis + 2) % 3] = sign_v;
        const Vec3 point = pose_WS * Vec3(sign.cwiseProduct(box.half_extents));
        found.push_back({point, normal, normal.dot(point) - offset});
      }
    }
  }
}

// Likewise of a hull with few corners: what its face does not have.
void AddOtherCorners(const Polyhedron& hull, const Pose& pose_WS, const Vec3& normal, double offset,
                     std::vector<ContactPoint>& found) {
  if (hull.corners.size() > kMostContactPoints) return;
  for (const Vec3& corner : hull.corners) {
    const Vec3 point = pose_WS * corner;
    const bool known = std::ranges::any_of(
        found, [&](const ContactPoint& other) { return other.point_W == point; });
    if (!known) found.push_back({point, normal, normal.dot(point) - offset});
  }
}

std::vector<ContactPoint> FindNear(const Solid& solid, const Pose& pose_WS, const Solid& other,
                                   const Pose& pose_WO, double reach_m) {
  std::vector<ContactPoint> found;
  const auto* box = std::get_if<Box>(&solid.shape);
  const auto* half_space = std::get_if<HalfSpace>(&other.shape);
  if (half_space == nullptr) return FindShapeContact(solid, pose_WS, other, pose_WO, reach_m);
  const Vec3 normal = pose_WO.orientation * half_space->normal;
  const double offset = normal.dot(pose_WO.position);
  if (box != nullptr) {
    BoxOverHalfSpace(*box, pose_WS, normal, offset, found);
    return found;
  }
  found = FindShapeContact(solid, pose_WS, other, pose_WO, reach_m);
  if (solid.faces) AddOtherCorners(*solid.faces, pose_WS, normal, offset, found);
  return found;
}

// A ball that touches as the ellipsoid does while it rolls on: its radius of curvature along the way
// of the contact, which is that of its support function; at rest the smaller one.
double RollingRadius(const Ellipsoid& ellipsoid, const Quat& q_WS, const Vec3& normal_W,
                     const Vec3& spin_W) {
  const Vec3 normal = q_WS.conjugate() * normal_W;
  const Mat3 squares = ellipsoid.radii.cwiseAbs2().asDiagonal();
  const Vec3 gradient = squares * normal;
  const double height = std::sqrt(normal.dot(gradient));
  const Mat3 curvature =
      squares / height - gradient * gradient.transpose() / (height * height * height);
  const Vec3 way = (q_WS.conjugate() * spin_W).cross(normal);
  if (way.norm() > kTurns) return way.dot(curvature * way) / way.squaredNorm();
  const Vec3 u = normal.unitOrthogonal();
  const Vec3 v = normal.cross(u);
  const double uu = u.dot(curvature * u), vv = v.dot(curvature * v), uv = u.dot(curvature * v);
  return (uu + vv) / 2 - std::hypot((uu - vv) / 2, uv);
}

// Whether two shapes may be as near as that; false only where they are not.
bool MayReach(const Collider& a, const Pose& pose_WA, const Collider& b, const Pose& pose_WB,
              double reach_m) {
  const Ball ball = OuterBall(a.shape);
  const Vec3 centre = pose_WA * ball.centre;
  const double reach = ball.radius + reach_m;
  const Ball other = OuterBall(b.shape);
  if ((centre - pose_WB * other.centre).norm() > reach + other.radius) return false;
  // Of what may be large and hollow the distance itself.
  if (std::holds_alternative<HalfSpace>(b.shape) || std::holds_alternative<Mesh>(b.shape)) {
    return FindNearestPoint(b.shape, pose_WB.Inverse() * centre).distance <= reach;
  }
  return true;
}

}  // namespace

SiteFinder::SiteFinder(const Scene& scene) : scene_(scene) {
  for (const SceneBody& body : scene.bodies) {
    Placed& placed = bodies_.emplace_back();
    if (!body.fixed) placed.inertia = BodyInertia::Of(body.mass_kg, body.inertia);
    for (const Collider& collider : body.colliders) placed.solids.emplace_back(collider.shape);
  }
}

bool SiteFinder::Find(std::span<const BodyState> states, std::size_t body, double reach_m,
                      std::span<const std::size_t> others, std::vector<ContactSite>& sites) const {
  const std::size_t first = sites.size();
  const BodyState& state = states[body];
  const Pose pose_BW = state.pose.Inverse();
  for (std::size_t place = 0; place < bodies_[body].solids.size(); ++place) {
    const Collider& collider = scene_.bodies[body].colliders[place];
    const Pose pose_WS = state.pose * collider.pose_BS;
    const auto* ellipsoid = std::get_if<Ellipsoid>(&collider.shape);
    for (const std::size_t other : others) {
      if (other == body || !Collide(scene_, body, other)) continue;
      const SceneBody& other_body = scene_.bodies[other];
      for (std::size_t i = 0; i < bodies_[other].solids.size(); ++i) {
        const Collider& other_collider = other_body.colliders[i];
        const Pose pose_WO = states[other].pose * other_collider.pose_BS;
        if (!MayReach(collider, pose_WS, other_collider, pose_WO, reach_m)) continue;
        if (collider.restitution * other_collider.restitution > 0) {
          sites.resize(first);  // a copy's step knows no rebound
          return false;
        }
        for (const ContactPoint& near : FindNear(bodies_[body].solids[place], pose_WS,
                                                 bodies_[other].solids[i], pose_WO, reach_m)) {
          if (!(near.gap <= reach_m)) continue;
          ContactSite site;
          site.other = other;
          site.radius = near.radius;
          if (ellipsoid != nullptr) {
            site.radius = RollingRadius(*ellipsoid, pose_WS.orientation, near.normal_W,
                                        state.angular_velocity);
          }
          site.p_B = pose_BW * (near.point_W + site.radius * near.normal_W);
          site.normal = near.normal_W;
          site.gap = near.gap;
          site.friction = std::sqrt(collider.friction * other_collider.friction);
          if (!other_body.fixed) {
            site.other_velocity = states[other].VelocityAt(near.point_W);
            site.other_inverse_mass = InverseEffectiveMass(
                bodies_[other].inertia, states[other].pose, near.point_W, near.normal_W);
          }
          sites.push_back(site);
        }
      }
    }
  }
  // Contacts of about the same gap stay in the order of the geometry, whatever their last bits.
  std::stable_sort(sites.begin() + static_cast<std::ptrdiff_t>(first), sites.end(),
                   [](const ContactSite& a, const ContactSite& b) {
                     return std::round(a.gap / kSameGap) < std::round(b.gap / kSameGap);
                   });
  return true;
}

bool SiteFinder::Find(std::span<const BodyState> states, std::size_t body, double reach_m,
                      std::vector<ContactSite>& sites) const {
  std::vector<std::size_t> all(bodies_.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return Find(states, body, reach_m, all, sites);
}

}  // namespace rikiseki::world
