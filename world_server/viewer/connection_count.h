// SPDX-License-Identifier: MIT
// Counts a connection for as long as it lives.
#pragma once

#include <cstddef>
#include <utility>

namespace rikiseki::viewer {

class CountedConnection {
 public:
  explicit CountedConnection(std::size_t& count) : count_(&count) { ++count; }
  CountedConnection(CountedConnection&& other) noexcept
      : count_(std::exchange(other.count_, nullptr)) {}
  CountedConnection& operator=(CountedConnection&&) = delete;
  ~CountedConnection() {
    if (count_ != nullptr) --*count_;
  }

 private:
  std::size_t* count_;
};

}  // namespace rikiseki::viewer
