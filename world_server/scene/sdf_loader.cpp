// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_loader.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sdf/sdf.hh>
#include <set>

#include "common/config.h"
#include "protocol/messages.h"
#include "world_server/scene/sdf_complaints.h"
#include "world_server/scene/sdf_element.h"
#include "world_server/scene/sdf_extensions.h"
#include "world_server/scene/sdf_joint.h"
#include "world_server/scene/sdf_link.h"
#include "world_server/scene/sdf_mesh.h"
#include "world_server/scene/sdf_surface.h"
#include "world_server/scene/sdf_survey.h"
#include "world_server/scene/sdf_trimmed.h"

namespace rikiseki::world {
namespace {

// False where there is anything to say.
bool LoadQuietly(const std::string& path, const sdf::ParserConfig& config, sdf::Root& root) {
  const CaptureStandardError captured;
  sdf::Root quiet;
  if (!LoadTrimmed(path, config, quiet) || !captured.empty()) return false;
  root = std::move(quiet);
  return true;
}

// The engine knows one friction and one restitution for a body that moves.
void RequireSameSurface(const sdf::Collision& collision, const std::string& link,
                        const Collider& first, const Collider& collider) {
  const auto require = [&](double given, double before, const std::string& what) {
    if (given == before) return;
    Refuse(collision.Element(),
           "collision " + collision.Name() + " of link " + link + " has another " + what +
               " than the first; give all collisions of a moving link, and of links that are fixed "
               "to it, the same");
  };
  require(collider.friction, first.friction, "friction");
  require(collider.restitution, first.restitution, "restitution");
}

class Loader {
 public:
  Loader(LoadedScene& loaded, const std::string& folder, const Vec3& wind)
      : loaded_(loaded), meshes_(folder, loaded.warnings), wind_(wind) {}

  void ReadWorld(const sdf::World& world) {
    for (std::uint64_t i = 0; i < world.ModelCount(); ++i) {
      FindLinks(*world.ModelByIndex(i), "", Pose{}, /*in_static=*/false);
    }
    const std::vector<std::size_t> first = FollowFixedJoints(joints_, links_);
    body_of_.assign(links_.size(), Joint::kWorld);
    for (std::size_t i = 0; i < links_.size(); ++i) {
      SceneBody body = ReadLink(i);
      if (first[i] != i && body_of_[first[i]] != Joint::kWorld) {
        Merge(i, body, body_of_[first[i]]);
      } else if (!links_[i].fixed || !body.colliders.empty()) {  // else it is only for eyes
        Add(i, std::move(body));
      }
    }
    for (const SdfJoint& joint : joints_) AddJoint(joint);
    RequireShapes();
    CheckSoftLinks();
  }

 private:
  Shape ReadShape(const sdf::Collision& collision, bool is_static) {
    const sdf::Mesh* mesh = collision.Geom()->MeshShape();
    return mesh != nullptr ? meshes_.Read(*mesh, is_static) : ReadPrimitive(collision);
  }

  void FindLinks(const sdf::Model& model, const std::string& prefix, const Pose& pose_WP,
                 bool in_static) {
    const std::string name = prefix + model.Name();
    const bool is_static = in_static || model.Static();
    const Pose pose_WM = pose_WP * Resolve(model.SemanticPose(), model.Element());
    ++models_;
    for (std::uint64_t i = 0; i < model.LinkCount(); ++i) {
      const sdf::Link& link = *model.LinkByIndex(i);
      links_.push_back({.name = name + "::" + link.Name(),
                        .fixed = is_static,
                        .pose_WL = pose_WM * Resolve(link.SemanticPose(), link.Element())});
      sources_.push_back({.link = &link, .model = &model, .number = models_});
    }
    if (!is_static) ReadModelJoints(model, name, pose_WM, joints_, loaded_.warnings);
    for (std::uint64_t i = 0; i < model.ModelCount(); ++i) {
      FindLinks(*model.ModelByIndex(i), name + "::", pose_WM, is_static);
    }
  }

  SceneBody ReadLink(std::size_t place) {
    const auto& [link, model, number] = sources_[place];
    SceneBody body;
    body.name = links_[place].name;
    body.fixed = links_[place].fixed;
    Pose pose_LB;  // the link's axes, at its centre of mass
    if (!body.fixed) {
      ReadInertia(*link, body, loaded_.warnings);
      pose_LB.position = FromSdf(link->Inertial().Pose().Pos());
      ReadForces(*link, *model, wind_, body, loaded_.warnings);
      if (model->LinkCount() > 1) body.model = number;
      const auto self_collide = FindExplicit(link->Element(), {"self_collide"});
      body.self_collides = model->SelfCollide() || (self_collide && self_collide->Get<bool>());
    }
    body.pose_WB = links_[place].pose_WL * pose_LB;
    for (std::uint64_t i = 0; i < link->CollisionCount(); ++i) {
      const sdf::Collision& collision = *link->CollisionByIndex(i);
      Collider collider;
      collider.shape = ReadShape(collision, body.fixed);
      if (!body.fixed && std::holds_alternative<HalfSpace>(collider.shape)) {
        Refuse(collision.Element(),
               "link " + body.name + " can move and has a plane; planes belong to static models");
      }
      collider.pose_BS = pose_LB.Inverse() * Resolve(collision.SemanticPose(), collision.Element());
      ReadSurface(collision.Element(), collider, loaded_.warnings);
      if (!body.fixed && i > 0) {
        RequireSameSurface(collision, body.name, body.colliders[0], collider);
      }
      body.colliders.push_back(collider);
    }
    ReadSoftness(link->Element(), body);
    return body;
  }

  void Add(std::size_t place, SceneBody body) {
    if (loaded_.scene.bodies.size() == protocol::kMaxBodies) {
      Refuse(sources_[place].link->Element(),
             "more than " + std::to_string(protocol::kMaxBodies) + " bodies");
    }
    body_of_[place] = loaded_.scene.bodies.size();
    element_of_.push_back(sources_[place].link->Element());
    loaded_.scene.bodies.push_back(std::move(body));
  }

  // A link into the body to which it is fixed.
  void Merge(std::size_t place, const SceneBody& link, std::size_t into) {
    SceneBody& body = loaded_.scene.bodies[into];
    const sdf::Link& source = *sources_[place].link;
    for (const SceneBody* soft : {static_cast<const SceneBody*>(&body), &link}) {
      if (soft->softness) RefuseJointed(source.Element(), soft->name);
    }
    if (link.falls != body.falls) {
      Refuse(source.Element(), "link " + link.name + " is fixed to link " + body.name +
                                   ", and <gravity> acts on one of them only; give both the same");
    }
    if (!link.colliders.empty() && !body.colliders.empty()) {
      RequireSameSurface(*source.CollisionByIndex(0), link.name, body.colliders[0],
                         link.colliders[0]);
    }
    body = Merged(body, link);
    body_of_[place] = into;
  }

  void AddJoint(const SdfJoint& read) {
    if (read.fixed) return;
    Joint joint = read.joint;
    const auto attach = [&](const std::string& end, std::size_t& body, Pose& frame) {
      frame = read.pose_WJ;
      const auto link = std::find_if(links_.begin(), links_.end(),
                                     [&](const SdfLink& other) { return other.name == end; });
      if (link == links_.end()) return false;
      body = body_of_[static_cast<std::size_t>(link - links_.begin())];
      if (body == Joint::kWorld) return false;
      frame = loaded_.scene.bodies[body].pose_WB.Inverse() * read.pose_WJ;
      return !loaded_.scene.bodies[body].fixed;
    };
    const bool parent_moves = attach(read.parent, joint.parent, joint.pose_PJ);
    const bool child_moves = attach(read.child, joint.child, joint.pose_CJ);
    if ((!parent_moves && !child_moves) || joint.parent == joint.child) {
      loaded_.warnings.push_back(PlaceOf(read.element) + ": joint " + read.name +
                                 " connects what cannot move against each other");
      return;
    }
    loaded_.scene.joints.push_back(std::move(joint));
  }

  // What moves without a shape must at least hang on a joint.
  void RequireShapes() const {
    const Scene& scene = loaded_.scene;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      if (!scene.bodies[i].colliders.empty() || IsJointed(scene, i)) continue;
      Refuse(element_of_[i], "link " + scene.bodies[i].name +
                                 " can move and has no collision; give it one, or make its model "
                                 "static");
    }
  }

  void CheckSoftLinks() {
    const Scene& scene = loaded_.scene;
    const auto rigid = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                    [](const auto& body) { return !body.fixed && !body.softness; });
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      const SceneBody& body = scene.bodies[i];
      if (!body.softness) continue;
      if (IsJointed(scene, i)) RefuseJointed(element_of_[i], body.name);
      RequireHeld(element_of_[i], scene, body);
      if (rigid == scene.bodies.end()) continue;
      loaded_.warnings.push_back(PlaceOfSoftness(element_of_[i]) + ": soft link " + body.name +
                                 " and rigid links that move, as " + rigid->name +
                                 ", pass through each other");
    }
  }

  [[noreturn]] static void RefuseJointed(const sdf::ElementPtr& link, const std::string& name) {
    Refuse(link,
           "link " + name +
               " is soft, and a joint holds it; joints hold rigid links only: a soft one is held "
               "by static models that it touches");
  }

  struct Source {
    const sdf::Link* link;
    const sdf::Model* model;
    std::uint32_t number;  // of the model, from 1
  };

  LoadedScene& loaded_;
  SdfMeshes meshes_;
  Vec3 wind_;  // m/s
  std::uint32_t models_ = 0;
  std::vector<SdfLink> links_;
  std::vector<Source> sources_;  // of links_
  std::vector<SdfJoint> joints_;
  std::vector<std::size_t> body_of_;         // of links_; kWorld: none
  std::vector<sdf::ElementPtr> element_of_;  // of the scene's bodies
};

// The files that an element and all in it were read from.
void AddFiles(const sdf::ElementPtr& element, std::set<std::string>& files) {
  files.insert(element->FilePath());
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
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  // Included models are looked up beside the scene, never on the network.
  const std::string folder = std::filesystem::absolute(path).parent_path().string();
  config.AddURIPath("model://", folder);
  config.SetFindCallback([](const std::string&) { return std::string(); });

  sdf::Root root;
  const bool is_loaded = LoadQuietly(path, config, root);
  CaptureStandardError captured;
  const sdf::Errors errors = is_loaded ? sdf::Errors() : root.Load(path, config);
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
  loader.ReadWorld(world);
  if (loaded.scene.bodies.empty()) {
    Refuse(world.Element(),
           "world " + world.Name() + " is empty; at least one model with a collision is expected");
  }
  std::set<std::string> files;
  AddFiles(root.Element(), files);
  std::erase_if(files,
                [](const std::string& name) { return !std::filesystem::is_regular_file(name); });
  for (const SceneBody& body : loaded.scene.bodies) {
    for (const Collider& collider : body.colliders) AddMeshFile(collider.shape, files);
  }
  files.erase(path);
  loaded.files = {path};
  loaded.files.insert(loaded.files.end(), files.begin(), files.end());
  return loaded;
}

}  // namespace rikiseki::world
