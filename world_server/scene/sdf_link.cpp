// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_link.h"

#include "world_server/scene/sdf_complaints.h"
#include "world_server/scene/sdf_element.h"
#include "world_server/scene/sdf_extensions.h"

namespace rikiseki::world {

Pose Resolve(const sdf::SemanticPose& semantic, const sdf::ElementPtr& element) {
  ignition::math::Pose3d pose;
  const sdf::Errors errors = semantic.Resolve(pose);
  if (!errors.empty()) Refuse(element, OneLine(errors.front().Message()));
  if (!pose.IsFinite()) Refuse(element, "a pose of finite numbers is expected");
  return FromSdf(pose);
}

Shape ReadPrimitive(const sdf::Collision& collision) {
  const sdf::Geometry& geometry = *collision.Geom();
  const sdf::ElementPtr at = collision.Element()->HasElement("geometry")
                                 ? collision.Element()->GetElement("geometry")
                                 : collision.Element();
  switch (geometry.Type()) {
    case sdf::GeometryType::BOX: {
      const Vec3 size = FromSdf(geometry.BoxShape()->Size());
      for (const double edge : size) Positive(at, "an edge of the box", edge);
      return Box{size / 2};
    }
    case sdf::GeometryType::SPHERE:
      return Sphere{Positive(at, "the radius", geometry.SphereShape()->Radius())};
    case sdf::GeometryType::PLANE: {
      const Vec3 normal = FromSdf(geometry.PlaneShape()->Normal());
      Positive(at, "the length of the normal", normal.norm());
      return HalfSpace{normal.normalized()};
    }
    case sdf::GeometryType::CYLINDER: {
      const sdf::Cylinder& cylinder = *geometry.CylinderShape();
      return Cylinder{Positive(at, "the radius", cylinder.Radius()),
                      Positive(at, "the length", cylinder.Length()) / 2};
    }
    case sdf::GeometryType::CAPSULE: {
      const sdf::Capsule& capsule = *geometry.CapsuleShape();
      return Capsule{Positive(at, "the radius", capsule.Radius()),
                     Positive(at, "the length", capsule.Length()) / 2};
    }
    case sdf::GeometryType::ELLIPSOID: {
      const Vec3 radii = FromSdf(geometry.EllipsoidShape()->Radii());
      for (const double radius : radii) Positive(at, "a radius", radius);
      return Ellipsoid{radii};
    }
    default:
      Refuse(at,
             "a collision may be a box, sphere, plane, cylinder, capsule, ellipsoid or mesh; give "
             "a heightmap or polyline as a mesh (OBJ, STL or DAE)");
  }
}

void ReadInertia(const sdf::Link& link, SceneBody& body, std::vector<std::string>& warnings) {
  const auto mass = FindExplicit(link.Element(), {"inertial", "mass"});
  const sdf::ElementPtr at = mass ? mass : link.Element();
  if (!FindExplicit(link.Element(), {"inertial"})) {
    warnings.push_back(PlaceOf(at) + ": link " + body.name +
                       " has no <inertial>: SDF's default, 1 kg and 1 kg m^2, is used");
  }
  const auto& matrix = link.Inertial().MassMatrix();
  body.mass_kg = Positive(at, "the mass of link " + body.name, matrix.Mass());
  if (!matrix.IsPositive() || !matrix.IsValid()) {
    Refuse(at,
           "the inertia of link " + body.name +
               " belongs to no body: its principal moments must be above 0, and none larger than "
               "the sum of the other two");
  }
  const auto moi = link.Inertial().Moi();  // about the centre of mass, along the link's axes
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      body.inertia(static_cast<int>(row), static_cast<int>(column)) = moi(row, column);
    }
  }
}

void ReadForces(const sdf::Link& link, const sdf::Model& model, const Vec3& wind, SceneBody& body,
                std::vector<std::string>& warnings) {
  const auto gravity = FindExplicit(link.Element(), {"gravity"});
  body.falls = !gravity || gravity->Get<bool>();
  ReadLinkExtensions(link.Element(), body);
  for (const char* name : {"linear", "angular"}) {
    const auto decay = FindExplicit(link.Element(), {"velocity_decay", name});
    if (decay && decay->Get<double>() != 0) {
      warnings.push_back(PlaceOf(decay) +
                         ": <velocity_decay> means another thing in each engine and is not used; "
                         "<rikiseki:" +
                         (name[0] == 'l' ? "drag" : "angular_drag") +
                         "> of the link says it in units");
    }
  }
  if (!model.EnableWind() && !link.EnableWind()) return;
  body.wind = wind;
  if (wind.isZero() || body.drag_ns_per_m > 0) return;
  warnings.push_back(PlaceOf(link.Element()) + ": the wind does not act on link " + body.name +
                     ", which has no <rikiseki:drag>");
}

}  // namespace rikiseki::world
