// SPDX-License-Identifier: MIT
// A tree of axis-aligned boxes over things that do not move: triangles of a mesh, fixed colliders of
// a scene. What is far from a point is never looked at. Boxes stand side by side by fours, in single
// precision, rounded outward: half the memory to walk through, and four are asked as quickly as one.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
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
  Vec3 Middle() const { return (low + high) / 2; }

 private:
  static constexpr double kNothing = 1e300;
};

class BoxTree {
 public:
  static constexpr std::uint32_t kWidth = 4;
  using Four = Eigen::Array<float, kWidth, 1>;

  /// Up to four boxes.
  struct alignas(64) Node {
    std::array<Four, 3> low, high;              // by axis; of a box that is not there: near nothing
    std::array<std::uint32_t, kWidth> first{};  // of a leaf: place in items(); else: its node
    std::array<std::uint32_t, kWidth> count{};  // of a leaf: how many items; else 0
  };

  /// A point [m] as the boxes see it: rounded, and none within a distance of it seems beyond Limit.
  class Eye {
   public:
    explicit Eye(const Vec3& p);

    /// m^2, from the node's boxes; 0 inside.
    Four SquaredDistances(const Node& node) const {
      Four sum = Four::Zero();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Four apart = (node.low[axis] - at_[axis]).max(at_[axis] - node.high[axis]).max(0.0F);
        sum += apart * apart;
      }
      return sum;
    }

    /// m^2, of a distance.
    float Limit(double distance_m) const;

   private:
    std::array<Four, 3> at_;
    double rounded_m_;  // how far p is from there, at most
  };

  BoxTree() = default;
  /// Boxes within 1e18 m. Leaves hold at most `leaf_size` items. The same boxes make the same tree.
  BoxTree(std::span<const Bounds> boxes, std::uint32_t leaf_size);

  /// The root's boxes are node 0, child nodes come after their parent.
  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<std::uint32_t>& items() const { return items_; }

  /// Each box has a number, by its node and its place there.
  static std::uint32_t BoxNumber(std::uint32_t node, std::uint32_t lane) {
    return kWidth * node + lane;
  }
  Bounds BoxOf(std::uint32_t box) const;
  bool Has(std::uint32_t box) const {
    const Four& low = nodes_[box / kWidth].low[0];
    return low[static_cast<int>(box % kWidth)] < std::numeric_limits<float>::infinity();
  }

  /// Calls visit(place in items()), in their order, for those of each leaf whose box may be within
  /// `radius` of `p`, unless enter(box) is false for the leaf's box or for one that holds it.
  template <typename Enter, typename Visit>
  void VisitNear(const Vec3& p, double radius, const Enter& enter, const Visit& visit) const {
    if (nodes_.empty()) return;
    const Eye eye(p);
    const float limit = eye.Limit(radius);
    std::array<std::uint32_t, kMostWaiting> waiting;
    std::size_t count = 0;
    const auto open = [&](std::uint32_t node) {
      const Four distances = eye.SquaredDistances(nodes_[node]);
      for (std::uint32_t lane = kWidth; lane-- > 0;) {
        const std::uint32_t box = BoxNumber(node, lane);
        if (distances[static_cast<int>(lane)] <= limit && enter(box)) waiting[count++] = box;
      }
    };
    open(0);
    while (count > 0) {
      const std::uint32_t box = waiting[--count];
      const Node& node = nodes_[box / kWidth];
      const std::uint32_t first = node.first[box % kWidth];
      const std::uint32_t items = node.count[box % kWidth];
      if (items == 0) open(first);
      for (std::uint32_t i = 0; i < items; ++i) visit(first + i);
    }
  }

  /// Boxes that wait while others are looked into are never more: three at each of 16 levels, and one.
  static constexpr std::size_t kMostWaiting = 64;

 private:
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };

  void Fill(std::uint32_t node, const Range& range, std::span<const Bounds> boxes,
            std::uint32_t leaf_size);
  std::array<Range, 2> Halve(const Range& range, std::span<const Bounds> boxes);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> items_;
};

}  // namespace rikiseki::world
