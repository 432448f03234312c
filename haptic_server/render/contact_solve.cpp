// SPDX-License-Identifier: MIT
#include "haptic_server/render/contact_solve.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {
namespace {

// Thin wedges lose as many digits as their angle is small; with 64 bits of mantissa 1e-8 rad still
// leaves eight.
using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

constexpr Real kTolerance =
    1e-12L;  // m, of a violation, relative to the largest coordinate above 1 m
constexpr Real kParallel = 1e-10L;  // rad: planes closer than this act as one
constexpr double kZeroNormal = 1e-12;
constexpr int kMaxExchanges = 100;
constexpr int kMaxNewtonSteps = 64;

// All relative to the finger: the half-space normal . d >= depth.
struct Plane {
  Vector normal;
  Real depth;
  std::size_t index;  // in the caller's list
};

struct Planes {
  std::array<Plane, kMaxContactPlanes> plane;
  std::size_t count = 0;
  Real tolerance = kTolerance;
};

// At most three planes and the nearest point on all of them.
struct Basis {
  std::array<std::size_t, 3> member{};  // positions in Planes
  std::array<Real, 3> multiplier{};
  std::size_t count = 0;
  Vector d = Vector::Zero();
};

// Everything is written where it stays: a copy of 80-bit numbers waits for them to reach memory.
void Collect(const Vec3& finger, double radius, std::span<const HalfSpace> half_spaces,
             Planes& planes) {
  double largest = std::max(1.0, finger.cwiseAbs().maxCoeff());
  const std::size_t count = std::min(half_spaces.size(), kMaxContactPlanes);
  for (std::size_t i = 0; i < count; ++i) {
    const HalfSpace& half_space = half_spaces[i];
    if (!half_space.point.allFinite() || !half_space.normal.allFinite()) continue;
    const Vector normal = half_space.normal.cast<Real>();
    const Real length = normal.norm();
    if (!(length >= kZeroNormal)) continue;
    const Vector point = half_space.point.cast<Real>();
    Plane& plane = planes.plane[planes.count++];
    plane.normal = normal / length;
    plane.depth = plane.normal.dot(point - finger.cast<Real>()) + radius;
    plane.index = i;
    largest = std::max(largest, half_space.point.cwiseAbs().maxCoeff());
  }
  planes.tolerance = kTolerance * largest;
}

// The plane that `d` violates most; planes.count if none beyond the tolerance.
std::size_t MostViolated(const Planes& planes, const Vector& d) {
  std::size_t worst = planes.count;
  Real violation = planes.tolerance;
  for (std::size_t i = 0; i < planes.count; ++i) {
    const Real here = planes.plane[i].depth - planes.plane[i].normal.dot(d);
    if (here > violation) {
      violation = here;
      worst = i;
    }
  }
  return worst;
}

bool IsFree(const Planes& planes, const Vector& d) {
  for (std::size_t i = 0; i < planes.count; ++i) {
    const Plane& plane = planes.plane[i];
    if (plane.depth - plane.normal.dot(d) > planes.tolerance) return false;
  }
  return true;
}

// The plane that the finger itself is deepest in; planes.count if in none beyond the tolerance.
std::size_t Deepest(const Planes& planes) {
  std::size_t deepest = planes.count;
  Real depth = planes.tolerance;
  for (std::size_t i = 0; i < planes.count; ++i) {
    if (!(planes.plane[i].depth > depth)) continue;
    depth = planes.plane[i].depth;
    deepest = i;
  }
  return deepest;
}

void OnOne(const Planes& planes, std::size_t a, Basis& basis) {
  basis.member = {a, 0, 0};
  basis.multiplier = {planes.plane[a].depth, 0, 0};
  basis.count = 1;
  basis.d = planes.plane[a].depth * planes.plane[a].normal;
}

// Two planes as an orthonormal frame: `first` = normal of a, normal of b = cosine * first + sine *
// second.
struct PairFrame {
  Vector second;
  Real cosine, sine;
  Real along_second;  // of any point on both planes
};

// False if the planes are parallel. Differences of normals, not products, keep the digits of small
// angles.
bool MakePairFrame(const Plane& a, const Plane& b, PairFrame& frame) {
  frame.cosine = a.normal.dot(b.normal);
  const bool alike = frame.cosine > 0;
  const Vector difference = alike ? Vector(b.normal - a.normal) : Vector(b.normal + a.normal);
  const Vector axis = a.normal.cross(difference);
  frame.sine = axis.norm();
  if (!(frame.sine > kParallel)) return false;
  frame.second = axis.cross(a.normal) / frame.sine;
  const Real near_one = difference.squaredNorm() / 2;  // 1 -+ cosine
  const Real remaining =
      alike ? (b.depth - a.depth) + near_one * a.depth : (b.depth + a.depth) - near_one * a.depth;
  frame.along_second = remaining / frame.sine;
  return true;
}

// False if the planes are parallel, or if one of them would have to pull.
bool OnTwo(const Planes& planes, std::size_t a, std::size_t b, Basis& basis) {
  PairFrame frame;
  if (!MakePairFrame(planes.plane[a], planes.plane[b], frame)) return false;
  const Real push_b = frame.along_second / frame.sine;
  const Real push_a = planes.plane[a].depth - frame.cosine * push_b;
  if (!(push_a > 0) || !(push_b > 0)) return false;
  basis.member = {a, b, 0};
  basis.multiplier = {push_a, push_b, 0};
  basis.count = 2;
  basis.d = planes.plane[a].depth * planes.plane[a].normal + frame.along_second * frame.second;
  return true;
}

bool OnThree(const Planes& planes, std::size_t a, std::size_t b, std::size_t c, Basis& basis) {
  // The two that differ most in direction carry the frame.
  PairFrame ab, bc, ca, frame;
  const bool has_ab = MakePairFrame(planes.plane[a], planes.plane[b], ab);
  const bool has_bc = MakePairFrame(planes.plane[b], planes.plane[c], bc);
  const bool has_ca = MakePairFrame(planes.plane[c], planes.plane[a], ca);
  if (!has_ab || !has_bc || !has_ca) return false;
  frame = ab;
  if (bc.sine > frame.sine) {
    frame = bc;
    const std::size_t first = a;
    a = b, b = c, c = first;
    if (ca.sine > frame.sine) {
      frame = ca;
      const std::size_t second = a;
      a = b, b = c, c = second;
    }
  } else if (ca.sine > frame.sine) {
    frame = ca;
    const std::size_t last = c;
    c = b, b = a, a = last;
  }
  const Plane& first = planes.plane[a];
  const Plane& third = planes.plane[c];
  const Vector line = first.normal.cross(frame.second);
  const Real across = third.normal.dot(line);
  if (!(std::abs(across) > kParallel)) return false;
  const Vector on_line = first.depth * first.normal + frame.along_second * frame.second;
  const Real along_line = (third.depth - third.normal.dot(on_line)) / across;
  const Real push_c = along_line / across;
  const Vector left = on_line + along_line * line - push_c * third.normal;
  const Real push_b = left.dot(frame.second) / frame.sine;
  const Real push_a = left.dot(first.normal) - frame.cosine * push_b;
  if (!(push_a > 0) || !(push_b > 0) || !(push_c > 0)) return false;
  basis.member = {a, b, c};
  basis.multiplier = {push_a, push_b, push_c};
  basis.count = 3;
  basis.d = on_line + along_line * line;
  return true;
}

// The nearest point outside at most four planes, among all subsets. False if there is none.
bool SolveFew(const Planes& planes, std::span<const std::size_t> few, Basis& best) {
  bool found = false;
  Real nearest = 0;
  const auto consider = [&](const Basis& candidate) {
    const Real distance = candidate.d.squaredNorm();
    if (found && !(distance < nearest)) return;
    for (const std::size_t i : few) {
      const Plane& plane = planes.plane[i];
      if (plane.normal.dot(candidate.d) < plane.depth - planes.tolerance) return;
    }
    found = true;
    nearest = distance;
    best = candidate;
  };
  Basis candidate;
  for (std::size_t i = 0; i < few.size(); ++i) {
    if (planes.plane[few[i]].depth > 0) {
      OnOne(planes, few[i], candidate);
      consider(candidate);
    }
    for (std::size_t j = i + 1; j < few.size(); ++j) {
      if (OnTwo(planes, few[i], few[j], candidate)) consider(candidate);
      for (std::size_t k = j + 1; k < few.size(); ++k) {
        if (OnThree(planes, few[i], few[j], few[k], candidate)) consider(candidate);
      }
    }
  }
  return found;
}

enum class Outcome { kFree, kSolved, kInfeasible };

Outcome SolveAll(const Planes& planes, Basis& basis) {
  std::size_t worst = Deepest(planes);
  if (worst == planes.count) return Outcome::kFree;

  // One plane alone? Only the deepest can be it, or those that agree with it within the tolerance:
  // of these the nearest that satisfies the others.
  const Real deepest = planes.plane[worst].depth;
  std::size_t single = planes.count;
  for (std::size_t i = 0; i < planes.count; ++i) {
    const Real depth = planes.plane[i].depth;
    if (depth < deepest - planes.tolerance || !(depth > 0)) continue;
    if (single != planes.count && depth >= planes.plane[single].depth) continue;
    if (IsFree(planes, depth * planes.plane[i].normal)) single = i;
  }
  const bool one_is_enough = single != planes.count;
  OnOne(planes, one_is_enough ? single : worst, basis);
  if (one_is_enough) return Outcome::kSolved;

  for (int exchange = 0; exchange < kMaxExchanges; ++exchange) {
    worst = MostViolated(planes, basis.d);
    if (worst == planes.count) return Outcome::kSolved;
    std::array<std::size_t, 4> few{};
    std::copy_n(basis.member.begin(), basis.count, few.begin());
    few[basis.count] = worst;
    if (!SolveFew(planes, std::span(few).first(basis.count + 1), basis)) {
      return Outcome::kInfeasible;
    }
  }
  return Outcome::kSolved;  // as near as rounding lets it come
}

// A step that minimises the squared violations of the planes that `d` violates now: any solution of
// H step = -gradient, by elimination with full pivoting that leaves directions without curvature
// alone.
Vector NewtonStep(Eigen::Matrix<Real, 3, 3> h, Vector rhs) {
  constexpr Real kNoCurvature = 1e-17L;
  std::array<int, 3> order{0, 1, 2};
  const Real size = h.trace();
  int rank = 0;
  for (; rank < 3; ++rank) {
    int pivot = rank;
    for (int i = rank; i < 3; ++i) {
      if (h(order[i], order[i]) > h(order[pivot], order[pivot])) pivot = i;
    }
    std::swap(order[rank], order[pivot]);
    const Real diagonal = h(order[rank], order[rank]);
    if (!(diagonal > kNoCurvature * size)) break;
    for (int i = rank + 1; i < 3; ++i) {
      const Real factor = h(order[i], order[rank]) / diagonal;
      for (int j = rank + 1; j < 3; ++j) h(order[i], order[j]) -= factor * h(order[rank], order[j]);
      rhs[order[i]] -= factor * rhs[order[rank]];
    }
  }
  Vector step = Vector::Zero();
  for (int i = rank - 1; i >= 0; --i) {
    Real value = rhs[order[i]];
    for (int j = i + 1; j < rank; ++j) value -= h(order[i], order[j]) * step[order[j]];
    step[order[i]] = value / h(order[i], order[i]);
  }
  return step;
}

// How far along `step` the sum of squared violations is smallest: its derivative is piecewise
// linear and grows, so the breakpoints are passed in order until it changes sign.
Real LineSearch(const Planes& planes, const Vector& d, const Vector& step) {
  Real from = 0;
  for (std::size_t piece = 0; piece <= 2 * planes.count; ++piece) {
    Real slope = 0;      // of half the sum, at `from`
    Real curvature = 0;  // beyond it
    Real next = -1;      // breakpoint after `from`
    for (std::size_t i = 0; i < planes.count; ++i) {
      const Real rate = -planes.plane[i].normal.dot(step);
      const Real at_zero = planes.plane[i].depth - planes.plane[i].normal.dot(d);
      const Real here = at_zero + from * rate;
      if (here > 0 || (here == 0 && rate > 0)) {
        slope += here * rate;
        curvature += rate * rate;
      }
      const Real crossing = rate != 0 ? -at_zero / rate : -1;
      if (crossing > from && (next < 0 || crossing < next)) next = crossing;
    }
    if (slope >= 0) return from;
    const Real bottom = curvature > 0 ? from - slope / curvature : -1;
    if (bottom >= 0 && (next < 0 || bottom <= next)) return bottom;
    if (next < 0) return from;
    from = next;
  }
  return from;
}

// A point that minimises the sum of the squared violations. The violations there are unique.
Vector LeastViolation(const Planes& planes, Vector d) {
  for (int iteration = 0; iteration < kMaxNewtonSteps; ++iteration) {
    Eigen::Matrix<Real, 3, 3> curvature = Eigen::Matrix<Real, 3, 3>::Zero();
    Vector descent = Vector::Zero();
    Real largest = 0;
    for (std::size_t i = 0; i < planes.count; ++i) {
      const Plane& plane = planes.plane[i];
      const Real violation = plane.depth - plane.normal.dot(d);
      if (violation <= 0) continue;
      curvature += plane.normal * plane.normal.transpose();
      descent += violation * plane.normal;
      largest = std::max(largest, violation);
    }
    if (descent.norm() <= 1e-17L * largest) break;
    const Vector step = NewtonStep(curvature, descent);
    const Real length = LineSearch(planes, d, step);
    if (!(length > 0)) break;
    d += length * step;
  }
  return d;
}

}  // namespace

ContactSolution SolveContact(const Vec3& finger, double radius,
                             std::span<const HalfSpace> half_spaces) noexcept {
  ContactSolution solution;
  solution.proxy = finger;
  Planes planes;
  Collect(finger, radius, half_spaces, planes);
  Basis basis{};
  Outcome outcome = SolveAll(planes, basis);
  if (outcome == Outcome::kFree) return solution;
  if (outcome == Outcome::kInfeasible) {
    // Every minimiser violates each plane by the same amount. Relaxed by that amount the planes
    // have the minimisers in common and nothing else: the nearest of them is the same problem
    // again.
    solution.feasible = false;
    const Vector least = LeastViolation(planes, basis.d);
    for (std::size_t i = 0; i < planes.count; ++i) {
      Plane& plane = planes.plane[i];
      plane.depth = std::min(plane.depth, plane.normal.dot(least));
    }
    basis = {};
    outcome = SolveAll(planes, basis);
    if (outcome ==
        Outcome::kInfeasible) {  // only by rounding, where the planes meet at sharp angles
      basis.d = least;
    }
  }
  const Vec3 displacement = basis.d.cast<double>();
  if (!displacement.allFinite()) return solution;
  solution.displacement = displacement;
  solution.proxy = (finger.cast<Real>() + basis.d).cast<double>();
  for (std::size_t i = 0; i < basis.count; ++i) {
    solution.multiplier[planes.plane[basis.member[i]].index] =
        static_cast<double>(basis.multiplier[i]);
  }
  return solution;
}

}  // namespace rikiseki::haptic
