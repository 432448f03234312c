// SPDX-License-Identifier: MIT
#include "world_server/body_numbers.h"

#include <catch2/catch.hpp>
#include <set>
#include <utility>

#include "protocol/messages.h"

namespace rikiseki::world {
namespace {

using Numbers = std::vector<std::uint32_t>;

BodyChange Same(std::size_t before) {
  return {.before = before, .same = true};
}
BodyChange Renewed(std::size_t before) {
  return {.before = before};
}

}  // namespace

TEST_CASE("numbers follow their bodies through the scene, new ones are new") {
  BodyNumbers names;
  names.Advance(std::vector<BodyChange>(3));
  CHECK(names.numbers() == Numbers{0, 1, 2});
  CHECK(names.generations() == Numbers{1, 1, 1});
  names.Advance(std::vector<BodyChange>{Renewed(2), {}, Same(0)});
  CHECK(names.numbers() == Numbers{2, 3, 0});
  CHECK(names.generations() == Numbers{2, 1, 1});
  CHECK(names.bound() == 4);
  names.Advance(std::vector<BodyChange>{Same(0), {}});
  CHECK(names.numbers() == Numbers{2, 4});
  CHECK(names.generations() == Numbers{2, 1});
}

TEST_CASE("where all numbers were given, free ones come again in a new generation") {
  BodyNumbers names;
  std::set<std::pair<std::uint32_t, std::uint32_t>> given;
  constexpr std::size_t kHalf = protocol::kMaxBodies / 2;
  names.Advance(std::vector<BodyChange>(kHalf));
  // The first body stays, all others are new again and again.
  for (int round = 0; round < 6; ++round) {
    std::vector<BodyChange> changes(kHalf);
    changes[0] = Same(0);
    names.Advance(changes);
    CHECK(names.numbers()[0] == 0);
    CHECK(names.generations()[0] == 1);
    std::set<std::uint32_t> numbers;
    bool fresh = true;
    for (std::size_t i = 1; i < kHalf; ++i) {
      numbers.insert(names.numbers()[i]);
      fresh = fresh && given.emplace(names.numbers()[i], names.generations()[i]).second;
    }
    CHECK(fresh);
    CHECK(numbers.size() == kHalf - 1);
    CHECK(names.bound() <= protocol::kMaxBodies);
  }
}

}  // namespace rikiseki::world
