// SPDX-License-Identifier: MIT
#include "world_server/geometry/convex_hull.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numeric>
#include <stdexcept>
#include <tuple>

namespace rikiseki::world {
namespace {

constexpr double kFlat = 1e-12;  // of the size: nearer to a face a point is not outside
constexpr int kNone = -1;

// Barber, Dobkin, Huhdanpaa 1996: each face keeps the points outside of it; the farthest of them is
// made a corner, and what it sees is replaced by a fan from the rim of what it does not.
class QuickHull {
 public:
  explicit QuickHull(std::span<const Vec3> points) : points_(points) {
    Start();
    for (int face = 0; face < static_cast<int>(faces_.size()); ++face) {
      if (faces_[face].alive && !faces_[face].outside.empty()) Grow(face);
    }
  }

  std::vector<Triangle> Triangles() const {
    std::vector<Triangle> triangles;
    for (const Face& face : faces_) {
      if (!face.alive) continue;
      Triangle& triangle = triangles.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) triangle[i] = static_cast<std::uint32_t>(face.corners[i]);
    }
    return triangles;
  }

 private:
  struct Face {
    std::array<int, 3> corners{};
    std::array<int, 3> neighbours{};  // across the edge from corner i to corner i+1
    Vec3 normal = Vec3::Zero();
    std::vector<int> outside = {};
    bool alive = true;
    int seen_by = kNone;
  };

  struct RimEdge {
    int from, to, beyond;  // seen from outside; the face that stays
  };

  double Height(const Face& face, int point) const {
    return face.normal.dot(points_[point] - points_[face.corners[0]]);
  }

  int AddFace(int a, int b, int c) {
    Face& face = faces_.emplace_back();
    face.corners = {a, b, c};
    face.normal = (points_[b] - points_[a]).cross(points_[c] - points_[a]).stableNormalized();
    return static_cast<int>(faces_.size()) - 1;
  }

  // The point that is largest by some measure; of equal ones the last along x, y and z, which is a
  // corner of them and not one in their middle.
  template <typename Candidates, typename Measure>
  int Farthest(const Candidates& candidates, const Measure& measure) const {
    int best = candidates[0];
    for (const int i : candidates) {
      const double lead = measure(points_[i]) - measure(points_[best]);
      const bool tied = std::abs(lead) <= flat_;
      if (tied ? After(points_[i], points_[best]) : lead > 0) best = i;
    }
    return best;
  }

  static bool After(const Vec3& a, const Vec3& b) {
    return std::tuple(a.x(), a.y(), a.z()) > std::tuple(b.x(), b.y(), b.z());
  }

  // A tetrahedron of points far from each other.
  void Start() {
    const auto refuse = [](bool bad) {
      if (bad) throw std::invalid_argument("the points of a convex hull lie in a plane");
    };
    refuse(points_.size() < 4);
    Bounds bounds;
    for (const Vec3& point : points_.all) bounds.Add(point);
    const double size = (bounds.high - bounds.low).norm();
    flat_ = kFlat * size;
    const double least = 1e-9 * size;  // a body so thin has no inside to speak of
    int axis = 0;
    (bounds.high - bounds.low).maxCoeff(&axis);
    std::vector<int> all(points_.size());
    std::iota(all.begin(), all.end(), 0);
    refuse(!(size > 0));
    const int a = Farthest(all, [&](const Vec3& p) { return -p[axis]; });
    const int b = Farthest(all, [&](const Vec3& p) { return p[axis]; });
    const Vec3 line = (points_[b] - points_[a]).normalized();
    const auto off_line = [&](const Vec3& p) { return line.cross(p - points_[a]).norm(); };
    const int c = Farthest(all, off_line);
    refuse(!(off_line(points_[c]) > least));
    const Vec3 normal = line.cross(points_[c] - points_[a]).normalized();
    const auto off_plane = [&](const Vec3& p) { return std::abs(normal.dot(p - points_[a])); };
    const int d = Farthest(all, off_plane);
    refuse(!(off_plane(points_[d]) > least));
    const bool above = normal.dot(points_[d] - points_[a]) > 0;
    const int first = above ? c : b;
    const int second = above ? b : c;
    AddFace(a, first, second);
    AddFace(a, d, first);
    AddFace(first, d, second);
    AddFace(second, d, a);
    faces_[0].neighbours = {1, 2, 3};
    faces_[1].neighbours = {3, 2, 0};
    faces_[2].neighbours = {1, 3, 0};
    faces_[3].neighbours = {2, 1, 0};
    Share(all, 0);
  }

  // Gives each point to the face of those from `first_face` on that it is farthest outside of.
  void Share(const std::vector<int>& points, int first_face) {
    for (const int point : points) {
      double highest = flat_;
      Face* owner = nullptr;
      for (std::size_t i = static_cast<std::size_t>(first_face); i < faces_.size(); ++i) {
        const double height = Height(faces_[i], point);
        if (height <= highest) continue;
        highest = height;
        owner = &faces_[i];
      }
      if (owner != nullptr) owner->outside.push_back(point);
    }
  }

  void Grow(int start) {
    const int tip =
        Farthest(faces_[start].outside, [&](const Vec3& p) { return faces_[start].normal.dot(p); });
    std::vector<RimEdge> rim;
    std::vector<int> orphans;
    const int first_new = static_cast<int>(faces_.size());
    faces_[start].seen_by = tip;
    FindRim(start, tip, rim, orphans);
    orphans.erase(std::remove(orphans.begin(), orphans.end(), tip), orphans.end());

    // The rim is one closed chain; the new faces stand side by side along it.
    for (const RimEdge& edge : rim) {
      const int face = AddFace(edge.from, edge.to, tip);
      faces_[face].neighbours[0] = edge.beyond;
      Face& beyond = faces_[edge.beyond];
      for (std::size_t i = 0; i < 3; ++i) {
        if (beyond.corners[i] == edge.to && beyond.corners[(i + 1) % 3] == edge.from) {
          beyond.neighbours[i] = face;
        }
      }
    }
    const int count = static_cast<int>(rim.size());
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j) {
        if (rim[static_cast<std::size_t>(i)].to != rim[static_cast<std::size_t>(j)].from) continue;
        faces_[first_new + i].neighbours[1] = first_new + j;
        faces_[first_new + j].neighbours[2] = first_new + i;
      }
    }
    Share(orphans, first_new);
  }

  // What `tip` sees, connected with `start`, dies; its edges to what stays are the rim.
  void FindRim(int start, int tip, std::vector<RimEdge>& rim, std::vector<int>& orphans) {
    std::vector<int> queue = {start};
    while (!queue.empty()) {
      const int current = queue.back();
      queue.pop_back();
      Face& face = faces_[current];
      face.alive = false;
      orphans.insert(orphans.end(), face.outside.begin(), face.outside.end());
      face.outside.clear();
      for (std::size_t i = 0; i < 3; ++i) {
        Face& next = faces_[face.neighbours[i]];
        if (next.seen_by == tip) continue;
        if (Height(next, tip) > flat_) {
          next.seen_by = tip;
          queue.push_back(face.neighbours[i]);
        } else {
          rim.push_back({face.corners[i], face.corners[(i + 1) % 3], face.neighbours[i]});
        }
      }
    }
  }

  struct Points {
    std::span<const Vec3> all;
    const Vec3& operator[](int i) const { return all[static_cast<std::size_t>(i)]; }
    std::size_t size() const { return all.size(); }
    explicit Points(std::span<const Vec3> points) : all(points) {}
  };

  struct Faces : std::deque<Face> {
    using std::deque<Face>::operator[];
    Face& operator[](int i) { return (*this)[static_cast<std::size_t>(i)]; }
  };

  Points points_;
  Faces faces_;
  double flat_ = 0;
};

}  // namespace

TriangleMesh ConvexHull(std::span<const Vec3> points) {
  for (const Vec3& point : points) {
    if (!point.allFinite()) throw std::invalid_argument("a point that is not finite");
  }
  const QuickHull hull(points);
  return TriangleMesh(points, hull.Triangles());
}

}  // namespace rikiseki::world
