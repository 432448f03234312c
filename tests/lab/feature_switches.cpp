// SPDX-License-Identifier: MIT
#include "tests/lab/feature_switches.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <span>

#include "haptic_server/render/feature_track.h"

namespace rikiseki::lab {
namespace {

// Changes every plane of every frame on its way.
FeatureSwitch::Change EachPlane(std::function<void(protocol::Plane&)> change) {
  return [change](Touch& touch) {
    touch.alter_frame = [change](protocol::WorldFrame& frame) {
      for (protocol::Plane& plane : std::span(frame.planes).first(frame.plane_count)) change(plane);
    };
  };
}

FeatureSwitch::Change All(std::vector<FeatureSwitch::Change> changes) {
  return [changes](Touch& touch) {
    for (const auto& change : changes) change(touch);
  };
}

void NothingMoves(Touch& touch) {
  for (world::SceneBody& body : touch.scene.bodies) {
    body.fixed = true;
    body.softness.reset();  // as a scene's file says: what is static does not deform
  }
}

// The surfaces stay where they were first seen.
void PlanesStay(Touch& touch) {
  NothingMoves(touch);
  const auto first = std::make_shared<protocol::WorldFrame>();
  touch.alter_frame = [first](protocol::WorldFrame& frame) {
    if (first->plane_count == 0) *first = frame;
    frame.plane_count = first->plane_count;
    frame.planes = first->planes;
  };
}

FeatureSwitch::Change FingerFriction(double friction) {
  return [friction](Touch& touch) { touch.world.features.finger_friction = friction; };
}

FeatureSwitch::Change StaticFriction(std::function<std::optional<double>(double)> of_dynamic) {
  return [of_dynamic](Touch& touch) {
    touch.world.features.finger_friction = 0.5;
    for (world::SceneBody& body : touch.scene.bodies) {
      for (world::Collider& collider : body.colliders) {
        collider.static_friction = of_dynamic(collider.friction);
      }
    }
  };
}

FeatureSwitch::Change Coupling(protocol::Coupling coupling) {
  return [coupling](Touch& touch) { touch.world.coupling.coupling = coupling; };
}

FeatureSwitch::Change Rule(PositionRule rule) {
  return [rule](Touch& touch) { touch.haptic.render.position_rule = rule; };
}

FeatureSwitch::Change Display(haptic::DisplayRule rule) {
  return [rule](Touch& touch) { touch.haptic.render.display = rule; };
}

FeatureSwitch::Change Damping(double damping_ns_per_m, bool adhesion) {
  return [=](Touch& touch) {
    touch.haptic.render.damping_ns_per_m = damping_ns_per_m;
    touch.haptic.render.adhesion = adhesion;
  };
}

FeatureSwitch::Change Controller(bool on, double moving_mass_kg) {
  return [=](Touch& touch) {
    touch.haptic.render.damping_ns_per_m = 0;  // there is a leak to brake
    touch.haptic.safety.passivity_controller = on;
    touch.haptic.spidar.moving_mass_kg = moving_mass_kg;  // bounds the brake
  };
}

FeatureSwitch::Change Replay(world::ReplayRule rule) {
  return [rule](Touch& touch) { touch.world.coupling.replay = rule; };
}

FeatureSwitch::Change OwnStiffness(double stiffness_n_per_m, double damping_ns_per_m) {
  return EachPlane([=](protocol::Plane& plane) {
    plane.stiffness = stiffness_n_per_m;
    plane.damping = damping_ns_per_m;
  });
}

FeatureSwitch::Change Recovery(double recovery_s) {
  return EachPlane([=](protocol::Plane& plane) { plane.recovery_s = recovery_s; });
}

// Every plane once more, for a pointer that the display does not have.
void PlanesForAnother(Touch& touch) {
  touch.alter_frame = [](protocol::WorldFrame& frame) {
    const std::uint32_t count = std::min(frame.plane_count, protocol::kMaxPlanes / 2);
    for (std::uint32_t i = 0; i < count; ++i) {
      frame.planes[count + i] = frame.planes[i];
      frame.planes[count + i].pointer = 1;
    }
    frame.plane_count = 2 * count;
  };
}

FeatureSwitch::Change Limits(double force_n, double slew_n_per_s, double speed_m_per_s) {
  return [=](Touch& touch) {
    touch.haptic.safety.force_cap_n = force_n;
    touch.haptic.safety.slew_limit_n_per_s = slew_n_per_s;
    touch.haptic.safety.speed_limit_m_per_s = speed_m_per_s;
  };
}

FeatureSwitch::Change LightDamping(double damping_ns_per_m, double speed_m_per_s) {
  return [=](Touch& touch) {
    touch.haptic.safety.light_damping_ns_per_m = damping_ns_per_m;
    touch.haptic.safety.speed_limit_m_per_s = speed_m_per_s;
  };
}

FeatureSwitch::Change SoftStart(double soft_start_ms) {
  return [=](Touch& touch) { touch.haptic.safety.soft_start_ms = soft_start_ms; };
}

FeatureSwitch::Change EachBody(std::function<void(world::SceneBody&)> change) {
  return [change](Touch& touch) {
    for (world::SceneBody& body : touch.scene.bodies) change(body);
  };
}

FeatureSwitch::Change EachCollider(std::function<void(world::Collider&)> change) {
  return EachBody([change](world::SceneBody& body) {
    for (world::Collider& collider : body.colliders) change(collider);
  });
}

// The engine with all its parts, whatever the scene needs.
void AllParts(Touch& touch) {
  touch.parts = world::EngineParts();
}

FeatureSwitch::Change Without(bool world::EngineParts::*part) {
  return [part](Touch& touch) {
    AllParts(touch);
    (*touch.parts).*part = false;
  };
}

// What is touched, alone and weightless: it meets nothing but the finger, and what is soft that by
// which it is held.
void Alone(Touch& touch) {
  std::vector<world::SceneBody>& bodies = touch.scene.bodies;
  const auto moving = std::find_if(bodies.begin(), bodies.end(),
                                   [](const world::SceneBody& body) { return !body.fixed; });
  const world::SceneBody kept = moving == bodies.end() ? bodies.front() : *moving;
  std::erase_if(bodies,
                [&](const world::SceneBody& body) { return !(kept.softness && body.fixed); });
  bodies.push_back(kept);
  touch.scene.joints.clear();
  touch.scene.gravity.setZero();
}

void Mapped(Touch& touch) {
  touch.haptic.mapping = {.origin_mm = Vec3(10, -20, 30),
                          .rotation_deg = Vec3(0, 0, 30),
                          .motion_scale = 2,
                          .force_scale = 0.5};
}

void ClutchedOnce(Touch& touch) {
  touch.clutches_first = true;
}

void AsItIs(Touch&) {}

}  // namespace

std::vector<FeatureSwitch> FeatureSwitches() {
  constexpr auto kLocal = protocol::Coupling::kLocal;
  constexpr auto kImpulse = protocol::Coupling::kImpulse;
  constexpr auto kTicks = world::ReplayRule::kTicks;
  constexpr auto kLump = world::ReplayRule::kLump;
  constexpr auto kSecondOrder = PositionRule::kSecondOrder;
  constexpr auto kSemiImplicit = PositionRule::kSemiImplicit;
  constexpr auto kInterpolate = haptic::DisplayRule::kInterpolate;
  constexpr auto kHold = haptic::DisplayRule::kHold;
  const auto smooth = EachPlane([](protocol::Plane& plane) {  // the velocities stay
    plane.static_friction = plane.dynamic_friction = 0;
  });
  const auto mobility_not_said = EachPlane([](protocol::Plane& plane) {
    if (plane.inverse_mass > 0) plane.inverse_mass = protocol::kMobilityNotSaid;
  });
  const haptic::RenderSettings usual;
  const auto no_own_stiffness = OwnStiffness(0, 0);  // not said
  using world::EngineParts;
  const auto in_air = EachBody([](world::SceneBody& body) { body.drag_ns_per_m = 1; });
  const auto in_vacuum =
      EachBody([](world::SceneBody& body) { body.drag_ns_per_m = body.angular_drag_nms = 0; });
  const auto restitution = [](double value) {
    return EachCollider([value](world::Collider& collider) { collider.restitution = value; });
  };
  const auto unequal = EachBody([](world::SceneBody& body) { body.inertia(0, 0) *= 1.5; });
  const auto equal = EachBody(
      [](world::SceneBody& body) { body.inertia = body.inertia.trace() / 3 * Mat3::Identity(); });
  const auto frictionless = EachCollider([](world::Collider& collider) { collider.friction = 0; });
  return {
      {"finger friction", FingerFriction(0.5), All({FingerFriction(0.5), smooth}),
       FingerFriction(0), true},
      {"static friction", StaticFriction([](double dynamic) { return 2 * dynamic; }),
       StaticFriction([](double dynamic) { return dynamic; }),
       StaticFriction([](double) { return std::nullopt; }), true},
      {"mapping and clutch", Mapped, ClutchedOnce, AsItIs, true},
      {"local copies", Coupling(kLocal), All({NothingMoves, Coupling(kLocal)}),
       All({NothingMoves, Coupling(kImpulse)}), true},
      {"replay by ticks", Replay(kTicks), All({NothingMoves, Replay(kTicks)}),
       All({NothingMoves, Replay(kLump)}), true},
      {"second-order position", Rule(kSecondOrder), All({Coupling(kImpulse), Rule(kSecondOrder)}),
       All({Coupling(kImpulse), Rule(kSemiImplicit)}), true},
      {"interpolation", All({Coupling(kImpulse), Display(kInterpolate)}),
       All({PlanesStay, Display(kInterpolate)}), All({PlanesStay, Display(kHold)}), true},
      {"damping", All({no_own_stiffness, Damping(5, false)}),
       All({no_own_stiffness, Damping(0, true)}), All({no_own_stiffness, Damping(0, false)}), true},
      {"own stiffness", OwnStiffness(1000, 1),
       OwnStiffness(usual.stiffness_n_per_m, usual.damping_ns_per_m), no_own_stiffness, true},
      {"recovery time", Recovery(0.3), Recovery(haptic::kRecoveryTime), AsItIs, false},
      {"mobility", AsItIs, AsItIs, mobility_not_said, false},
      {"another pointer", PlanesForAnother, PlanesForAnother, AsItIs, false},
      {"passivity controller", Controller(true, 0.03), Controller(true, 0), Controller(false, 0),
       true},
      {"light damping", LightDamping(1, 0.01), LightDamping(1, 3), LightDamping(0, 3), true},
      {"soft start", SoftStart(1000), SoftStart(200), SoftStart(0), true},
      {"air drag", in_air, All({in_vacuum, AllParts}),
       All({in_vacuum, Without(&EngineParts::drag)}), true},
      {"restitution", restitution(0.5), All({restitution(0), AllParts}),
       All({restitution(0), Without(&EngineParts::rebound)}), true},
      {"precession", unequal, All({equal, AllParts}), All({equal, Without(&EngineParts::rotation)}),
       true},
      {"contacts of bodies", AsItIs, All({Alone, AllParts}),
       All({Alone, Without(&EngineParts::contacts)}), true},
      {"friction of bodies", AsItIs, All({frictionless, AllParts}),
       All({frictionless, Without(&EngineParts::friction)}), true},
      {"fast bodies", AllParts, AllParts, Without(&EngineParts::fast_bodies), false},
      {"limits", Limits(0.5, 50, 3), Limits(1e6, 1e9, 1e6), Limits(1e9, 1e15, 1e9), true},
  };
}

}  // namespace rikiseki::lab
