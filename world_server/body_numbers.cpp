// SPDX-License-Identifier: MIT
#include "world_server/body_numbers.h"

#include "protocol/messages.h"

namespace rikiseki::world {

void BodyNumbers::Advance(std::span<const BodyChange> changes) {
  std::vector<std::uint32_t> numbers(changes.size()), generations(changes.size());
  std::vector<bool> taken(newest_.size(), false);
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (!changes[i].before) continue;
    numbers[i] = numbers_[*changes[i].before];
    generations[i] = changes[i].same ? generations_[*changes[i].before] : ++newest_[numbers[i]];
    taken[numbers[i]] = true;
  }
  std::size_t lowest = 0;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (changes[i].before) continue;
    std::size_t number = newest_.size();
    if (number >= protocol::kMaxBodies) {
      while (lowest < number && taken[lowest]) ++lowest;
      number = lowest;
    }
    if (number == newest_.size()) {
      newest_.push_back(0);
      taken.push_back(false);
    }
    taken[number] = true;
    numbers[i] = static_cast<std::uint32_t>(number);
    generations[i] = ++newest_[number];
  }
  numbers_ = std::move(numbers);
  generations_ = std::move(generations);
}

}  // namespace rikiseki::world
