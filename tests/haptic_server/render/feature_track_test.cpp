// SPDX-License-Identifier: MIT
#include "haptic_server/render/feature_track.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

protocol::Plane PlaneAt(std::uint32_t feature, const Vec3& point, const Vec3& normal) {
  protocol::Plane plane;
  plane.body = 3;
  plane.generation = 1;
  plane.feature = feature;
  plane.point = ToArray(point);
  plane.normal = ToArray(normal);
  return plane;
}

protocol::WorldFrame Frame(const std::vector<protocol::Plane>& planes,
                           std::uint64_t period_ns = 50'000'000) {
  protocol::WorldFrame frame;
  frame.period_ns = period_ns;
  for (const protocol::Plane& plane : planes) frame.planes[frame.plane_count++] = plane;
  return frame;
}

const LocalBodies kNoCopies(kPeriodNs, 16, 0, PositionRule::kSecondOrder);
const std::array<FingerState, 1> kFarFinger = {FingerState{Vec3(0, 10, 0), 0, 0}};

bool SameBits(const Vec3& a, const Vec3& b) {
  return (a.array() == b.array()).all();
}

const Vec3 kPoint0(0.1, 1.0 / 3, -0.07);
const Vec3 kPoint1(0.1000001, 0.4, 1e-9);
const Vec3 kNormal0 = Vec3(0.3, 0.9, 0.1).normalized();
const Vec3 kNormal1 = Vec3(-0.2, 0.8, 0.5).normalized();

TEST_CASE("interpolation shows prev at j = 0 and last at j = n, bit for bit, and stops there") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(Frame({PlaneAt(1, kPoint0, kNormal0)}), kFarFinger, kNoCopies);
  REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.point, kPoint0));
  REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.normal, kNormal0));
  track.Advance(50);
  track.Receive(Frame({PlaneAt(1, kPoint1, kNormal1)}), kFarFinger, kNoCopies);
  REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.point, kPoint0));
  REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.normal, kNormal0));
  for (int j = 1; j < 50; ++j) {
    track.Advance(1);
    const HalfSpace shown = track.Surfaces(kNoCopies)[0].plane;
    REQUIRE((shown.point - (kPoint0 + j / 50.0 * (kPoint1 - kPoint0))).norm() < 1e-15);
    REQUIRE(shown.normal.norm() == Approx(1).epsilon(1e-15));
    const Vec3 blend = (1 - j / 50.0) * kNormal0 + j / 50.0 * kNormal1;
    REQUIRE((shown.normal - blend.normalized()).norm() < 1e-14);
  }
  for (int j = 50; j < 60; ++j) {
    track.Advance(1);
    REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.point, kPoint1));
    REQUIRE(SameBits(track.Surfaces(kNoCopies)[0].plane.normal, kNormal1));
  }
}

TEST_CASE("an early frame starts from what is displayed now") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(Frame({PlaneAt(1, Vec3(0, 0, 0), kNormal0)}), kFarFinger, kNoCopies);
  track.Advance(50);
  track.Receive(Frame({PlaneAt(1, Vec3(1, 0, 0), kNormal0)}), kFarFinger, kNoCopies);
  track.Advance(20);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(0.4));
  track.Receive(Frame({PlaneAt(1, Vec3(2, 0, 0), kNormal0)}, 10'000'000), kFarFinger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(0.4));
  track.Advance(5);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(1.2));
  track.Advance(3);  // two of them missed
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(1.68));
}

TEST_CASE("a surface's own stiffness and damping change as gradually as its point") {
  const auto surface = [](double stiffness, double damping) {
    protocol::Plane plane = PlaneAt(1, kPoint0, kNormal0);
    plane.stiffness = stiffness;
    plane.damping = damping;
    return Frame({plane});
  };
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(surface(1000, 1), kFarFinger, kNoCopies);
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == 1000);
  track.Advance(50);
  track.Receive(surface(500, 2), kFarFinger, kNoCopies);
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == 1000);
  track.Advance(10);
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == Approx(900));
  CHECK(track.Surfaces(kNoCopies)[0].damping == Approx(1.2));
  track.Receive(surface(600, 2), kFarFinger, kNoCopies);  // early: on from what is shown
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == Approx(900));
  track.Advance(80);
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == 600);
  CHECK(track.Surfaces(kNoCopies)[0].damping == 2);
  // 0 means the haptic side's own, which nothing leads to.
  track.Receive(surface(0, 0), kFarFinger, kNoCopies);
  CHECK(track.Surfaces(kNoCopies)[0].stiffness == 0);
  FeatureTrack hold(DisplayRule::kHold, kPeriodNs);
  hold.Receive(surface(1000, 1), kFarFinger, kNoCopies);
  hold.Receive(surface(500, 1), kFarFinger, kNoCopies);
  CHECK(hold.Surfaces(kNoCopies)[0].stiffness == 500);
}

TEST_CASE("hold and extrapolate follow the newest frame") {
  FeatureTrack hold(DisplayRule::kHold, kPeriodNs);
  FeatureTrack extrapolate(DisplayRule::kExtrapolate, kPeriodNs);
  for (FeatureTrack* track : {&hold, &extrapolate}) {
    track->Receive(Frame({PlaneAt(1, Vec3(0, 0, 0), kNormal0)}), kFarFinger, kNoCopies);
    track->Advance(50);
    track->Receive(Frame({PlaneAt(1, Vec3(0.1, 0, 0), kNormal0)}), kFarFinger, kNoCopies);
    REQUIRE(SameBits(track->Surfaces(kNoCopies)[0].plane.point, Vec3(0.1, 0, 0)));
    track->Advance(25);
  }
  REQUIRE(SameBits(hold.Surfaces(kNoCopies)[0].plane.point, Vec3(0.1, 0, 0)));
  REQUIRE(extrapolate.Surfaces(kNoCopies)[0].plane.point.x() == Approx(0.15));
  extrapolate.Advance(1000);
  REQUIRE(extrapolate.Surfaces(kNoCopies)[0].plane.point.x() == Approx(0.2));  // stops at n
}

TEST_CASE("a world faster than the haptic loop, and a fractional n") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(Frame({PlaneAt(1, Vec3(0, 0, 0), kNormal0)}, 100'000), kFarFinger, kNoCopies);
  track.Advance(1);
  track.Receive(Frame({PlaneAt(1, Vec3(1, 0, 0), kNormal0)}, 2'500'000), kFarFinger, kNoCopies);
  track.Advance(2);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(0.8));
  track.Advance(1);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == 1);
}

TEST_CASE("a ball is shown by the plane tangent to it where the finger is now") {
  constexpr double kRadius = 0.03;
  const Vec3 centre(0.1, -0.2, 0.05);
  const auto ball = [&](const Vec3& direction) {
    const Vec3 normal = direction.normalized();
    protocol::Plane plane = PlaneAt(1, centre + kRadius * normal, normal);
    plane.radius = kRadius;
    return plane;
  };
  for (const DisplayRule rule :
       {DisplayRule::kInterpolate, DisplayRule::kHold, DisplayRule::kExtrapolate}) {
    FeatureTrack track(rule, kPeriodNs);
    track.Receive(Frame({ball({1, 0, 0})}), kFarFinger, kNoCopies);
    for (int tick = 0; tick < 150; ++tick) {
      // Frames tell of the finger's direction long ago, and come early and late.
      if (tick == 40 || tick == 100) {
        track.Receive(Frame({ball({std::cos(0.01 * tick), std::sin(0.01 * tick), 0})}), kFarFinger,
                      kNoCopies);
      }
      const Vec3 direction(std::cos(0.02 * tick), std::sin(0.02 * tick), 0);
      track.MoveFinger(0, centre + 0.038 * direction);
      const HalfSpace shown = track.Surfaces(kNoCopies)[0].plane;
      REQUIRE((shown.normal - direction).norm() < 1e-14);
      REQUIRE((shown.point - (centre + kRadius * direction)).norm() < 1e-15);
      track.Advance(1);
    }
  }

  // The rule moves its centre, from what is shown now on.
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.MoveFinger(0, centre + Vec3(0, 0, 0.04));
  track.Receive(Frame({ball({1, 0, 0})}), kFarFinger, kNoCopies);
  track.Advance(50);
  protocol::Plane moved = ball({0, 1, 0});
  moved.point = ToArray(Vec3(ToVec3(moved.point) + Vec3(0, 0, 0.01)));
  track.Receive(Frame({moved}), kFarFinger, kNoCopies);
  track.Advance(20);
  CHECK(track.Surfaces(kNoCopies)[0].plane.point.z() == Approx(centre.z() + kRadius + 0.004));
  // In its very centre there is a normal all the same.
  track.MoveFinger(0, centre + Vec3(0, 0, 0.004));
  CHECK(track.Surfaces(kNoCopies)[0].plane.normal.norm() == Approx(1));
}

TEST_CASE("a surface that becomes round or flat goes on from what is shown to the finger") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  const std::array<FingerState, 1> finger = {FingerState{Vec3(0.03, 0, 0.038), 0.01, 1}};
  track.MoveFinger(0, finger[0].position);
  protocol::Plane plane = PlaneAt(1, Vec3(0, 0, 0.03), Vec3::UnitZ());
  const auto shown = [&] { return track.Surfaces(kNoCopies)[0].plane; };
  track.Receive(Frame({plane}), finger, kNoCopies);
  track.Advance(50);
  for (const double radius : {0.03, 0.05, 0.0}) {
    const HalfSpace before = shown();
    plane.radius = radius;
    plane.normal = {0, 0.6, 0.8};
    track.Receive(Frame({plane}), finger, kNoCopies);
    const double gap = before.normal.dot(finger[0].position - before.point);
    const HalfSpace after = shown();
    CAPTURE(radius);
    CHECK(after.normal.dot(finger[0].position - after.point) == Approx(gap).margin(1e-12));
    CHECK((after.normal - before.normal).norm() < 1e-12);
    track.Advance(50);
  }
}

TEST_CASE("damaged roundings are ignored") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  for (const double radius : {-1.0, std::nan(""), 1e300}) {
    protocol::Plane plane = PlaneAt(1, kPoint0, kNormal0);
    plane.radius = radius;
    track.Receive(Frame({plane}), kFarFinger, kNoCopies);
    CHECK(track.Surfaces(kNoCopies).empty());
  }
}

TEST_CASE("opposite normals give a finite unit normal at every tick") {
  for (const DisplayRule rule : {DisplayRule::kInterpolate, DisplayRule::kExtrapolate}) {
    FeatureTrack track(rule, kPeriodNs);
    track.Receive(Frame({PlaneAt(1, kPoint0, kNormal0)}), kFarFinger, kNoCopies);
    track.Advance(50);
    track.Receive(Frame({PlaneAt(1, kPoint0, -kNormal0)}), kFarFinger, kNoCopies);
    for (int j = 0; j <= 60; ++j) {
      REQUIRE(track.Surfaces(kNoCopies)[0].plane.normal.norm() == Approx(1).epsilon(1e-14));
      track.Advance(1);
    }
  }
}

TEST_CASE("identity is body, generation, feature and pointer, not the place in the list") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(Frame({PlaneAt(1, Vec3(1, 0, 0), kNormal0), PlaneAt(2, Vec3(2, 0, 0), kNormal0)}),
                kFarFinger, kNoCopies);
  track.Advance(50);
  protocol::Plane reborn = PlaneAt(1, Vec3(5, 0, 0), kNormal0);
  reborn.generation = 2;
  track.Receive(Frame({reborn, PlaneAt(2, Vec3(2.5, 0, 0), kNormal0)}), kFarFinger, kNoCopies);
  const auto shown = track.Surfaces(kNoCopies);
  REQUIRE(shown.size() == 2);
  REQUIRE(shown[0].plane.point.x() == 5);  // a new one starts in its place
  REQUIRE(shown[1].plane.point.x() == 2);  // the old one from where it was
  REQUIRE(track.Has(3, 2, 0));
  REQUIRE(track.Has(3, 1, 0));  // feature 2 still is of generation 1
  track.Receive(Frame({}), kFarFinger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies).empty());
  REQUIRE_FALSE(track.Has(3, 1, 0));
}

TEST_CASE("planes of one identity pair in their order") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  track.Receive(Frame({PlaneAt(0, Vec3(1, 0, 0), kNormal0), PlaneAt(0, Vec3(2, 0, 0), kNormal1)}),
                kFarFinger, kNoCopies);
  track.Receive(Frame({PlaneAt(0, Vec3(3, 0, 0), kNormal0), PlaneAt(0, Vec3(4, 0, 0), kNormal1)}),
                kFarFinger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == 1);
  REQUIRE(track.Surfaces(kNoCopies)[1].plane.point.x() == 2);
}

TEST_CASE("a surface that appears above the finger rises to its place without a jump") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  const Vec3 up = Vec3::UnitY();
  // 8 mm deep with the radius; 1 mm of it was to be expected.
  const std::array<FingerState, 1> finger = {FingerState{Vec3(0, 0.002, 0), 0.01, 0.001}};
  track.Receive(Frame({PlaneAt(1, Vec3::Zero(), up)}), finger, kNoCopies);
  const auto depth = [&] { return track.Surfaces(kNoCopies)[0].plane.point.y() + 0.01 - 0.002; };
  REQUIRE(depth() == Approx(0.001));
  double before = depth();
  for (int k = 1; k <= 100; ++k) {
    if (k == 30) track.Receive(Frame({PlaneAt(1, Vec3::Zero(), up)}), finger, kNoCopies);
    track.Advance(1);
    REQUIRE(depth() > before);
    REQUIRE(depth() - before < 0.007 / 100 * 1.001);
    before = depth();
  }
  REQUIRE(depth() == Approx(0.008));
  track.Receive(Frame({PlaneAt(1, Vec3::Zero(), up), PlaneAt(2, Vec3(0, -0.0071, 0), up)}), finger,
                kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies)[1].plane.point.y() ==
          -0.0071);  // 0.9 mm deep: a normal approach
}

TEST_CASE("a plane may bring a recovery time of its own, and rises within it") {
  for (const double recovery_s : {0.02, 0.5}) {
    FeatureTrack track(DisplayRule::kHold, kPeriodNs);
    protocol::Plane plane = PlaneAt(1, Vec3::Zero(), Vec3::UnitX());
    plane.recovery_s = recovery_s;
    const std::array<FingerState, 1> finger = {FingerState{Vec3(-0.004, 0, 0), 0.001, 0}};
    track.Receive(Frame({plane}), finger, kNoCopies);
    const int ticks = static_cast<int>(recovery_s * 1000);
    for (int k = 0; k <= ticks + 5; ++k) {
      const double left = std::max(0.0, 1 - k / static_cast<double>(ticks));
      REQUIRE(track.Surfaces(kNoCopies)[0].plane.point.x() == Approx(-0.005 * left).margin(1e-15));
      REQUIRE(track.Surfaces(kNoCopies)[0].strength == 1);
      track.Advance(1);
    }
  }
}

TEST_CASE("a surface that vanishes while it is pressed fades where it was, and others go at once") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  protocol::Plane pressed = PlaneAt(1, Vec3(0.003, 0, 0), Vec3::UnitX());
  protocol::Plane slow = PlaneAt(2, Vec3(0.003, 0, 0), Vec3::UnitY());
  slow.recovery_s = 0.4;
  const protocol::Plane free = PlaneAt(3, Vec3(0, 0, -0.02), Vec3::UnitZ());
  const std::array<FingerState, 1> finger = {FingerState{Vec3(0.01, 0.008, 0), 0.01, 1}};
  track.Receive(Frame({pressed, slow, free}), finger, kNoCopies);
  track.Advance(50);
  pressed.point[0] = 0.005;  // on the way there when it vanishes
  track.Receive(Frame({pressed, slow, free}), finger, kNoCopies);
  track.Advance(25);
  track.Receive(Frame({}), finger, kNoCopies);
  REQUIRE_FALSE(track.Has(3, 1, 0));
  for (int k = 0; k < 400; ++k) {
    const auto surfaces = track.Surfaces(kNoCopies);
    REQUIRE(surfaces.size() == (k < 100 ? 2U : 1U));
    if (k < 100) {
      REQUIRE(surfaces[0].feature == 1);
      REQUIRE(surfaces[0].plane.point.x() == Approx(0.004));
      REQUIRE(surfaces[0].strength == Approx(1 - k / 100.0));
    }
    REQUIRE(surfaces.back().feature == 2);
    REQUIRE(surfaces.back().strength == Approx(1 - k / 400.0));
    if (k % 50 == 49) track.Receive(Frame({}), finger, kNoCopies);  // frames go on
    track.Advance(1);
  }
  REQUIRE(track.Surfaces(kNoCopies).empty());
}

TEST_CASE("a surface that comes back while it fades grows strong again without a step") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  const protocol::Plane plane = PlaneAt(1, Vec3(0.003, 0, 0), Vec3::UnitX());
  const std::array<FingerState, 1> finger = {FingerState{Vec3(0.01, 0, 0), 0.01, 1}};
  track.Receive(Frame({plane}), finger, kNoCopies);
  track.Receive(Frame({}), finger, kNoCopies);
  track.Advance(70);
  track.Receive(Frame({plane}), finger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies).size() == 1);
  for (int k = 0; k < 90; ++k) {
    REQUIRE(track.Surfaces(kNoCopies)[0].strength == Approx(std::min(1.0, 0.3 + k / 100.0)));
    track.Advance(1);
  }
  REQUIRE(track.Has(3, 1, 0));
}

TEST_CASE("a body of another generation takes the place of the old one at once") {
  FeatureTrack track(DisplayRule::kHold, kPeriodNs);
  protocol::Plane plane = PlaneAt(1, Vec3(0.003, 0, 0), Vec3::UnitX());
  const std::array<FingerState, 1> finger = {FingerState{Vec3(0.01, 0, 0), 0.01, 1}};
  track.Receive(Frame({plane}), finger, kNoCopies);
  ++plane.generation;
  track.Receive(Frame({plane}), finger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies).size() == 1);
  REQUIRE(track.Surfaces(kNoCopies)[0].generation == plane.generation);
}

TEST_CASE("a fading surface gives way to those of the frame when there is no room") {
  FeatureTrack track(DisplayRule::kHold, kPeriodNs);
  const std::array<FingerState, 1> finger = {FingerState{Vec3::Zero(), 0.01, 1}};
  std::vector<protocol::Plane> planes(protocol::kMaxPlanes,
                                      PlaneAt(0, Vec3::Zero(), Vec3::UnitX()));
  for (std::uint32_t i = 0; i < planes.size(); ++i) planes[i].feature = i;
  track.Receive(Frame(planes), finger, kNoCopies);
  for (std::uint32_t i = 0; i < planes.size(); ++i) planes[i].feature = 100 + i;
  planes.pop_back();
  track.Receive(Frame(planes), finger, kNoCopies);
  const auto surfaces = track.Surfaces(kNoCopies);
  REQUIRE(surfaces.size() == protocol::kMaxPlanes);
  for (std::size_t i = 0; i + 1 < surfaces.size(); ++i) REQUIRE(surfaces[i].feature >= 100);
}

TEST_CASE("damaged planes and planes of other pointers are left out") {
  FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
  std::vector<protocol::Plane> planes;
  for (const double bad : {std::nan(""), double(INFINITY), 1e300}) {
    planes.push_back(PlaneAt(1, Vec3(bad, 0, 0), kNormal0));
    planes.push_back(PlaneAt(1, kPoint0, Vec3(0, bad, 0)));
    planes.push_back(PlaneAt(1, kPoint0, kNormal0));
    planes.back().stiffness = bad;
    planes.push_back(PlaneAt(1, kPoint0, kNormal0));
    planes.back().damping = bad;
  }
  planes.push_back(PlaneAt(1, kPoint0, Vec3::Zero()));
  planes.push_back(PlaneAt(1, kPoint0, kNormal0));
  planes.back().stiffness = -1;
  planes.push_back(PlaneAt(1, kPoint0, kNormal0));
  planes.back().pointer = 1;
  planes.push_back(PlaneAt(7, kPoint0, 3 * kNormal0));  // long, but a direction
  planes.push_back(PlaneAt(8, Vec3(1e-310, 0, 0), kNormal0));
  track.Receive(Frame(planes), kFarFinger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies).size() == 2);
  REQUIRE((track.Surfaces(kNoCopies)[0].plane.normal - kNormal0).norm() < 1e-15);
  REQUIRE(track.Surfaces(kNoCopies)[1].plane.point.x() == 0);  // no denormals inside the loop
  protocol::WorldFrame lying = Frame({});
  lying.plane_count = 4'000'000'000U;
  track.Receive(lying, kFarFinger, kNoCopies);
  REQUIRE(track.Surfaces(kNoCopies).size() <= protocol::kMaxPlanes);
}

// Body 3 as the frame saw it, and a plane on it.
protocol::LocalBody CopyOf(const BodyState& state) {
  protocol::LocalBody local;
  local.body = 3;
  local.generation = 1;
  local.position = ToArray(state.pose.position);
  local.orientation = ToArray(state.pose.orientation);
  local.velocity = ToArray(state.velocity);
  local.angular_velocity = ToArray(state.angular_velocity);
  return local;
}

const BodyState kMoving{
    .pose = {.position = {0.1, 0.2, 0.3}, .orientation = Quat(0.9, 0.1, -0.3, 0.2).normalized()},
    .velocity = {0.3, -0.1, 0},
    .angular_velocity = {0, 1, 2}};

void Hold(protocol::WorldFrame& frame, const BodyState& state) {
  frame.local_body_count = 1;
  frame.local_substep_ns = 1'000'000;
  frame.local_bodies[0] = CopyOf(state);
}

TEST_CASE("a feature rides on its body's copy: point and normal move and turn with it") {
  for (const DisplayRule rule :
       {DisplayRule::kHold, DisplayRule::kInterpolate, DisplayRule::kExtrapolate}) {
    FeatureTrack track(rule, kPeriodNs);
    LocalBodies copies(kPeriodNs, 256, 0, PositionRule::kSecondOrder);
    const HalfSpace seen{Vec3(0.12, 0.2, 0.31), kNormal0};
    const Pose back = kMoving.pose.Inverse();
    protocol::WorldFrame frame = Frame({PlaneAt(1, seen.point, seen.normal)});
    Hold(frame, kMoving);
    copies.Receive(frame, 0);
    track.Receive(frame, kFarFinger, copies);
    for (std::uint64_t k = 0; k < 100; ++k) {
      const Surface& shown = track.Surfaces(copies)[0];
      const double t = static_cast<double>(k) * 1e-3;
      const Vec3& spin = kMoving.angular_velocity;
      const Pose exact{
          kMoving.pose.position + t * kMoving.velocity,
          Quat(Eigen::AngleAxisd(t * spin.norm(), spin.normalized())) * kMoving.pose.orientation};
      REQUIRE((shown.plane.point - exact * (back * seen.point)).norm() < 1e-12);
      REQUIRE((shown.plane.normal - exact.orientation * (back.orientation * seen.normal)).norm() <
              1e-12);
      copies.Step(k, {}, 1e-3);
      track.Advance(1);
    }
  }
}

TEST_CASE("getting a copy and losing it does not step what is displayed") {
  for (const bool late : {false, true}) {
    FeatureTrack track(DisplayRule::kInterpolate, kPeriodNs);
    LocalBodies copies(kPeriodNs, 256, 0, PositionRule::kSecondOrder);
    BodyState state = kMoving;
    Vec3 before = Vec3::Zero();
    const Vec3 point_B(0.02, 0.01, 0.03);
    for (std::uint64_t k = 0; k < 1000; ++k) {
      if (k % 50 == 0 && k > 0) {
        // Copies in frames 4..9 and 13..; as old as they are seen, and the plane with them.
        const std::uint64_t n = k / 50;
        const double age = late ? 0.02 : 0;
        BodyState seen = state;
        seen.pose.position -= age * state.velocity;
        seen.pose.orientation = Turned(state.pose.orientation, -age * state.angular_velocity);
        protocol::WorldFrame frame =
            Frame({PlaneAt(1, seen.pose * point_B, seen.pose.orientation * kNormal0)});
        frame.acked_epoch = 5;
        frame.acked_tick = k - 1 - (late ? 20 : 0);
        if ((n >= 4 && n < 10) || n >= 13) Hold(frame, seen);
        copies.Receive(frame, k);
        track.Receive(frame, kFarFinger, copies);
      }
      const auto shown = track.Surfaces(copies);
      if (!shown.empty()) {
        const Vec3 now = shown[0].plane.point;
        // The body goes 0.32 mm per tick; a plane that is caught up with covers a period in one.
        if (k > 51) REQUIRE((now - before).norm() < 1.2e-3);
        before = now;
      }
      copies.Step(k, {}, 1e-3);
      track.Advance(1);
      state.pose.position += 1e-3 * state.velocity;
      state.pose.orientation = Turned(state.pose.orientation, 1e-3 * state.angular_velocity);
    }
    // In the end it rides, and is where the body is, not a period behind.
    CHECK((before - Pose(state.pose) * point_B).norm() < 1e-3);
  }
}

TEST_CASE("a copy that comes apart leaves its features where they were") {
  FeatureTrack track(DisplayRule::kHold, kPeriodNs);
  LocalBodies copies(kPeriodNs, 256, 0, PositionRule::kSecondOrder);
  protocol::WorldFrame frame = Frame({PlaneAt(1, kPoint0, kNormal0)});
  Hold(frame, kMoving);
  copies.Receive(frame, 0);
  track.Receive(frame, kFarFinger, copies);
  const Vec3 shown = track.Surfaces(copies)[0].plane.point;
  const BodyImpulse absurd{3, 1, Vec3(1e30, 0, 0), Vec3::Zero()};
  copies.Step(0, std::span(&absurd, 1), 1e-3);
  REQUIRE(copies.Find(3, 1) == nullptr);
  CHECK(SameBits(track.Surfaces(copies)[0].plane.point, shown));
}

}  // namespace
}  // namespace rikiseki::haptic
