// SPDX-License-Identifier: MIT
#include "common/body_step.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rikiseki {
namespace {

constexpr int kSweeps = 50;
constexpr double kSettled = 1e-10;  // m/s
constexpr double kNoSlip = 1e-9;    // m/s: slower has no direction

// Where an impulse enters a body; none of them is what does not yield.
struct Entry {
  double inverse_mass = 0;
  Vec3 arm = Vec3::Zero();
  const Mat3* inverse_inertia = nullptr;  // in W
};

// One direction of one contact or spring. Without initial values: a step has room for many and uses
// few.
struct Row {
  Vec3 direction;
  Vec3 turn_body, turn_other;  // arm x direction
  Vec3 spin_body, spin_other;  // I^-1 (arm x direction)
  double yield;                // m/s per N s
};

struct Rows {
  Row normal, slip_1, slip_2;  // the latter two only where there is friction
  double bounce;               // m/s, that the normal velocity must reach
  double impulse_1, impulse_2;
};

struct Island {
  std::span<StepBody> bodies;
  std::array<Mat3, kMaxStepBodies> inverse_inertia;

  explicit Island(std::span<StepBody> all) : bodies(all) {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      inverse_inertia[i] = bodies[i].inertia.InverseInertia(bodies[i].state.pose.orientation);
    }
  }

  Entry At(std::size_t body, const Vec3& point_W) const {
    return {1 / bodies[body].inertia.mass_kg, point_W - bodies[body].state.pose.position,
            &inverse_inertia[body]};
  }
};

struct PlaneNow {
  Vec3 point_W;  // of the body
  Vec3 normal_W;
  double gap;  // m
};

PlaneNow Locate(std::span<const StepBody> bodies, const StepContact& contact) {
  const Pose& pose_WB = bodies[contact.body].state.pose;
  const bool fixed = contact.other == StepContact::kSurroundings;
  PlaneNow now;
  now.normal_W =
      fixed ? contact.normal : Vec3(bodies[contact.other].state.pose.orientation * contact.normal);
  const Vec3 plane_W = fixed ? contact.point : bodies[contact.other].state.pose * contact.point;
  now.point_W = pose_WB * contact.p_B - contact.radius * now.normal_W;
  now.gap = (now.point_W - plane_W).dot(now.normal_W);
  return now;
}

// The tangential velocity [m/s] of the body's point over the plane.
Vec3 Slip(std::span<const StepBody> bodies, const StepContact& contact, const PlaneNow& now) {
  Vec3 slip = bodies[contact.body].state.VelocityAt(now.point_W) - contact.velocity;
  if (contact.other != StepContact::kSurroundings) {
    slip -= bodies[contact.other].state.VelocityAt(now.point_W);
  }
  return slip - slip.dot(now.normal_W) * now.normal_W;
}

Row MakeRow(const Entry& body, const Entry& other, const Vec3& direction) {
  Row row;
  row.direction = direction;
  row.turn_body = body.arm.cross(direction);
  row.spin_body = *body.inverse_inertia * row.turn_body;
  row.yield = body.inverse_mass + row.turn_body.dot(row.spin_body);
  if (other.inverse_inertia != nullptr) {
    row.yield += other.inverse_mass;
    row.turn_other = other.arm.cross(direction);
    row.spin_other = *other.inverse_inertia * row.turn_other;
    row.yield += row.turn_other.dot(row.spin_other);
  }
  return row;
}

Vec3 AcrossTo(const Vec3& normal) {
  const Vec3 axis = std::abs(normal.x()) < 0.7 ? Vec3::UnitX() : Vec3::UnitY();
  return axis.cross(normal).normalized();
}

// The relative velocity along a row.
inline double Speed(std::span<const StepBody> bodies, const StepContact& contact, const Row& row) {
  const BodyState& a = bodies[contact.body].state;
  double speed = a.velocity.dot(row.direction) + a.angular_velocity.dot(row.turn_body);
  if (contact.other == StepContact::kSurroundings) {
    speed -= contact.velocity.dot(row.direction);
  } else {
    const BodyState& b = bodies[contact.other].state;
    speed -= b.velocity.dot(row.direction) + b.angular_velocity.dot(row.turn_other);
  }
  return speed;
}

inline void Push(std::span<StepBody> bodies, const StepContact& contact, const Row& row,
                 double impulse) {
  StepBody& a = bodies[contact.body];
  a.state.velocity += impulse / a.inertia.mass_kg * row.direction;
  a.state.angular_velocity += impulse * row.spin_body;
  if (contact.other == StepContact::kSurroundings) return;
  StepBody& b = bodies[contact.other];
  b.state.velocity -= impulse / b.inertia.mass_kg * row.direction;
  b.state.angular_velocity -= impulse * row.spin_other;
}

// A gap may close within the step, a shallow penetration opens by a fifth.
double WantedSpeed(double gap, double step_s) {
  if (gap >= 0) return -gap / step_s;
  return gap > -kDeepPenetration ? -kPenetrationRecovery * gap / step_s : 0;
}

void MakeRows(const Island& island, const StepContact& contact, double step_s, Rows& rows) {
  const PlaneNow now = Locate(island.bodies, contact);
  const Entry body = island.At(contact.body, now.point_W);
  const Entry other =
      contact.other == StepContact::kSurroundings ? Entry{} : island.At(contact.other, now.point_W);
  const Vec3 slip = Slip(island.bodies, contact, now);
  const double slip_speed = slip.norm();
  const Vec3 along = slip_speed > kNoSlip ? Vec3(slip / slip_speed) : AcrossTo(now.normal_W);

  rows.normal = MakeRow(body, other, now.normal_W);
  rows.bounce = WantedSpeed(now.gap, step_s);
  rows.impulse_1 = rows.impulse_2 = 0;
  if (contact.friction > 0) {
    rows.slip_1 = MakeRow(body, other, along);
    rows.slip_2 = MakeRow(body, other, now.normal_W.cross(along));
  }
}

// Returns the change of velocity [m/s] that it made.
double SweepNormal(std::span<StepBody> bodies, StepContact& contact, const Rows& rows) {
  const double speed = Speed(bodies, contact, rows.normal);
  const double impulse =
      std::max(0.0, contact.normal_impulse - (speed - rows.bounce) / rows.normal.yield);
  const double change = impulse - contact.normal_impulse;
  contact.normal_impulse = impulse;
  Push(bodies, contact, rows.normal, change);
  return std::abs(change) * rows.normal.yield;
}

double SweepFriction(std::span<StepBody> bodies, const StepContact& contact, Rows& rows) {
  if (!(contact.friction > 0)) return 0;
  double wanted_1 = rows.impulse_1 - Speed(bodies, contact, rows.slip_1) / rows.slip_1.yield;
  double wanted_2 = rows.impulse_2 - Speed(bodies, contact, rows.slip_2) / rows.slip_2.yield;
  const double limit = contact.friction * contact.normal_impulse;
  // Well inside the cone, squares tell; hypot costs as much as all the rest of a sweep.
  if (!(wanted_1 * wanted_1 + wanted_2 * wanted_2 < 0.99 * limit * limit)) {
    const double length = std::hypot(wanted_1, wanted_2);
    if (length > limit) {
      wanted_1 *= limit / length;
      wanted_2 *= limit / length;
    }
  }
  const double change_1 = wanted_1 - rows.impulse_1;
  const double change_2 = wanted_2 - rows.impulse_2;
  rows.impulse_1 = wanted_1;
  rows.impulse_2 = wanted_2;
  Push(bodies, contact, rows.slip_1, change_1);
  Push(bodies, contact, rows.slip_2, change_2);
  return std::max(std::abs(change_1) * rows.slip_1.yield, std::abs(change_2) * rows.slip_2.yield);
}

double SweepSpring(std::span<StepBody> bodies, StepSpring& spring, const Row& row) {
  StepBody& body = bodies[spring.body];
  const double speed =
      body.state.velocity.dot(row.direction) + body.state.angular_velocity.dot(row.turn_body);
  // impulse = base + per_speed (speed + yield * before - yield * impulse), solved for impulse.
  const double wanted =
      (spring.base_ns + spring.per_speed_kg * (speed + row.yield * spring.impulse_ns)) /
      (1 + spring.per_speed_kg * row.yield);
  const double impulse = std::max(0.0, wanted);
  const double change = impulse - spring.impulse_ns;
  spring.impulse_ns = impulse;
  body.state.velocity -= change / body.inertia.mass_kg * row.direction;
  body.state.angular_velocity -= change * row.spin_body;
  return std::abs(change) * row.yield;
}

}  // namespace

void SolveVelocities(std::span<StepBody> bodies, std::span<StepContact> contacts,
                     std::span<StepSpring> springs, double step_s) noexcept {
  const Island island(bodies);
  for (StepBody& body : bodies) {
    body.state.velocity += step_s * body.acceleration;
    body.state.angular_velocity += step_s * body.angular_acceleration;
  }
  std::array<Rows, kMaxStepContacts> rows;
  std::array<Row, kMaxStepSprings> spring_rows;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    MakeRows(island, contacts[i], step_s, rows[i]);
  }
  for (std::size_t i = 0; i < springs.size(); ++i) {
    spring_rows[i] =
        MakeRow(island.At(springs[i].body, springs[i].point_W), Entry{}, springs[i].normal);
    springs[i].impulse_ns = 0;
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].normal_impulse > 0) {
      Push(bodies, contacts[i], rows[i].normal, contacts[i].normal_impulse);
    }
  }
  if (contacts.empty() && springs.empty()) return;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double change = 0;
    for (std::size_t i = 0; i < springs.size(); ++i) {
      change = std::max(change, SweepSpring(bodies, springs[i], spring_rows[i]));
    }
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      change = std::max(change, SweepNormal(bodies, contacts[i], rows[i]));
    }
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      change = std::max(change, SweepFriction(bodies, contacts[i], rows[i]));
    }
    if (!(change > kSettled)) break;
  }
}

void StepBodies(std::span<StepBody> bodies, std::span<StepContact> contacts, double step_s,
                PositionRule rule) noexcept {
  std::array<Vec3, kMaxStepBodies> before;
  for (std::size_t i = 0; i < bodies.size(); ++i) before[i] = bodies[i].state.velocity;
  SolveVelocities(bodies, contacts, {}, step_s);

  std::array<PushingContacts, kMaxStepBodies> pushing;
  std::array<Vec3, kMaxStepBodies> mend;
  mend.fill(Vec3::Zero());
  for (const StepContact& contact : contacts) {
    const PlaneNow now = Locate(bodies, contact);
    if (contact.normal_impulse > 0 && rule == PositionRule::kSecondOrder) {
      const double slip_speed = Slip(bodies, contact, now).norm();
      pushing[contact.body].Add(now.normal_W, slip_speed);
      if (contact.other != StepContact::kSurroundings) {
        pushing[contact.other].Add(now.normal_W, slip_speed);
      }
    }
    if (now.gap <= -kDeepPenetration) {
      Vec3& way = mend[contact.body];
      const double missing = -kPenetrationRecovery * now.gap - way.dot(now.normal_W);
      if (missing > 0) way += missing * now.normal_W;
    }
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    BodyState& state = bodies[i].state;
    Vec3 shift = step_s * state.velocity + mend[i];
    if (rule == PositionRule::kSecondOrder) {
      shift -= step_s / 2 * pushing[i].HalfAct(state.velocity - before[i]);
    }
    state.pose.position += shift;
    AdvanceRotation(bodies[i].inertia, step_s, state);
  }
  for (StepContact& contact : contacts) {
    if (contact.other == StepContact::kSurroundings) contact.point += step_s * contact.velocity;
  }
}

int SubstepCount(double time_s, double longest_s) noexcept {
  const double count = std::ceil(time_s / longest_s - 0.25);
  return count > 1 ? static_cast<int>(std::min(count, 1e6)) : 1;  // 1 for what is no number
}

double InverseEffectiveMass(const BodyInertia& inertia, const Pose& pose_WB, const Vec3& point_W,
                            const Vec3& direction) noexcept {
  const Mat3 inverse = inertia.InverseInertia(pose_WB.orientation);
  const Entry entry{1 / inertia.mass_kg, point_W - pose_WB.position, &inverse};
  return MakeRow(entry, Entry{}, direction).yield;
}

}  // namespace rikiseki
