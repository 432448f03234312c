#include "world_server/scene/scene_change.h"

#include <deque>
#include <map>
#include <string>

namespace rikiseki::world {

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
    change.same = body == old;
    change.goes_on = !body.fixed && !old.fixed && body.pose_WB == old.pose_WB;
  }
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
