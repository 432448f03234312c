// SPDX-License-Identifier: MIT
// What bodies are called on the wire: a number and a generation, which a body keeps as long as it is
// the same thing. SPEC.md 6.2-7, 6.2-8.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "world_server/scene/scene_change.h"

namespace rikiseki::world {

class BodyNumbers {
 public:
  /// Names the bodies of the scene that comes: what is the same keeps number and generation, what is
  /// only called the same gets a new generation of its number, what is new a number that no body
  /// had yet; as soon as there are kMaxBodies of them, the lowest that no body has, in a new
  /// generation.
  void Advance(std::span<const BodyChange> changes);

  /// By place in the scene.
  const std::vector<std::uint32_t>& numbers() const { return numbers_; }
  const std::vector<std::uint32_t>& generations() const { return generations_; }

  /// All numbers given so far are below this.
  std::size_t bound() const { return newest_.size(); }

 private:
  std::vector<std::uint32_t> numbers_, generations_;  // by place
  std::vector<std::uint32_t> newest_;                 // generation, by number
};

}  // namespace rikiseki::world
