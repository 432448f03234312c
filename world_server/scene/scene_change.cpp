// SPDX-License-Identifier: MIT
#include "world_server/scene/scene_change.h"

#include <algorithm>
#include <deque>
#include <map>
#include <string>

namespace rikiseki::world {
namespace {

// Models are numbered in the order of the file, which others may join and leave.
bool SameDescription(SceneBody now, const SceneBody& before) {
  now.model = before.model;
  return now == before;
}

bool SameJoint(Joint now, const Joint& before, const std::vector<BodyChange>& changes) {
  for (std::size_t* body : {&now.parent, &now.child}) {
    if (*body == Joint::kWorld) continue;
    if (!changes[*body].before) return false;
    *body = *changes[*body].before;
  }
  return now == before;
}

void Renew(BodyChange& change) {
  change.same = change.goes_on = false;
}

// What a joint holds goes on only with all that is linked to it, and only if the joint is the same: else
// all of it starts where its joints fit. What a joint holds no longer goes on as another thing.
void ChangeLinkages(const Scene& before, const Scene& now, std::vector<BodyChange>& changes) {
  const auto renew_ends = [&](const Joint& joint) {
    for (const std::size_t body : {joint.parent, joint.child}) {
      if (body != Joint::kWorld && !now.bodies[body].fixed) Renew(changes[body]);
    }
  };
  for (const Joint& joint : now.joints) {
    const bool same = std::any_of(
        before.joints.begin(), before.joints.end(),
        [&](const Joint& old) { return old.name == joint.name && SameJoint(joint, old, changes); });
    if (!same) renew_ends(joint);
  }
  for (const Joint& old : before.joints) {
    const bool stays = std::any_of(now.joints.begin(), now.joints.end(),
                                   [&](const Joint& joint) { return joint.name == old.name; });
    if (stays) continue;
    for (std::size_t body = 0; body < changes.size(); ++body) {
      const auto place = changes[body].before;
      const bool held = place && (*place == old.parent || *place == old.child);
      if (held && !now.bodies[body].fixed) changes[body].same = false;
    }
  }
  const auto stays_put = [&](std::size_t body) {
    if (body == Joint::kWorld) return true;
    return now.bodies[body].fixed ? changes[body].same : changes[body].goes_on;
  };
  bool spreads = true;
  while (spreads) {
    spreads = false;
    for (const Joint& joint : now.joints) {
      if (stays_put(joint.parent) == stays_put(joint.child)) continue;
      for (const std::size_t body : {joint.parent, joint.child}) {
        spreads = spreads || (body != Joint::kWorld && changes[body].goes_on);
      }
      renew_ends(joint);
    }
  }
}

}  // namespace

std::vector<BodyChange> Changed(const Scene& before, const Scene& now) {
  std::map<std::string, std::deque<std::size_t>> places;
  for (std::size_t i = 0; i < before.bodies.size(); ++i) {
    places[before.bodies[i].name].push_back(i);
  }
  std::vector<BodyChange> changes;
  for (const SceneBody& body : now.bodies) {
    BodyChange& change = changes.emplace_back();
    const auto known = places.find(body.name);
    if (known == places.end() || known->second.empty()) continue;
    change.before = known->second.front();
    known->second.pop_front();
    const SceneBody& old = before.bodies[*change.before];
    change.same = SameDescription(body, old);
    change.goes_on = !body.fixed && !old.fixed && body.pose_WB == old.pose_WB;
  }
  ChangeLinkages(before, now, changes);
  return changes;
}

std::vector<BodyChange> Restarted(const Scene& before, const Scene& now) {
  std::vector<BodyChange> changes = Changed(before, now);
  for (std::size_t i = 0; i < changes.size(); ++i) {
    changes[i].goes_on = false;
    changes[i].same = changes[i].same && now.bodies[i].fixed;
  }
  return changes;
}

}  // namespace rikiseki::world
