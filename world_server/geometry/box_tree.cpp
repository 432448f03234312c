#include "world_server/geometry/box_tree.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace rikiseki::world {

BoxTree::BoxTree(std::span<const Bounds> boxes, std::uint32_t leaf_size) {
  if (boxes.empty()) return;
  items_.resize(boxes.size());
  std::iota(items_.begin(), items_.end(), 0U);
  nodes_.reserve(2 * boxes.size());
  nodes_.push_back({.bounds = {}, .first = 0, .count = static_cast<std::uint32_t>(boxes.size())});
  Split(0, boxes, std::max(leaf_size, 1U));
}

// At the median of the centres along the longest side: as good here as a cost model, and never
// deeper than the logarithm of the number of items.
void BoxTree::Split(std::uint32_t node, std::span<const Bounds> boxes, std::uint32_t leaf_size) {
  const std::uint32_t first = nodes_[node].first;
  const std::uint32_t count = nodes_[node].count;
  Bounds bounds, centres;
  for (std::uint32_t i = first; i < first + count; ++i) {
    bounds.Add(boxes[items_[i]]);
    centres.Add(Vec3((boxes[items_[i]].low + boxes[items_[i]].high) / 2));
  }
  nodes_[node].bounds = bounds;
  if (count <= leaf_size) return;

  int axis = 0;
  (centres.high - centres.low).maxCoeff(&axis);
  const auto order = [&](std::uint32_t item) {
    return std::tuple(boxes[item].low[axis] + boxes[item].high[axis], item);
  };
  const auto begin = items_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](std::uint32_t a, std::uint32_t b) { return order(a) < order(b); });
  const auto children = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back({.bounds = {}, .first = first, .count = count / 2});
  nodes_.push_back({.bounds = {}, .first = first + count / 2, .count = count - count / 2});
  nodes_[node].first = children;
  nodes_[node].count = 0;
  Split(children, boxes, leaf_size);
  Split(children + 1, boxes, leaf_size);
}

}  // namespace rikiseki::world
