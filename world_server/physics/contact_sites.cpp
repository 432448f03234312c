#include "world_server/physics/contact_sites.h"

#include <algorithm>
#include <cmath>

#include "common/body_step.h"
#include "world_server/features/nearest_point.h"
#include "world_server/physics/box_box_contact.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kSameGap = 1e-3;  // m

// A place where two shapes are near, in W.
struct Near {
  Vec3 point = Vec3::Zero();  // of the body; the centre of its rounding
  double radius = 0;
  Vec3 normal = Vec3::UnitZ();  // out of the other
  double gap = 0;
};

void SphereNear(const Sphere& sphere, const Pose& pose_WS, const Shape& other, const Pose& pose_WO,
                std::vector<Near>& found) {
  const Vec3 centre = pose_WS.position;
  const NearestPoint nearest = FindNearestPoint(other, pose_WO.Inverse() * centre);
  found.push_back({.point = centre,
                   .radius = sphere.radius,
                   .normal = pose_WO.orientation * nearest.normal,
                   .gap = nearest.distance - sphere.radius});
}

void BoxNearSphere(const Box& box, const Pose& pose_WS, const Sphere& other, const Pose& pose_WO,
                   std::vector<Near>& found) {
  const NearestPoint nearest = FindNearestPoint(box, pose_WS.Inverse() * pose_WO.position);
  found.push_back({.point = pose_WS * nearest.point,
                   .normal = -(pose_WS.orientation * nearest.normal),
                   .gap = nearest.distance - other.radius});
}

// The corners come in the order of the engine's contact points (box_plane_contact.cpp). Four corners
// share their load in more than one way, the order of the sweeps decides which, and with it how a
// cube turns that is pushed beside its middle: by up to 15 %. Copy and world must do the same.
void BoxNearHalfSpace(const Box& box, const Pose& pose_WS, const HalfSpace& other,
                      const Pose& pose_WO, std::vector<Near>& found) {
  const Vec3 normal = pose_WO.orientation * other.normal;
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
        found.push_back(
            {.point = point, .normal = normal, .gap = normal.dot(point - pose_WO.position)});
      }
    }
  }
}

// False where the pair of shapes is not covered.
bool FindNear(const Shape& shape, const Pose& pose_WS, const Shape& other, const Pose& pose_WO,
              double reach_m, std::vector<Near>& found) {
  if (std::holds_alternative<Mesh>(other)) return false;  // the engine meets each triangle alone
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    SphereNear(*sphere, pose_WS, other, pose_WO, found);
    return true;
  }
  const auto* box = std::get_if<Box>(&shape);
  if (box == nullptr) return false;
  if (const auto* sphere = std::get_if<Sphere>(&other)) {
    BoxNearSphere(*box, pose_WS, *sphere, pose_WO, found);
  } else if (const auto* half_space = std::get_if<HalfSpace>(&other)) {
    BoxNearHalfSpace(*box, pose_WS, *half_space, pose_WO, found);
  } else if (const auto* other_box = std::get_if<Box>(&other)) {
    for (const ContactPoint& point :
         FindBoxBoxContact(*box, pose_WS, *other_box, pose_WO, reach_m)) {
      found.push_back({.point = point.point_W, .normal = point.normal_W, .gap = point.gap});
    }
  } else {
    return false;
  }
  return true;
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

bool FindContactSites(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                      double reach_m, std::vector<ContactSite>& sites) {
  const std::size_t first = sites.size();
  const BodyState& state = states[body];
  const Pose pose_BW = state.pose.Inverse();
  std::vector<Near> found;
  for (const Collider& collider : scene.bodies[body].colliders) {
    const Pose pose_WS = state.pose * collider.pose_BS;
    for (std::size_t other = 0; other < scene.bodies.size(); ++other) {
      if (other == body || !Collide(scene, body, other)) continue;
      const SceneBody& other_body = scene.bodies[other];
      for (const Collider& other_collider : other_body.colliders) {
        const Pose pose_WO = states[other].pose * other_collider.pose_BS;
        if (!MayReach(collider, pose_WS, other_collider, pose_WO, reach_m)) continue;
        found.clear();
        // A copy's step knows no rebound.
        const bool bounces = collider.restitution * other_collider.restitution > 0;
        if (bounces ||
            !FindNear(collider.shape, pose_WS, other_collider.shape, pose_WO, reach_m, found)) {
          sites.resize(first);
          return false;
        }
        for (const Near& near : found) {
          if (!(near.gap <= reach_m)) continue;
          ContactSite site;
          site.other = other;
          site.p_B = pose_BW * near.point;
          site.radius = near.radius;
          site.normal = near.normal;
          site.gap = near.gap;
          site.friction = std::sqrt(collider.friction * other_collider.friction);
          if (!other_body.fixed) {
            const Vec3 point = near.point - near.radius * near.normal;
            site.other_velocity = states[other].VelocityAt(point);
            site.other_inverse_mass =
                InverseEffectiveMass(BodyInertia::Of(other_body.mass_kg, other_body.inertia),
                                     states[other].pose, point, near.normal);
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

}  // namespace rikiseki::world
