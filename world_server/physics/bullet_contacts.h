// The pairs of shapes whose contacts are ours (pair_contact.h) and not Bullet's: boxes, cylinders and
// hulls on half-spaces and on boxes.
#pragma once

#include <vector>

#include "world_server/physics/pair_contact.h"

namespace rikiseki::world {

/// To be kept as long as the dispatcher is used.
std::vector<PairContact> ReplaceContacts(btCollisionDispatcher& dispatcher);

}  // namespace rikiseki::world
