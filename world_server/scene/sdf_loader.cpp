#include "world_server/scene/sdf_loader.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <regex>
#include <sdf/sdf.hh>
#include <set>
#include <sstream>

#include "common/config.h"
#include "protocol/messages.h"
#include "world_server/scene/sdf_element.h"
#include "world_server/scene/sdf_extensions.h"
#include "world_server/scene/sdf_mesh.h"
#include "world_server/scene/sdf_surface.h"
#include "world_server/scene/sdf_survey.h"

namespace rikiseki::world {
namespace {

// libsdformat and the URDF parser behind it write to std::cerr what their error objects do not
// hold. Collects it, so that a refusal stays one line and still gives the reason.
class CaptureStandardError {
 public:
  CaptureStandardError() : before_(std::cerr.rdbuf(text_.rdbuf())) {}
  ~CaptureStandardError() { std::cerr.rdbuf(before_); }
  CaptureStandardError(const CaptureStandardError&) = delete;
  CaptureStandardError& operator=(const CaptureStandardError&) = delete;

  // What libsdformat said at this level ("Error" or "Warning"), one entry for each message.
  std::vector<std::string> Messages(const std::string& level) const {
    const std::regex colour("\x1b\\[[0-9;]*m");
    const std::regex prefix("^" + level + " \\[[^\\]]*\\]\\s*");
    std::istringstream lines(text_.str());
    std::vector<std::string> messages;
    for (std::string line; std::getline(lines, line);) {
      line = std::regex_replace(line, colour, "");
      std::smatch match;
      if (std::regex_search(line, match, prefix)) messages.push_back(match.suffix());
    }
    return messages;
  }

 private:
  std::ostringstream text_;
  std::streambuf* before_;
};

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

// The line of the last element that fits, or 0.
template <typename Fits>
int LastLine(const sdf::ElementPtr& element, const Fits& fits) {
  int line = fits(element) ? element->LineNumber().value_or(0) : 0;
  for (auto child = element->GetFirstElement(); child; child = child->GetNextElement()) {
    line = std::max(line, LastLine(child, fits));
  }
  return line;
}

// ":line" of what a message is about, as far as it can be told: libsdformat knows no line for what
// it finds out late. Most messages give a name, in brackets or after "named".
std::string LineOf(const std::string& message, const sdf::ElementPtr& root) {
  if (!root) return "";
  const std::regex quoted("\\[([^\\]]+)\\]|named ([^ ]+)");
  for (std::sregex_iterator match(message.begin(), message.end(), quoted), end; match != end;
       ++match) {
    const std::string name = (*match)[1].matched ? (*match)[1] : (*match)[2];
    const int line = LastLine(root, [&](const sdf::ElementPtr& element) {
      return element->HasAttribute("name") && element->Get<std::string>("name") == name;
    });
    if (line > 0) return ":" + std::to_string(line);
  }
  if (message.starts_with("A model must have at least one link")) {
    const int line = LastLine(root, [](const sdf::ElementPtr& element) {
      return element->GetName() == "model" && !element->HasElement("link") &&
             !element->HasElement("model");
    });
    if (line > 0) return ":" + std::to_string(line);
  }
  return "";
}

// The first thing that libsdformat disliked, in one line.
void RefuseErrors(const std::string& path, const sdf::Root& root, const sdf::Errors& errors,
                  const std::vector<std::string>& said) {
  if (errors.empty() && said.empty()) return;
  std::string place = path;
  std::string why = said.empty() ? "" : OneLine(said.front());
  std::smatch match;
  if (!errors.empty() && errors.front().LineNumber()) {
    const sdf::Error& first = errors.front();
    place = first.FilePath().value_or(path) + ":" + std::to_string(*first.LineNumber());
    why = OneLine(first.Message()) + (why.empty() ? "" : ": " + why);
    const std::regex unknown("XML Element\\[(.+)\\], child of element\\[(.+)\\], not defined.*");
    if (std::regex_match(why, match, unknown)) {
      why = "SDFormat has no <" + match[1].str() + "> in <" + match[2].str() +
            ">: correct or remove it";
    }
  } else if (std::regex_search(why, match, std::regex("Error=(\\w+).*Line number=(\\d+)(.*)"))) {
    if (match[2] != "0") place += ":" + match[2].str();
    why = "broken XML, " + match[1].str() + match[3].str();
  } else if (why.empty()) {
    why = OneLine(errors.front().Message());
    place += LineOf(why, root.Element());
    if (errors.front().Code() == sdf::ErrorCode::FILE_READ) why = "this is not an SDFormat file";
  }
  throw ConfigError(place + ": " + why + "; an SDFormat world (sdformat.org) is expected");
}

Pose Resolve(const sdf::SemanticPose& semantic, const sdf::ElementPtr& element) {
  ignition::math::Pose3d pose;
  const sdf::Errors errors = semantic.Resolve(pose);
  if (!errors.empty()) Refuse(element, OneLine(errors.front().Message()));
  if (!pose.IsFinite()) Refuse(element, "a pose of finite numbers is expected");
  return FromSdf(pose);
}

// The engine knows one friction and one restitution for a body that moves.
void RequireSameSurface(const sdf::Collision& collision, const SceneBody& body,
                        const Collider& collider) {
  const auto require = [&](double given, double first, const std::string& what) {
    if (given == first) return;
    Refuse(collision.Element(),
           "collision " + collision.Name() + " of link " + body.name + " has another " + what +
               " than the first; give all collisions of a moving link the same");
  };
  require(collider.friction, body.colliders[0].friction, "friction");
  require(collider.restitution, body.colliders[0].restitution, "restitution");
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
             "a collision may be a box, sphere, plane, cylinder, capsule, ellipsoid or mesh; "
             "heightmaps, polylines and the like are not built");
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

// What the link or its model says of the air and of gravity.
void ReadForces(const sdf::Link& link, const sdf::Model& model, const Vec3& wind, SceneBody& body,
                std::vector<std::string>& warnings) {
  const auto gravity = FindExplicit(link.Element(), {"gravity"});
  body.falls = !gravity || gravity->Get<bool>();
  ReadLinkExtensions(link.Element(), body);
  for (const char* name : {"linear", "angular"}) {
    const auto decay = FindExplicit(link.Element(), {"velocity_decay", name});
    if (decay && decay->Get<double>() != 0) {
      Refuse(decay, std::string("<velocity_decay> means another thing in each engine and is not "
                                "built; <rikiseki:") +
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

class Loader {
 public:
  Loader(LoadedScene& loaded, const std::string& folder, const Vec3& wind)
      : loaded_(loaded), meshes_(folder, loaded.warnings), wind_(wind) {}

  void ReadModel(const sdf::Model& model, const std::string& prefix, const Pose& pose_WP,
                 bool in_static) {
    const std::string name = prefix + model.Name();
    const bool is_static = in_static || model.Static();
    const Pose pose_WM = pose_WP * Resolve(model.SemanticPose(), model.Element());
    for (std::uint64_t i = 0; i < model.LinkCount(); ++i) {
      ReadLink(*model.LinkByIndex(i), model, name, pose_WM, is_static);
    }
    if (!is_static && model.LinkCount() > 1 && !model.SelfCollide()) {
      const auto self_collide = FindExplicit(model.Element(), {"self_collide"});
      if (self_collide) {
        Refuse(self_collide, "<self_collide> false of model " + name +
                                 ": links that pass through each other are not built");
      }
      loaded_.warnings.push_back(PlaceOf(model.Element()) + ": the links of model " + name +
                                 " collide with each other here, which SDF says with "
                                 "<self_collide>true</self_collide>");
    }
    for (std::uint64_t i = 0; i < model.ModelCount(); ++i) {
      ReadModel(*model.ModelByIndex(i), name + "::", pose_WM, is_static);
    }
  }

  /// When all bodies are known.
  void CheckSoftLinks() {
    const Scene& scene = loaded_.scene;
    const auto rigid = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                    [](const auto& body) { return !body.fixed && !body.softness; });
    for (const auto& [place, link] : soft_links_) {
      RequireHeld(link, scene, scene.bodies[place]);
      if (rigid == scene.bodies.end()) continue;
      loaded_.warnings.push_back(PlaceOfSoftness(link) + ": soft link " + scene.bodies[place].name +
                                 " and rigid links that move, as " + rigid->name +
                                 ", pass through each other");
    }
  }

 private:
  Shape ReadShape(const sdf::Collision& collision, bool is_static) {
    const sdf::Mesh* mesh = collision.Geom()->MeshShape();
    return mesh != nullptr ? meshes_.Read(*mesh, is_static) : ReadPrimitive(collision);
  }

  void ReadLink(const sdf::Link& link, const sdf::Model& model, const std::string& model_name,
                const Pose& pose_WM, bool is_static) {
    SceneBody body;
    body.name = model_name + "::" + link.Name();
    body.fixed = is_static;
    if (link.CollisionCount() == 0) {
      if (is_static) return;  // only for eyes
      Refuse(link.Element(), "link " + body.name +
                                 " can move and has no collision; give it one, or make its model "
                                 "static");
    }
    const Pose pose_WL = pose_WM * Resolve(link.SemanticPose(), link.Element());
    Pose pose_LB;  // the link's axes, at its centre of mass
    if (!is_static) {
      ReadInertia(link, body, loaded_.warnings);
      pose_LB.position = FromSdf(link.Inertial().Pose().Pos());
      ReadForces(link, model, wind_, body, loaded_.warnings);
    }
    body.pose_WB = pose_WL * pose_LB;
    for (std::uint64_t i = 0; i < link.CollisionCount(); ++i) {
      const sdf::Collision& collision = *link.CollisionByIndex(i);
      Collider collider;
      collider.shape = ReadShape(collision, is_static);
      if (!is_static && std::holds_alternative<HalfSpace>(collider.shape)) {
        Refuse(collision.Element(),
               "link " + body.name + " can move and has a plane; planes belong to static models");
      }
      collider.pose_BS = pose_LB.Inverse() * Resolve(collision.SemanticPose(), collision.Element());
      ReadSurface(collision.Element(), collider, loaded_.warnings);
      if (!is_static && i > 0) RequireSameSurface(collision, body, collider);
      body.colliders.push_back(collider);
    }
    ReadSoftness(link.Element(), body);
    if (body.softness) soft_links_.emplace_back(loaded_.scene.bodies.size(), link.Element());
    if (loaded_.scene.bodies.size() == protocol::kMaxBodies) {
      Refuse(link.Element(), "more than " + std::to_string(protocol::kMaxBodies) + " bodies");
    }
    loaded_.scene.bodies.push_back(std::move(body));
  }

  LoadedScene& loaded_;
  SdfMeshes meshes_;
  Vec3 wind_;                                                        // m/s
  std::vector<std::pair<std::size_t, sdf::ElementPtr>> soft_links_;  // by place in the scene
};

// The files that an element and all in it were read from.
void AddFiles(const sdf::ElementPtr& element, std::set<std::string>& files) {
  if (std::filesystem::is_regular_file(element->FilePath())) files.insert(element->FilePath());
  for (auto child = element->GetFirstElement(); child; child = child->GetNextElement()) {
    AddFiles(child, files);
  }
}

void AddMeshFile(const Shape& shape, std::set<std::string>& files) {
  if (const auto* hull = std::get_if<Hull>(&shape)) files.insert(hull->file.path);
  if (const auto* mesh = std::get_if<Mesh>(&shape)) files.insert(mesh->file.path);
}

}  // namespace

LoadedScene LoadSdf(const std::string& path) {
  const std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    const int error = file ? EISDIR : errno;
    throw ConfigError(path + ": the scene cannot be read: " + std::strerror(error));
  }
  CaptureStandardError captured;
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  // Included models are looked up beside the scene, never on the network.
  const std::string folder = std::filesystem::absolute(path).parent_path().string();
  config.AddURIPath("model://", folder);
  config.SetFindCallback([](const std::string&) { return std::string(); });

  sdf::Root root;
  const sdf::Errors errors = root.Load(path, config);
  RefuseErrors(path, root, errors, captured.Messages("Error"));
  if (root.WorldCount() != 1) {
    throw ConfigError(path + ": " + std::to_string(root.WorldCount()) +
                      " worlds; exactly one <world> is expected");
  }
  const sdf::World& world = *root.WorldByIndex(0);

  LoadedScene loaded;
  for (const std::string& warning : captured.Messages("Warning")) {
    loaded.warnings.push_back(path + ": " + OneLine(warning));
  }
  SurveyWorld(world.Element(), loaded.warnings);
  loaded.scene.name = world.Name();
  loaded.scene.gravity = FromSdf(world.Gravity());
  if (!loaded.scene.gravity.allFinite()) Refuse(world.Element(), "gravity must be finite");
  const Vec3 wind = FromSdf(world.WindLinearVelocity());
  if (!wind.allFinite()) Refuse(world.Element(), "the wind must be finite");
  Loader loader(loaded, folder, wind);
  for (std::uint64_t i = 0; i < world.ModelCount(); ++i) {
    loader.ReadModel(*world.ModelByIndex(i), "", Pose{}, /*in_static=*/false);
  }
  loader.CheckSoftLinks();
  if (loaded.scene.bodies.empty()) {
    Refuse(world.Element(),
           "world " + world.Name() + " is empty; at least one model with a collision is expected");
  }
  std::set<std::string> files;
  AddFiles(root.Element(), files);
  for (const SceneBody& body : loaded.scene.bodies) {
    for (const Collider& collider : body.colliders) AddMeshFile(collider.shape, files);
  }
  files.erase(path);
  loaded.files = {path};
  loaded.files.insert(loaded.files.end(), files.begin(), files.end());
  return loaded;
}

}  // namespace rikiseki::world
