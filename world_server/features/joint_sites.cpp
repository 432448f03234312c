// SPDX-License-Identifier: MIT
#include "world_server/features/joint_sites.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <utility>

namespace rikiseki::world {
namespace {

constexpr double kNearLimit = 1;  // rad: as far as the plane of a limit is one
constexpr double kAcross = 1e-6;  // a body moves by less of its way along a normal: across it

// A joint as one of its bodies has it.
class Held {
 public:
  Held(const Scene& scene, std::span<const BodyState> states, const Joint& joint, std::size_t body)
      : joint_(joint),
        body_(scene.bodies[body]),
        state_(states[body]),
        is_child_(joint.child == body),
        other_(is_child_ ? joint.parent : joint.child) {
    const Pose& frame = is_child_ ? joint.pose_CJ : joint.pose_PJ;
    const Pose& other_frame = is_child_ ? joint.pose_PJ : joint.pose_CJ;
    own_WJ_ = state_.pose * frame;
    other_WJ_ = other_frame;
    if (other_ != Joint::kWorld) {
      other_state_ = states[other_];
      other_WJ_ = other_state_.pose * other_frame;
    }
  }

  bool to_fixed(const Scene& scene) const {
    return other_ == Joint::kWorld || scene.bodies[other_].fixed;
  }
  Vec3 axis() const { return other_WJ_.orientation * Vec3::UnitZ(); }

  void AppendSites(double reach_m, std::vector<ContactSite>& sites) const {
    // So far apart two points of a body hardly know of each other, and sweeps settle soon.
    const double lever = std::sqrt(body_.inertia.trace() / (2 * body_.mass_kg));
    const auto hold = [&](const Vec3& point_J, std::initializer_list<Vec3> across_J) {
      for (const Vec3& normal_J : across_J) {
        for (const double side : {1.0, -1.0}) AddSite(point_J, point_J, side * normal_J, sites);
      }
    };
    const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
    if (joint_.type == Joint::Type::kBall) return hold(Vec3::Zero(), {x, y, z});
    hold(lever * z, {x, y});
    hold(-lever * z, {x, y});
    const double upper = is_child_ ? joint_.upper : -joint_.lower;
    const double lower = is_child_ ? joint_.lower : -joint_.upper;
    const double position = Position();
    if (joint_.type == Joint::Type::kRevolute) {
      hold(Vec3::Zero(), {z});
      const double range = upper - lower;
      if (std::isfinite(range) && range > 2 * std::numbers::pi) return;  // in which turn is it?
      for (const auto& [limit, side] : {std::pair(upper, 1.0), std::pair(lower, -1.0)}) {
        if (!(std::abs(limit - position) < kNearLimit)) continue;
        const Vec3 stop(lever * std::cos(limit), lever * std::sin(limit), 0);
        AddSite(lever * x, stop, side * Vec3(std::sin(limit), -std::cos(limit), 0), sites);
      }
    } else {
      hold(lever * x, {y});
      for (const auto& [limit, side] : {std::pair(upper, 1.0), std::pair(lower, -1.0)}) {
        if (!(std::abs(limit - position) < reach_m)) continue;
        AddSite(Vec3::Zero(), limit * z, -side * z, sites);
      }
    }
  }

  // Of the body's point along `normal`, for each unit of what the joint lets happen.
  double Approach(const Vec3& point_W, const Vec3& normal) const {
    const Vec3 arm = point_W - other_WJ_.position;
    switch (joint_.type) {
      case Joint::Type::kRevolute:
        return axis().cross(arm).dot(normal) / std::max(arm.norm(), kAcross);
      case Joint::Type::kPrismatic:
        return axis().dot(normal);
      case Joint::Type::kBall:
        break;
    }
    return arm.cross(normal).norm() / std::max(arm.norm(), kAcross);
  }

  void Resist(double steady_s, JointResistance& resistance) const {
    if (joint_.type == Joint::Type::kBall || !(joint_.damping > 0 || joint_.friction > 0)) return;
    const Vec3 along = axis();
    double rate = along.dot(state_.angular_velocity - other_state_.angular_velocity);
    double inertia = 0;
    if (joint_.type == Joint::Type::kRevolute) {
      const Vec3 along_B = state_.pose.orientation.conjugate() * along;
      const Vec3 arm = state_.pose.position - other_WJ_.position;
      inertia = along_B.dot(body_.inertia * along_B) +
                body_.mass_kg * (arm - along.dot(arm) * along).squaredNorm();
    } else {
      inertia = body_.mass_kg;
      rate = along.dot(state_.velocity - other_state_.VelocityAt(state_.pose.position));
    }
    const double wanted = joint_.damping * std::abs(rate) + joint_.friction;
    const double size = std::min(wanted, inertia * std::abs(rate) / steady_s);
    Vec3& sum = joint_.type == Joint::Type::kRevolute ? resistance.torque : resistance.force;
    sum -= std::copysign(size, rate) * along;
  }

 private:
  // The body's point [in its frame of the joint] on a plane through a place of the other's.
  void AddSite(const Vec3& point_J, const Vec3& place_J, const Vec3& normal_J,
               std::vector<ContactSite>& sites) const {
    const Vec3 point_W = own_WJ_ * point_J;
    ContactSite& site = sites.emplace_back();
    site.other = other_;
    site.p_B = state_.pose.Inverse() * point_W;
    site.normal = other_WJ_.orientation * normal_J;
    site.gap = site.normal.dot(point_W - other_WJ_ * place_J);
    site.other_velocity = other_state_.VelocityAt(point_W);
  }

  // Of the body against the other.
  double Position() const {
    const Pose pose = other_WJ_.Inverse() * own_WJ_;
    if (joint_.type == Joint::Type::kPrismatic) return pose.position.z();
    return std::remainder(2 * std::atan2(pose.orientation.z(), pose.orientation.w()),
                          2 * std::numbers::pi);
  }

  const Joint& joint_;
  const SceneBody& body_;
  const BodyState& state_;
  bool is_child_;
  std::size_t other_;
  BodyState other_state_;  // at rest, if that is the world
  Pose own_WJ_, other_WJ_;
};

template <typename Use>
void ForEachJoint(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                  const Use& use) {
  for (const Joint& joint : scene.joints) {
    if (joint.parent == body || joint.child == body) use(Held(scene, states, joint, body));
  }
}

}  // namespace

std::vector<ContactSite> JointSites(const Scene& scene, std::span<const BodyState> states,
                                    std::size_t body, double reach_m) {
  std::vector<ContactSite> sites;
  ForEachJoint(scene, states, body, [&](const Held& held) { held.AppendSites(reach_m, sites); });
  return sites;
}

bool JointsLetMeet(const Scene& scene, std::span<const BodyState> states, std::size_t body,
                   const ContactSite& site) {
  bool meets = true;
  const Vec3 point_W = states[body].pose * site.p_B - site.radius * site.normal;
  ForEachJoint(scene, states, body, [&](const Held& held) {
    if (held.to_fixed(scene) && std::abs(held.Approach(point_W, site.normal)) < kAcross) {
      meets = false;
    }
  });
  return meets;
}

JointResistance ResistanceOfJoints(const Scene& scene, std::span<const BodyState> states,
                                   std::size_t body, double steady_s) {
  JointResistance sum;
  ForEachJoint(scene, states, body, [&](const Held& held) { held.Resist(steady_s, sum); });
  return sum;
}

}  // namespace rikiseki::world
