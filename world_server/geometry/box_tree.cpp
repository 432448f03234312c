// SPDX-License-Identifier: MIT
#include "world_server/geometry/box_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace rikiseki::world {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr double kFarthest = 1e18;  // m: its square is a float
constexpr double kMost = 1e38;      // m^2, likewise
// Five roundings of single precision; squares that are too small for it are less than kLeast.
constexpr double kRounding = 1e-6;
constexpr float kLeast = std::numeric_limits<float>::min();

float Below(double value) {
  const auto rounded = static_cast<float>(value);
  return rounded > value ? std::nextafter(rounded, -kInfinite) : rounded;
}

float Above(double value) {
  return -Below(-value);
}

}  // namespace

// Whoever is farther than all boxes can be is no farther from any of them when it is drawn nearer.
BoxTree::Eye::Eye(const Vec3& p) {
  const Vec3 nearer = p.cwiseMax(-kFarthest).cwiseMin(kFarthest);
  const Eigen::Vector3f rounded = nearer.cast<float>();
  for (int axis = 0; axis < 3; ++axis)
    at_[static_cast<std::size_t>(axis)].setConstant(rounded[axis]);
  rounded_m_ = (nearer - rounded.cast<double>()).norm();
}

float BoxTree::Eye::Limit(double distance_m) const {
  const double farthest = distance_m + rounded_m_;
  return static_cast<float>(std::min(kMost, farthest * farthest * (1 + kRounding))) + kLeast;
}

BoxTree::BoxTree(std::span<const Bounds> boxes, std::uint32_t leaf_size) {
  if (boxes.empty()) return;
  items_.resize(boxes.size());
  std::iota(items_.begin(), items_.end(), 0U);
  nodes_.emplace_back();
  Fill(0, {.first = 0, .count = static_cast<std::uint32_t>(boxes.size())}, boxes,
       std::max(leaf_size, 1U));
}

// At the median of the centres along the longest side: as good here as a cost model, and never
// deeper than the logarithm of the number of items.
std::array<BoxTree::Range, 2> BoxTree::Halve(const Range& range, std::span<const Bounds> boxes) {
  Bounds centres;
  for (std::uint32_t i = range.first; i < range.first + range.count; ++i) {
    centres.Add(boxes[items_[i]].Middle());
  }
  int axis = 0;
  (centres.high - centres.low).maxCoeff(&axis);
  const auto order = [&](std::uint32_t item) {
    return std::tuple(boxes[item].low[axis] + boxes[item].high[axis], item);
  };
  const auto begin = items_.begin() + range.first;
  const std::uint32_t half = range.count / 2;
  std::nth_element(begin, begin + half, begin + range.count,
                   [&](std::uint32_t a, std::uint32_t b) { return order(a) < order(b); });
  return {{{range.first, half}, {range.first + half, range.count - half}}};
}

void BoxTree::Fill(std::uint32_t node, const Range& range, std::span<const Bounds> boxes,
                   std::uint32_t leaf_size) {
  std::vector<Range> parts;
  if (range.count <= leaf_size) {
    parts.push_back(range);
  } else {
    for (const Range& half : Halve(range, boxes)) {
      if (half.count <= leaf_size) {
        parts.push_back(half);
      } else {
        const std::array<Range, 2> quarters = Halve(half, boxes);
        parts.insert(parts.end(), quarters.begin(), quarters.end());
      }
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    nodes_[node].low[axis].setConstant(kInfinite);
    nodes_[node].high[axis].setConstant(-kInfinite);
  }
  for (std::uint32_t lane = 0; lane < parts.size(); ++lane) {
    const Range& part = parts[lane];
    Bounds bounds;
    for (std::uint32_t i = part.first; i < part.first + part.count; ++i) {
      bounds.Add(boxes[items_[i]]);
    }
    for (int axis = 0; axis < 3; ++axis) {
      nodes_[node].low[static_cast<std::size_t>(axis)][lane] = Below(bounds.low[axis]);
      nodes_[node].high[static_cast<std::size_t>(axis)][lane] = Above(bounds.high[axis]);
    }
    if (part.count <= leaf_size) {
      nodes_[node].first[lane] = part.first;
      nodes_[node].count[lane] = part.count;
      continue;
    }
    const auto child = static_cast<std::uint32_t>(nodes_.size());
    nodes_[node].first[lane] = child;
    nodes_.emplace_back();
    Fill(child, part, boxes, leaf_size);
  }
}

Bounds BoxTree::BoxOf(std::uint32_t box) const {
  const Node& node = nodes_[box / kWidth];
  const auto lane = static_cast<int>(box % kWidth);
  Bounds bounds;
  for (int axis = 0; axis < 3; ++axis) {
    bounds.low[axis] = node.low[static_cast<std::size_t>(axis)][lane];
    bounds.high[axis] = node.high[static_cast<std::size_t>(axis)][lane];
  }
  return bounds;
}

}  // namespace rikiseki::world
