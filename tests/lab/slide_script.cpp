// SPDX-License-Identifier: MIT
#include "tests/lab/slide_script.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rikiseki::lab {
namespace {

constexpr double kApproach = 0.005;      // m, between finger and surface at the start
constexpr double kApproachSpeed = 0.05;  // m/s
constexpr double kRest = 0.6;            // s, pressed in: the slowest frame has come and been shown
constexpr double kAway = 0.2;            // s, after the slide
constexpr double kSphereRadius = 0.03;   // m
constexpr double kTurns = 2;
constexpr double kBoxHalf = 0.1;    // m; the top face is at z = 0, the edge at x = 0
constexpr double kOnTop = 0.09;     // m, way over the face before the edge
constexpr double kBeyond = 0.09;    // m, way after it
constexpr double kFreeHalf = 0.03;  // m
constexpr double kFreeWay = 0.06;   // m, of the finger that pushes the free block

// How far the finger's centre is from the surface that it slides on.
double Height(const Slide& slide) {
  return kSlideRadius - slide.depth_m;
}

double PressedAt(const Slide& slide) {
  return (kApproach + slide.depth_m) / kApproachSpeed;
}

double Corner(const Slide& slide) {
  return slide.script == SlideScript::kRound ? std::numbers::pi / 2 * Height(slide) : 0;
}

double Way(const Slide& slide) {
  switch (slide.script) {
    case SlideScript::kSphere:
      return kTurns * 2 * std::numbers::pi * (kSphereRadius + Height(slide));
    case SlideScript::kFree:
      return kFreeWay;
    default:
      return kOnTop + Corner(slide) + kBeyond;
  }
}

// `gone` along the way, `above` the height at which the way lies.
Vec3 OnSphere(const Slide& slide, double gone, double above) {
  const double radius = kSphereRadius + Height(slide);
  const double angle = gone / radius;
  // In a plane that is none of the axes'.
  const Vec3 a = Vec3(1, 0, 0);
  const Vec3 b = Vec3(0, 0.6, 0.8);
  return (radius + above) * (std::cos(angle) * a + std::sin(angle) * b);
}

Vec3 OnBox(const Slide& slide, double gone, double above) {
  const double height = Height(slide);
  const double past = gone - kOnTop;  // the edge
  if (slide.script == SlideScript::kEdge || past <= 0) return {past, 0.01, height + above};
  const double corner = Corner(slide);
  if (past >= corner) return {height, 0.01, corner - past};
  const double angle = past / height;
  return {height * std::sin(angle), 0.01, height * std::cos(angle)};
}

world::SceneBody Body(const char* name, const world::Shape& shape, const Slide& slide) {
  world::SceneBody body;
  body.name = name;
  body.fixed = true;
  body.colliders.push_back({.shape = shape, .friction = slide.friction});
  return body;
}

}  // namespace

double SlideStart(const Slide& slide) {
  return slide.script == SlideScript::kFree ? 0 : PressedAt(slide) + kRest;
}

double SlideEnd(const Slide& slide) {
  return SlideStart(slide) + Way(slide) / kSlideSpeed;
}

double Duration(const Slide& slide) {
  return SlideEnd(slide) + kAway;
}

Vec3 FingerPosition(const Slide& slide, double t_s) {
  const double way = Way(slide);
  const double gone = std::clamp((t_s - SlideStart(slide)) * kSlideSpeed, 0.0, way);
  if (slide.script == SlideScript::kFree) {
    return {gone - kFreeHalf - kSlideRadius - kApproach, 0, 0};
  }
  const double above =
      std::max(0.0, kApproach + slide.depth_m - std::max(t_s, 0.0) * kApproachSpeed);
  return slide.script == SlideScript::kSphere ? OnSphere(slide, gone, above)
                                              : OnBox(slide, gone, above);
}

double FreeInertia() {
  return kFreeMass * 2 * kFreeHalf * kFreeHalf / 3;
}

world::Scene SlideScene(const Slide& slide) {
  world::Scene scene;
  scene.name = "slide";
  switch (slide.script) {
    case SlideScript::kSphere:
      scene.bodies.push_back(Body("sphere", world::Sphere{kSphereRadius}, slide));
      break;
    case SlideScript::kFree: {
      world::SceneBody block = Body("block", world::Box{Vec3::Constant(kFreeHalf)}, slide);
      block.fixed = false;
      block.mass_kg = kFreeMass;
      block.inertia = Mat3::Identity() * FreeInertia();
      scene.bodies.push_back(block);
      scene.gravity.setZero();
      break;
    }
    default: {
      world::SceneBody box = Body("box", world::Box{Vec3::Constant(kBoxHalf)}, slide);
      box.pose_WB.position = Vec3(-kBoxHalf, 0, -kBoxHalf);
      scene.bodies.push_back(box);
      break;
    }
  }
  return scene;
}

}  // namespace rikiseki::lab
