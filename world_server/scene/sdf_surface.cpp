// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_surface.h"

#include <cmath>

#include "world_server/scene/sdf_element.h"
#include "world_server/scene/sdf_extensions.h"

namespace rikiseki::world {
namespace {

// Stiffer than this no device renders: a file that says 1e12 means "rigid".
constexpr double kLargestStiffness = 1e6;  // N/m
constexpr double kLargestDamping = 1e4;    // N s/m

// SDF's default is 1.
double ReadFriction(const sdf::ElementPtr& collision, std::vector<std::string>& warnings) {
  struct Names {
    const char *engine, *first, *second;
  };
  for (const Names& names : {Names{"ode", "mu", "mu2"}, Names{"bullet", "friction", "friction2"}}) {
    const auto first = FindExplicit(collision, {"surface", "friction", names.engine, names.first});
    const auto second =
        FindExplicit(collision, {"surface", "friction", names.engine, names.second});
    if (!first && !second) continue;
    const sdf::ElementPtr& given = first ? first : second;
    const auto mu = given->Get<double>();
    if (!std::isfinite(mu) || mu < 0) {
      Refuse(given, given->GetName() + " = " + std::to_string(mu) + ": 0 or more is expected");
    }
    if (first && second && second->Get<double>() != mu) {
      const double mean = (mu + second->Get<double>()) / 2;
      warnings.push_back(PlaceOf(second) + ": <" + names.second + "> differs from <" + names.first +
                         ">: friction that depends on direction is not built; their mean, " +
                         std::to_string(mean) + ", acts in all directions");
      return mean;
    }
    return mu;
  }
  return 1;
}

void ReadCompliance(const sdf::ElementPtr& collision, Collider& collider,
                    std::vector<std::string>& warnings) {
  for (const char* engine : {"ode", "bullet"}) {
    const auto kp = FindExplicit(collision, {"surface", "contact", engine, "kp"});
    const auto kd = FindExplicit(collision, {"surface", "contact", engine, "kd"});
    if (!kp) {
      if (kd) warnings.push_back(PlaceOf(kd) + ": <kd> without <kp> is not used");
      continue;
    }
    const double stiffness = Positive(kp, "kp", kp->Get<double>());
    if (stiffness > kLargestStiffness) {
      warnings.push_back(PlaceOf(kp) +
                         ": <kp> above 1e6 N/m can be rendered by no device; the "
                         "haptic server's own stiffness is used");
      return;
    }
    const double damping = kd ? kd->Get<double>() : 0;
    if (!(damping >= 0 && damping <= kLargestDamping)) {
      Refuse(kd, "kd = " + std::to_string(damping) + ": 0 to 1e4 N s/m is expected");
    }
    collider.stiffness_n_per_m = stiffness;
    collider.damping_ns_per_m = damping;
    return;
  }
}

double ReadRestitution(const sdf::ElementPtr& collision) {
  const auto given = FindExplicit(collision, {"surface", "bounce", "restitution_coefficient"});
  if (!given) return 0;
  const auto restitution = given->Get<double>();
  if (!(restitution >= 0 && restitution <= 1)) {
    Refuse(given,
           "restitution_coefficient = " + std::to_string(restitution) + ": 0 to 1 is expected");
  }
  return restitution;
}

}  // namespace

void ReadSurface(const sdf::ElementPtr& collision, Collider& collider,
                 std::vector<std::string>& warnings) {
  collider.friction = ReadFriction(collision, warnings);
  collider.restitution = ReadRestitution(collision);
  ReadCompliance(collision, collider, warnings);
  ReadSurfaceExtensions(collision, collider);
}

}  // namespace rikiseki::world
