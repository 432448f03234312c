// SPDX-License-Identifier: MIT
// What a scene that takes another's place changes in it, body by body. A body is known by its name.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// What becomes of a body when its scene takes another's place.
struct BodyChange {
  std::optional<std::size_t> before;  // its place in the scene before; none: it is new
  bool same = false;     // the same thing as before: number, generation and features go on
  bool goes_on = false;  // it moves, and goes on from where it is, at its velocity
};

/// What `now` says differently is changed, everything else goes on: what is described as before is
/// the same; what moves goes on unless the file puts it somewhere else, even with another mass,
/// shape or surface. What joints link goes on only as a whole, and if its joints are described as
/// before. One entry for each body of `now`. Of several bodies of one name the first goes with the
/// first.
std::vector<BodyChange> Changed(const Scene& before, const Scene& now);

/// As if the world were started anew: everything that moves begins at its start; what is fixed, and
/// described as before, is the same.
std::vector<BodyChange> Restarted(const Scene& before, const Scene& now);

}  // namespace rikiseki::world
