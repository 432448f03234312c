// SPDX-License-Identifier: MIT
#include "haptic_server/render/contact_solve.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <sstream>
#include <vector>

#include "tests/haptic_server/csv.h"

namespace rikiseki::haptic {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<HalfSpace> ParsePlanes(const std::string& text) {
  std::vector<HalfSpace> planes;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ';');) {
    std::istringstream words(part);
    std::array<double, 6> value{};
    for (double& v : value) {
      std::string word;
      words >> word;
      v = std::stod(word);  // reads nan and inf, as streams do not
    }
    planes.push_back({Vec3(value[0], value[1], value[2]), Vec3(value[3], value[4], value[5])});
  }
  return planes;
}

TEST_CASE("nearest points match the independent reference") {
  const auto rows = ReadCsv(RIKISEKI_SOURCE_DIR "/tests/data/plane_cases.csv");
  REQUIRE(rows.size() == 105);
  for (const CsvRow& row : rows) {
    const auto number = [&](const char* column) { return std::stod(row.at(column)); };
    CAPTURE(row.at("id"), row.at("category"));
    const Vec3 finger(number("Cx"), number("Cy"), number("Cz"));
    const Vec3 expected(number("Dx"), number("Dy"), number("Dz"));
    const auto planes = ParsePlanes(row.at("planes px py pz nx ny nz;..."));
    const ContactSolution got = SolveContact(finger, 0, planes);
    REQUIRE((got.proxy - expected).norm() <= 1e-9 * (1 + expected.norm()));
    REQUIRE(got.feasible);  // all rows of this part of the grid are
    int active = 0;
    for (const double multiplier : got.multiplier) active += multiplier > 0 ? 1 : 0;
    REQUIRE(active <= 3);
    // A finger sphere is the same as planes shifted outwards by its radius.
    auto shifted = planes;
    for (HalfSpace& plane : shifted) plane.point -= 0.01 * plane.normal.normalized();
    const ContactSolution sphere = SolveContact(finger, 0.01, shifted);
    if (expected.norm() < 1) REQUIRE((sphere.proxy - got.proxy).norm() < 1e-9);
  }
}

double Violation(const HalfSpace& plane, const Vec3& d) {
  return plane.normal.normalized().dot(plane.point - d);
}

// The conditions that single out the solution of this convex problem: it needs no other solver.
void RequireOptimal(const Vec3& finger, const std::vector<HalfSpace>& planes,
                    const ContactSolution& got, double tolerance) {
  Vec3 sum = Vec3::Zero();
  Vec3 gradient = Vec3::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const double violation = Violation(planes[i], got.proxy);
    const Vec3 normal = planes[i].normal.normalized();
    if (got.feasible) REQUIRE(violation <= tolerance);
    gradient += std::max(violation, 0.0) * normal;
    REQUIRE(got.multiplier[i] >= 0);
    if (got.multiplier[i] > 0) REQUIRE(violation >= -tolerance);  // pushes only where it touches
    sum += got.multiplier[i] * normal;
  }
  REQUIRE(gradient.norm() <= tolerance);                  // least violation
  REQUIRE((sum - got.displacement).norm() <= tolerance);  // nearest to the finger
  REQUIRE((finger + got.displacement - got.proxy).norm() <= tolerance);
}

TEST_CASE("random planes: the solution satisfies the optimality conditions") {
  std::mt19937_64 random(11);
  std::normal_distribution<double> gauss(0, 1);
  int infeasible = 0;
  for (int round = 0; round < 30'000; ++round) {
    const std::size_t count = 1 + random() % (round % 50 == 0 ? 32 : 8);
    const Vec3 finger = 0.01 * Vec3(gauss(random), gauss(random), gauss(random));
    std::vector<HalfSpace> planes;
    for (std::size_t i = 0; i < count; ++i) {
      Vec3 normal(gauss(random), gauss(random), gauss(random));
      if (round % 3 == 0) normal += Vec3(0, 2, 0);  // mostly from one side: mostly feasible
      planes.push_back({0.01 * Vec3(gauss(random), gauss(random), gauss(random)), normal});
    }
    CAPTURE(round, count);
    const ContactSolution got = SolveContact(finger, 0, planes);
    infeasible += got.feasible ? 0 : 1;
    // Multipliers are rounded to doubles, and far larger than what they add up to in thin wedges.
    double largest = got.displacement.norm();
    for (const double multiplier : got.multiplier) largest = std::max(largest, multiplier);
    RequireOptimal(finger, planes, got, 1e-11 * (1 + largest));
  }
  REQUIRE(infeasible > 1000);
  REQUIRE(infeasible < 29'000);
}

TEST_CASE("duplicates and nearly equal planes change nothing") {
  std::mt19937_64 random(12);
  std::normal_distribution<double> gauss(0, 1);
  for (int round = 0; round < 3000; ++round) {
    std::vector<HalfSpace> planes;
    for (int i = 0; i < 3; ++i) {
      const Vec3 normal = Vec3(gauss(random), 2 + gauss(random), gauss(random)).normalized();
      planes.push_back({0.01 * Vec3(gauss(random), gauss(random), gauss(random)), normal});
    }
    const Vec3 finger = 0.01 * Vec3(gauss(random), gauss(random) - 1, gauss(random));
    const ContactSolution once = SolveContact(finger, 0.002, planes);
    auto more = planes;
    for (const HalfSpace& plane : planes) {
      more.push_back(plane);
      const Vec3 turned = plane.normal + 1e-12 * plane.normal.unitOrthogonal();
      more.push_back({plane.point, turned});
    }
    const ContactSolution again = SolveContact(finger, 0.002, more);
    REQUIRE(once.feasible == again.feasible);
    REQUIRE((once.proxy - again.proxy).norm() <= 1e-10 * (1 + once.proxy.norm()));
  }
}

TEST_CASE("planes that are not planes are ignored") {
  const Vec3 finger(0, -0.002, 0);
  const HalfSpace floor{Vec3::Zero(), Vec3::UnitY()};
  const std::vector<HalfSpace> planes = {
      {Vec3(kNan, 0, 0), Vec3::UnitX()},     {Vec3(1, 0, 0), Vec3(kNan, 1, 0)},
      {Vec3(INFINITY, 0, 0), Vec3::UnitX()}, {Vec3(1, 0, 0), Vec3::Zero()},
      {Vec3(1, 0, 0), Vec3(1e-13, 0, 0)},    floor};
  const ContactSolution got = SolveContact(finger, 0, planes);
  REQUIRE(got.proxy == Vec3::Zero());
  REQUIRE(got.multiplier[5] == Approx(0.002));
  const ContactSolution none = SolveContact(finger, 0, std::span(planes).first(5));
  REQUIRE(none.proxy == finger);
  REQUIRE(none.displacement == Vec3::Zero());
  REQUIRE(SolveContact(finger, 0, {}).displacement == Vec3::Zero());
}

TEST_CASE("between two walls that overlap the finger stays in the middle, wherever it was") {
  const std::vector<HalfSpace> walls = {{Vec3(0.003, 0, 0), Vec3::UnitX()},
                                        {Vec3(0, 0, 0), -Vec3::UnitX()}};
  Vec3 before(0.0015, 0.02, -0.01);
  for (int i = -100; i <= 100; ++i) {  // continuous in the finger
    const Vec3 finger(i * 1e-4, 0.02, -0.01);
    const ContactSolution got = SolveContact(finger, 0, walls);
    REQUIRE_FALSE(got.feasible);
    REQUIRE((got.proxy - Vec3(0.0015, 0.02, -0.01)).norm() < 1e-12);
    REQUIRE((got.proxy - before).norm() < 1e-12);
    before = got.proxy;
  }
}

TEST_CASE("a thin wedge is solved exactly: its edge is far away") {
  for (const double angle : {1e-2, 1.7453292519943295e-4, 1e-6}) {
    const std::vector<HalfSpace> wedge = {
        {Vec3::Zero(), Vec3::UnitY()},
        {Vec3(0, -0.001, 0), Vec3(std::sin(angle), -std::cos(angle), 0)}};
    const ContactSolution got = SolveContact(Vec3(0, -0.0005, 0), 0, wedge);
    REQUIRE(got.feasible);
    REQUIRE(got.proxy.x() == Approx(0.001 / std::tan(angle)).epsilon(1e-9));
    REQUIRE(std::abs(got.proxy.y()) < 1e-9);
  }
}

TEST_CASE("hostile coordinates give finite answers") {
  std::mt19937_64 random(13);
  std::uniform_real_distribution<double> exponent(-310, 12);
  std::uniform_real_distribution<double> sign(-1, 1);
  const auto wild = [&] { return sign(random) * std::pow(10.0, exponent(random)); };
  for (int round = 0; round < 20'000; ++round) {
    std::vector<HalfSpace> planes(1 + random() % 32);
    for (HalfSpace& plane : planes) {
      plane = {Vec3(wild(), wild(), wild()), Vec3(wild(), wild(), wild())};
    }
    const ContactSolution got = SolveContact(Vec3(wild(), wild(), wild()), 0.01, planes);
    REQUIRE(got.proxy.allFinite());
    REQUIRE(got.displacement.allFinite());
    for (const double multiplier : got.multiplier) REQUIRE((multiplier >= 0 && multiplier < 1e300));
  }
}

}  // namespace
}  // namespace rikiseki::haptic
