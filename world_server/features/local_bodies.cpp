// SPDX-License-Identifier: MIT
#include "world_server/features/local_bodies.h"

#include <algorithm>

#include "world_server/features/joint_sites.h"
#include "world_server/physics/air.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

constexpr double kSteadyAir = 0.2;  // of the speed, in two periods
constexpr double kTouching =
    1e-3;  // m: farther, a neighbour is pushed after the next frame at best

struct Candidate {
  std::size_t body = 0;
  std::vector<ContactSite> sites;
};

class Search {
 public:
  Search(const Scene& scene, const DynamicsWorld& dynamics, std::span<const BodyState> states,
         const FeatureReach& reach, std::size_t room)
      : scene_(scene), dynamics_(dynamics), states_(states), reach_(reach), room_(room) {}

  /// Adds the body and the neighbours it needs, or nothing.
  void Add(std::size_t body) {
    const std::size_t before = found_.size();
    if (!AddWithNeighbours(body)) found_.resize(before);
  }

  const std::vector<Candidate>& found() const { return found_; }

  /// Whether the contacts of `body` say where it touches `other`.
  bool Tells(std::size_t body, std::size_t other) const {
    return std::any_of(found_.begin(), found_.end(), [=](const Candidate& candidate) {
      return candidate.body == body &&
             std::any_of(candidate.sites.begin(), candidate.sites.end(),
                         [=](const ContactSite& site) { return site.other == other; });
    });
  }

 private:
  bool Has(std::size_t body) const {
    return std::any_of(found_.begin(), found_.end(),
                       [=](const Candidate& other) { return other.body == body; });
  }

  bool AddWithNeighbours(std::size_t body) {
    if (Has(body)) return true;
    if (found_.size() == room_ || Brakes(body)) return false;
    std::vector<ContactSite> sites = JointSites(scene_, states_, body, Reach(body));
    // A joint of two copies stands with the one that was found first.
    std::erase_if(sites, [&](const ContactSite& site) { return Has(site.other); });
    const auto held = static_cast<std::ptrdiff_t>(sites.size());
    if (!dynamics_.FindContacts(body, Reach(body), sites)) return false;
    if (held > 0) {
      const auto out_of_reach =
          std::remove_if(sites.begin() + held, sites.end(), [&](const ContactSite& site) {
            return scene_.bodies[site.other].fixed && !JointsLetMeet(scene_, states_, body, site);
          });
      sites.erase(out_of_reach, sites.end());
    }
    // What it may come to later than to all these, the next frame tells.
    if (sites.size() > protocol::kMaxContactPlanes) sites.resize(protocol::kMaxContactPlanes);
    const std::size_t place = found_.size();
    found_.push_back({.body = body, .sites = std::move(sites)});
    for (std::size_t i = 0; i < found_[place].sites.size(); ++i) {
      const std::size_t other = found_[place].sites[i].other;
      if (other == ContactSite::kNobody || scene_.bodies[other].fixed) continue;
      const std::size_t before = found_.size();
      if (AddWithNeighbours(other)) continue;
      found_.resize(before);
      if (found_[place].sites[i].gap < kTouching &&
          scene_.bodies[other].mass_kg < kHeavyNeighbour * scene_.bodies[body].mass_kg) {
        return false;
      }
    }
    return true;
  }

  // Whether the air changes too much before the next frame to be told as an acceleration.
  bool Brakes(std::size_t body) const {
    const SceneBody& b = scene_.bodies[body];
    const AirDrag air = AirDrag::On(b);
    return air.acts() &&
           air.Rate(BodyInertia::Of(b.mass_kg, b.inertia)) * 2 * reach_.period_s > kSteadyAir;
  }

  double Reach(std::size_t body) const {
    double outer = 0;
    for (const Collider& collider : scene_.bodies[body].colliders) {
      if (std::holds_alternative<HalfSpace>(collider.shape)) continue;
      const Ball ball = OuterBall(collider.shape);
      outer = std::max(outer, (collider.pose_BS * ball.centre).norm() + ball.radius);
    }
    const BodyState& state = states_[body];
    const double speed = state.velocity.norm() + outer * state.angular_velocity.norm();
    return reach_.radius_m + 2 * reach_.period_s * speed;
  }

  const Scene& scene_;
  const DynamicsWorld& dynamics_;
  std::span<const BodyState> states_;
  FeatureReach reach_;
  std::size_t room_;
  std::vector<Candidate> found_;
};

protocol::ContactPlane ToPlane(const ContactSite& site,
                               std::span<const std::uint32_t> generations) {
  const bool is_of_body = site.other != ContactSite::kNobody;
  return {.other_body = is_of_body ? static_cast<std::uint32_t>(site.other) : kNoBody,
          .other_generation = is_of_body ? generations[site.other] : 0,
          .point = ToArray(site.p_B),
          .normal = ToArray(site.normal),
          .gap = site.gap,
          .friction = site.friction,
          .other_velocity = ToArray(site.other_velocity),
          .other_inverse_mass = site.other_inverse_mass,
          .impulse = ToArray(site.impulse),
          .radius = site.radius};
}

}  // namespace

std::uint32_t FindLocalBodies(const Scene& scene, const DynamicsWorld& dynamics,
                              std::span<const BodyState> states,
                              std::span<const std::uint32_t> generations,
                              std::span<const protocol::Plane> planes, const FeatureReach& reach,
                              std::span<protocol::LocalBody> local_bodies) {
  Search search(scene, dynamics, states, reach, local_bodies.size());
  for (const protocol::Plane& plane : planes) {
    if (!scene.bodies[plane.body].fixed) search.Add(plane.body);
  }
  std::uint32_t count = 0;
  for (const Candidate& candidate : search.found()) {
    const SceneBody& body = scene.bodies[candidate.body];
    const BodyState& state = states[candidate.body];
    protocol::LocalBody& local = local_bodies[count++];
    local = {};
    local.body = static_cast<std::uint32_t>(candidate.body);
    local.generation = generations[candidate.body];
    local.mass = body.mass_kg;
    local.inertia = {body.inertia(0, 0), body.inertia(0, 1), body.inertia(0, 2),
                     body.inertia(1, 1), body.inertia(1, 2), body.inertia(2, 2)};
    local.position = ToArray(state.pose.position);
    local.orientation = ToArray(state.pose.orientation);
    local.velocity = ToArray(state.velocity);
    local.angular_velocity = ToArray(state.angular_velocity);
    const Vec3 gravity = body.falls ? scene.gravity : Vec3(Vec3::Zero());
    local.acceleration = ToArray(gravity);
    if (const AirDrag air = AirDrag::On(body); air.acts()) {
      const BodyInertia inertia = BodyInertia::Of(body.mass_kg, body.inertia);
      local.acceleration = ToArray(Vec3(gravity + air.Acceleration(inertia, state)));
      local.angular_acceleration = ToArray(air.AngularAcceleration(inertia, state));
    }
    const JointResistance resistance =
        ResistanceOfJoints(scene, states, candidate.body, 2 * reach.period_s);
    if (!resistance.force.isZero(0) || !resistance.torque.isZero(0)) {
      const BodyInertia inertia = BodyInertia::Of(body.mass_kg, body.inertia);
      local.acceleration =
          ToArray(Vec3(ToVec3(local.acceleration) + resistance.force / body.mass_kg));
      local.angular_acceleration =
          ToArray(Vec3(ToVec3(local.angular_acceleration) +
                       inertia.InverseInertia(state.pose.orientation) * resistance.torque));
    }
    for (const ContactSite& site : candidate.sites) {
      // A contact of two copies stands with the one of the lower number, unless only the other
      // reaches so far.
      if (site.other < candidate.body && search.Tells(site.other, candidate.body)) continue;
      local.contacts[local.contact_count++] = ToPlane(site, generations);
    }
  }
  return count;
}

}  // namespace rikiseki::world
