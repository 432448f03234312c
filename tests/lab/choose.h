// SPDX-License-Identifier: MIT
// Columns that hold one of a few names.
#pragma once

#include <string>

#include "tests/lab/table.h"

namespace rikiseki::lab {

template <typename Value>
struct Named {
  const char* name;
  Value value;
};

/// What the row's name in `column` stands for. Throws ConfigError that lists the names.
template <typename Value, std::size_t kCount>
Value Choose(const Row& row, const char* column, const Named<Value> (&entries)[kCount]) {
  const std::string name = row.Text(column);
  std::string names;
  for (const Named<Value>& entry : entries) {
    if (name == entry.name) return entry.value;
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  }
  row.Refuse(column, "one of " + names + " is expected");
}

}  // namespace rikiseki::lab
