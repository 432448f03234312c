// SPDX-License-Identifier: MIT
#include "world_server/geometry/box_tree.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

namespace rikiseki::world {
namespace {

double Distance(const Bounds& box, const Vec3& p) {
  return (box.low - p).cwiseMax(p - box.high).cwiseMax(0.0).norm();
}

std::vector<Bounds> RandomBoxes(int count, const Vec3& middle, double size, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Bounds> boxes(static_cast<std::size_t>(count));
  for (Bounds& box : boxes) {
    const Vec3 at = middle + size * Vec3(uniform(random), uniform(random), uniform(random));
    const Vec3 half = 0.05 * size * Vec3(uniform(random), uniform(random), uniform(random));
    box.Add(Vec3(at - half.cwiseAbs()));
    box.Add(Vec3(at + half.cwiseAbs()));
  }
  return boxes;
}

// As the tree tells, in its order.
std::vector<std::uint32_t> PlacesNear(const BoxTree& tree, const Vec3& p, double radius) {
  std::vector<std::uint32_t> places;
  tree.VisitNear(
      p, radius, [](std::uint32_t) { return true; },
      [&](std::uint32_t place) { places.push_back(place); });
  return places;
}

}  // namespace

TEST_CASE("nothing within the radius is left out, and little beyond it is looked at") {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const double size : {1e-3, 1.0, 1e6}) {
    for (const double off : {0.0, 10.0, 1e4}) {
      for (const int count : {1, 2, 3, 5, 17, 400}) {
        const Vec3 middle = off * size * Vec3(0.3, -1, 0.7);
        const std::vector<Bounds> boxes = RandomBoxes(count, middle, size, random);
        const BoxTree tree(boxes, 1);
        REQUIRE(tree.items().size() == boxes.size());
        // A box is rounded outward by a 2^-24th of where it is, and so is p.
        const double rounding = 1e-6 * size * (1 + 2 * off);
        for (int i = 0; i < 50; ++i) {
          const Vec3 p = middle + size * Vec3(normal(random), normal(random), normal(random));
          const double radius = i % 5 == 0 ? 0 : 0.3 * size * std::abs(normal(random));
          const std::vector<std::uint32_t> places = PlacesNear(tree, p, radius);
          REQUIRE(std::ranges::is_sorted(places));
          std::vector<std::uint32_t> found;
          for (const std::uint32_t place : places) found.push_back(tree.items()[place]);
          std::ranges::sort(found);
          for (std::uint32_t item = 0; item < boxes.size(); ++item) {
            const double distance = Distance(boxes[item], p);
            const bool is_found = std::ranges::binary_search(found, item);
            CAPTURE(size, off, count, distance, radius);
            if (distance <= radius) REQUIRE(is_found);
            if (distance > radius + rounding) REQUIRE_FALSE(is_found);
          }
        }
      }
    }
  }
}

TEST_CASE(
    "an infinite radius finds all, from anywhere, and a box that is not entered hides its own") {
  std::mt19937 random(2);
  const std::vector<Bounds> boxes = RandomBoxes(300, Vec3::Zero(), 1, random);
  const BoxTree tree(boxes, 2);
  for (const double far : {0.0, 1e9, 1e30, 1e300}) {
    const Vec3 p(far, -far, far);
    CHECK(PlacesNear(tree, p, std::numeric_limits<double>::infinity()).size() == 300);
    if (far > 0) CHECK(PlacesNear(tree, p, 1e6).empty());
  }
  // Half of the root's boxes hold half of all.
  std::size_t seen = 0;
  tree.VisitNear(
      Vec3::Zero(), 10, [](std::uint32_t box) { return box != 0 && box != 1; },
      [&](std::uint32_t) { ++seen; });
  CHECK(seen == 150);
}

TEST_CASE("each box holds its items, and an empty tree nothing") {
  std::mt19937 random(3);
  const std::vector<Bounds> boxes = RandomBoxes(100, Vec3(5, 5, 5), 1, random);
  const BoxTree tree(boxes, 2);
  std::vector<int> held(boxes.size());
  for (std::uint32_t node = 0; node < tree.nodes().size(); ++node) {
    for (std::uint32_t lane = 0; lane < BoxTree::kWidth; ++lane) {
      const std::uint32_t box = BoxTree::BoxNumber(node, lane);
      if (!tree.Has(box)) continue;
      const Bounds bounds = tree.BoxOf(box);
      for (std::uint32_t i = 0; i < tree.nodes()[node].count[lane]; ++i) {
        const std::uint32_t item = tree.items()[tree.nodes()[node].first[lane] + i];
        ++held[item];
        CHECK((bounds.low.array() <= boxes[item].low.array()).all());
        CHECK((bounds.high.array() >= boxes[item].high.array()).all());
      }
    }
  }
  CHECK(std::ranges::count(held, 1) == 100);
  CHECK(PlacesNear(BoxTree(), Vec3::Zero(), 1e9).empty());
}

}  // namespace rikiseki::world
