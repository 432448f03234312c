// The joints of a scene within Bullet's substep. Bullet's solver has them as rows among the contacts,
// so that contacts know what the jointed body can do; what it found for the joints is then taken
// out again, and the linkage (linkage.h) moves the bodies instead, exactly.
//
// In the order of a substep: BeginSubstep, Bullet, EndSubstep. Jointed bodies and their neighbours
// in a linkage sleep and wake together: Bullet's islands see the rows.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "world_server/physics/bullet_hooks.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class BulletJoints {
 public:
  /// A body of the scene in the engine.
  struct Place {
    HookedBody* hooked = nullptr;  // null if it is fixed
    Quat q_BP = Quat::Identity();  // the engine's axes in the body's
  };

  /// `places` go with the scene's bodies; what they point to and `world` outlive this. Every
  /// collision object's user index 2 is its body in the scene. Pairs of bodies that do not collide
  /// (Collide(scene, a, b)) ignore each other from here on.
  BulletJoints(const Scene& scene, std::vector<Place> places, btDiscreteDynamicsWorld& world);
  ~BulletJoints();

  bool empty() const { return joined_.empty(); }

  /// What is left of velocities that changed from outside: after kicks. Wakes whom they move.
  void ProjectVelocities();

  /// After the drag, before Bullet's substep.
  void BeginSubstep(double step_s);

  /// After the hooks' EndSubstep, which leaves jointed bodies to this.
  void EndSubstep(double step_s);

 private:
  struct Joined;

  void IgnorePairs(const Scene& scene);
  void Read(const Joined& joined, std::span<BodyState> states) const;
  void WriteVelocities(const Joined& joined, std::span<const BodyState> states);
  bool Wakes(const Joined& joined);
  void FindTouched();

  std::vector<Place> places_;
  btDiscreteDynamicsWorld& world_;
  std::vector<std::unique_ptr<Joined>> joined_;
  std::vector<Joined*> joined_of_;  // of the scene's bodies; null without a joint
};

}  // namespace rikiseki::world
