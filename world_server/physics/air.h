// SPDX-License-Identifier: MIT
// The drag of the air on a body, linear in its speed against the wind.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/rigid_body.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct AirDrag {
  double drag_ns_per_m = 0;
  double angular_drag_nms = 0;
  Vec3 wind = Vec3::Zero();  // m/s

  static AirDrag On(const SceneBody& body) {
    return {body.drag_ns_per_m, body.angular_drag_nms, body.wind};
  }
  bool acts() const { return drag_ns_per_m > 0 || angular_drag_nms > 0; }

  /// 1/s, how fast it slows the body, or its turning.
  double Rate(const BodyInertia& inertia) const {
    return std::max(drag_ns_per_m / inertia.mass_kg,
                    angular_drag_nms * inertia.inverse_B.diagonal().maxCoeff());
  }

  /// What it does to velocities in a substep: the linear part exact for any step, the angular one
  /// implicit, so that neither turns a body back however strong it is.
  void Act(const BodyInertia& inertia, double step_s, BodyState& state) const {
    if (drag_ns_per_m > 0) {
      const double keeps = std::exp(-drag_ns_per_m / inertia.mass_kg * step_s);
      state.velocity = wind + keeps * (state.velocity - wind);
    }
    if (angular_drag_nms > 0) {
      const Mat3 yields = Mat3::Identity() + step_s * angular_drag_nms *
                                                 inertia.InverseInertia(state.pose.orientation);
      state.angular_velocity = yields.inverse() * state.angular_velocity;
    }
  }

  /// m/s^2 and rad/s^2 at this state, for who integrates them as constants.
  Vec3 Acceleration(const BodyInertia& inertia, const BodyState& state) const {
    return drag_ns_per_m / inertia.mass_kg * (wind - state.velocity);
  }
  Vec3 AngularAcceleration(const BodyInertia& inertia, const BodyState& state) const {
    return -angular_drag_nms *
           (inertia.InverseInertia(state.pose.orientation) * state.angular_velocity);
  }
};

}  // namespace rikiseki::world
