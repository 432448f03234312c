// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_joint.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "world_server/scene/sdf_element.h"

namespace rikiseki::world {
namespace {

constexpr double kUnlimited = 1e10;  // rad or m: SDF's word for no limit is 1e16

// None for a fixed one.
std::optional<Joint::Type> TypeOf(const sdf::Joint& joint) {
  switch (joint.Type()) {
    case sdf::JointType::FIXED:
      return std::nullopt;
    case sdf::JointType::REVOLUTE:
    case sdf::JointType::CONTINUOUS:
      return Joint::Type::kRevolute;
    case sdf::JointType::PRISMATIC:
      return Joint::Type::kPrismatic;
    case sdf::JointType::BALL:
      return Joint::Type::kBall;
    default:
      Refuse(joint.Element(),
             "joint " + joint.Name() + " of type " + joint.Element()->Get<std::string>("type") +
                 " is not built; fixed, revolute, continuous, prismatic and ball are. Two revolute "
                 "joints with a link between them do what universal and revolute2 do");
  }
}

double NotNegative(const sdf::ElementPtr& at, const std::string& what, double value) {
  if (!std::isfinite(value) || value < 0) {
    Refuse(at, what + " = " + std::to_string(value) + ": 0 or more is expected");
  }
  return value;
}

// Limits, damping and friction.
void ReadAxis(const sdf::Joint& sdf_joint, const sdf::JointAxis& axis, Joint& joint) {
  const sdf::ElementPtr at = sdf_joint.Element()->GetElement("axis");
  if (sdf_joint.Type() != sdf::JointType::CONTINUOUS) {
    if (axis.Lower() > -kUnlimited) joint.lower = axis.Lower();
    if (axis.Upper() < kUnlimited) joint.upper = axis.Upper();
    if (!(joint.lower <= 0 && joint.upper >= 0)) {
      const auto limit = FindExplicit(at, {"limit"});
      Refuse(limit ? limit : at, "joint " + sdf_joint.Name() + " starts at 0, outside its limits " +
                                     std::to_string(joint.lower) + " .. " +
                                     std::to_string(joint.upper) +
                                     "; put the links where the joint may be");
    }
  }
  const std::string of = " of joint " + sdf_joint.Name();
  joint.damping = NotNegative(at, "the damping" + of, axis.Damping());
  joint.friction = NotNegative(at, "the friction" + of, axis.Friction());
}

Quat AlongAxis(const sdf::ElementPtr& at, const ignition::math::Vector3d& axis) {
  const Vec3 direction = FromSdf(axis);
  Positive(at, "the length of <xyz>", direction.norm());
  return Quat::FromTwoVectors(Vec3::UnitZ(), direction);
}

// Type, limits, damping and friction, and what of it is not done.
SdfJoint Begun(const sdf::Joint& joint, const std::string& name,
               std::vector<std::string>& warnings) {
  SdfJoint read;
  read.element = joint.Element();
  read.name = name;
  const std::optional<Joint::Type> type = TypeOf(joint);
  read.fixed = !type;
  if (!type) return read;
  read.joint.name = name;
  read.joint.type = *type;
  const sdf::JointAxis* axis = joint.Axis();
  if (*type == Joint::Type::kBall) {
    if (axis != nullptr) {
      warnings.push_back(PlaceOf(read.element) + ": the <axis> of ball joint " + name +
                         " is not used");
    }
    return read;
  }
  if (axis == nullptr) Refuse(read.element, "joint " + name + " needs an <axis>");
  ReadAxis(joint, *axis, read.joint);
  return read;
}

void RequireResolved(const sdf::ElementPtr& element, const sdf::Errors& errors) {
  if (errors.empty()) return;
  std::string why = errors.front().Message();
  std::replace(why.begin(), why.end(), '\n', ' ');
  Refuse(element, why);
}

}  // namespace

void ReadModelJoints(const sdf::Model& model, const std::string& name, const Pose& pose_WM,
                     std::vector<SdfJoint>& joints, std::vector<std::string>& warnings) {
  for (std::uint64_t i = 0; i < model.JointCount(); ++i) {
    const sdf::Joint& joint = *model.JointByIndex(i);
    SdfJoint read = Begun(joint, name + "::" + joint.Name(), warnings);
    ignition::math::Pose3d pose;
    RequireResolved(read.element, joint.SemanticPose().Resolve(pose, "__model__"));
    if (!pose.IsFinite()) Refuse(read.element, "a pose of finite numbers is expected");
    read.pose_WJ = pose_WM * FromSdf(pose);
    if (!read.fixed && read.joint.type != Joint::Type::kBall) {
      ignition::math::Vector3d axis;
      RequireResolved(read.element, joint.Axis()->ResolveXyz(axis, "__model__"));
      read.pose_WJ.orientation = pose_WM.orientation * AlongAxis(read.element, axis);
    }
    for (std::string* end : {&read.parent, &read.child}) {
      std::string link;
      RequireResolved(read.element, end == &read.parent ? joint.ResolveParentLink(link)
                                                        : joint.ResolveChildLink(link));
      *end = link == "world" ? link : name + "::" + link;
    }
    joints.push_back(std::move(read));
  }
}

std::vector<std::size_t> FollowFixedJoints(const std::vector<SdfJoint>& joints,
                                           std::vector<SdfLink>& links) {
  const std::size_t world = links.size();
  std::vector<std::size_t> root(links.size() + 1);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](std::size_t link) {
    while (root[link] != link) link = root[link];
    return link;
  };
  const auto unite = [&](std::size_t a, std::size_t b) {
    const auto [low, high] = std::minmax({find(a), find(b)});
    high == world ? root[low] = world : root[high] = low;  // the world stays its own root
  };
  const auto place = [&](const std::string& name) {
    const auto link = std::find_if(links.begin(), links.end(),
                                   [&](const SdfLink& other) { return other.name == name; });
    return static_cast<std::size_t>(link - links.begin());  // `world` if it is none of them
  };
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].fixed) unite(i, world);
  }
  for (const SdfJoint& joint : joints) {
    if (joint.fixed) unite(place(joint.parent), place(joint.child));
  }
  std::vector<std::size_t> first(links.size());
  for (std::size_t i = 0; i < links.size(); ++i) {
    links[i].fixed = find(i) == world;
    first[i] = links[i].fixed ? i : find(i);
  }
  return first;
}

SceneBody Merged(const SceneBody& first, const SceneBody& second) {
  SceneBody merged = first;
  merged.mass_kg = first.mass_kg + second.mass_kg;
  merged.pose_WB.position =
      (first.mass_kg * first.pose_WB.position + second.mass_kg * second.pose_WB.position) /
      merged.mass_kg;
  merged.inertia.setZero();
  merged.colliders.clear();
  for (const SceneBody* part : {&first, &second}) {
    const Pose pose = merged.pose_WB.Inverse() * part->pose_WB;  // of the part in the whole
    const Mat3 axes = pose.orientation.toRotationMatrix();
    const Vec3& off = pose.position;
    merged.inertia +=
        axes * part->inertia * axes.transpose() +
        part->mass_kg * (off.squaredNorm() * Mat3::Identity() - off * off.transpose());
    for (Collider collider : part->colliders) {
      collider.pose_BS = pose * collider.pose_BS;
      merged.colliders.push_back(std::move(collider));
    }
  }
  merged.inertia = (merged.inertia + merged.inertia.transpose().eval()) / 2;
  merged.drag_ns_per_m = first.drag_ns_per_m + second.drag_ns_per_m;
  merged.angular_drag_nms = first.angular_drag_nms + second.angular_drag_nms;
  if (merged.wind.isZero()) merged.wind = second.wind;
  merged.self_collides = first.self_collides || second.self_collides;
  return merged;
}

}  // namespace rikiseki::world
