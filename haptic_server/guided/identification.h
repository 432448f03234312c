// SPDX-License-Identifier: MIT
// What moves with the grip - mass, damping, dry friction - and how late its forces are, from a record of
// displayed forces and measured positions.
//
// m a + b v + f v/|v| + c = F(t - d) is multiplied by smooth functions that vanish, with their slopes, at
// both ends of a window, and integrated by parts: no derivative of a measured position is left, so that
// rounding to counts hardly biases anything (modulating functions, Shinbrot 1954). Every window of every
// axis gives one equation in m, b, f, c (one per axis: weight) and the change of d.
#pragma once

#include <cstdint>
#include <vector>

#include "common/geometry.h"

namespace rikiseki::haptic {

struct MotionRecord {
  std::int64_t time_ns = 0;
  Vec3 position = Vec3::Zero();  // m, at that time
  Vec3 force = Vec3::Zero();     // N, on the grip, displayed until the next record
};

struct Identified {
  double value = 0;
  double deviation = 0;  // standard
};

struct Identification {
  Identified mass_kg;
  Identified damping_ns_per_m;
  Identified friction_n;
  Identified latency_s;  // from time_ns of a record to when its force acts
  double explained = 0;  // fraction of the force's variance in the windows, 1 = all
};

/// `records` in the order of time. Throws std::invalid_argument if there are too few, or their motion does
/// not tell these apart.
Identification IdentifyDevice(const std::vector<MotionRecord>& records);

}  // namespace rikiseki::haptic
