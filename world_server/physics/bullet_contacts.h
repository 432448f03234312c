// SPDX-License-Identifier: MIT
// Contacts are ours (shape_contact.h) and not Bullet's, for every pair of shapes.
#pragma once

#include <vector>

#include "world_server/physics/pair_contact.h"

namespace rikiseki::world {

/// To be kept as long as the dispatcher is used. The shapes are of MakeBulletShape.
std::vector<PairContact> ReplaceContacts(btCollisionDispatcher& dispatcher);

}  // namespace rikiseki::world
