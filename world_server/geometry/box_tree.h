// A tree of axis-aligned boxes over things that do not move: triangles of a mesh, fixed colliders of
// a scene. What is far from a point is never looked at.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry.h"

namespace rikiseki::world {

/// An axis-aligned box; as made, empty.
struct Bounds {
  Vec3 low = Vec3::Constant(kNothing);
  Vec3 high = Vec3::Constant(-kNothing);

  void Add(const Vec3& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  void Add(const Bounds& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }

  /// 0 inside.
  double SquaredDistance(const Vec3& p) const {
    return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
  }

 private:
  static constexpr double kNothing = 1e300;
};

class BoxTree {
 public:
  /// The root is node 0, children come after their parent, the second right after the first.
  struct Node {
    Bounds bounds;
    std::uint32_t first = 0;  // of a leaf: place in items(); else: the first child
    std::uint32_t count = 0;  // of a leaf: how many items; else 0
  };

  BoxTree() = default;
  /// Leaves hold at most `leaf_size` items. The same boxes make the same tree.
  BoxTree(std::span<const Bounds> boxes, std::uint32_t leaf_size);

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<std::uint32_t>& items() const { return items_; }

  /// Calls visit(item) for each item of a leaf whose box is at most `radius` from `p`.
  template <typename Visit>
  void VisitNear(const Vec3& p, double radius, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::uint32_t stack[kDeepest];
    std::size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const Node& node = nodes_[stack[--depth]];
      if (!(node.bounds.SquaredDistance(p) <= radius * radius)) continue;
      if (node.count == 0) {
        stack[depth++] = node.first + 1;
        stack[depth++] = node.first;
        continue;
      }
      for (std::uint32_t i = 0; i < node.count; ++i) visit(items_[node.first + i]);
    }
  }

  /// A stack of node numbers never grows longer: items are halved at each level.
  static constexpr std::size_t kDeepest = 72;

 private:
  void Split(std::uint32_t node, std::span<const Bounds> boxes, std::uint32_t leaf_size);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> items_;
};

}  // namespace rikiseki::world
