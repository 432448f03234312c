// SPDX-License-Identifier: MIT
// One function object of several lambdas: what std::visit chooses from.
#pragma once

namespace rikiseki {

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;  // older Clangs do not deduce it

}  // namespace rikiseki
