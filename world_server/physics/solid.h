// SPDX-License-Identifier: MIT
// A shape with what contact routines ask of it again and again, worked out once.
#pragma once

#include <memory>

#include "world_server/geometry/polyhedron.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

struct Solid {
  Shape shape;
  std::shared_ptr<const Polyhedron> faces;  // of a hull; else none

  explicit Solid(const Shape& given) : shape(given) {
    const auto* hull = std::get_if<Hull>(&shape);
    if (hull != nullptr) faces = std::make_shared<const Polyhedron>(*hull->mesh);
  }
};

}  // namespace rikiseki::world
