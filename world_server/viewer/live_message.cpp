// SPDX-License-Identifier: MIT
#include "world_server/viewer/live_message.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "common/histogram.h"
#include "protocol/impulse_units.h"
#include "protocol/words.h"

namespace rikiseki::viewer {
namespace {

using Json = nlohmann::ordered_json;
using protocol::InSi;
using protocol::Key;
using protocol::Printable;

static_assert(std::endian::native == std::endian::little);

Json Durations(const protocol::Histogram& lateness) {
  const auto microseconds = [&lateness](double fraction) {
    return static_cast<double>(HistogramQuantile(lateness, fraction)) * 1e-3;
  };
  return {{"p50", microseconds(0.5)}, {"p99", microseconds(0.99)}, {"max", microseconds(1)}};
}

Json Haptic(const PairWatch& watch) {
  const auto& side = watch.haptic();
  Json told{{"attached", side.attached},
            {"why", side.why},
            {"epoch", std::to_string(side.epoch)},
            {"heartbeat_ns", side.heartbeat_ns}};
  if (side.health) {
    const protocol::HapticHealth& health = *side.health;
    told["reason"] = Key(health.reason);
    told["sentence"] = Sentence(health.reason);
    told["world"] = Key(health.peer_state);
    told["device"] = Printable(health.device.data(), health.device.size());
    told["missed"] = health.missed;
    told["unstable"] = health.energy.unstable != 0;
    told["lateness_us"] = Durations(health.lateness);
    told["displayed"] = InSi(health.books.displayed);
    told["received"] = InSi(health.books.applied);
    told["copies_jump_m"] = health.reconciliation.newest_jump;
  }
  if (!watch.ticks().empty()) {
    told["force_cap_n"] = watch.newest_tick().force_cap;
    told["period_ns"] = watch.newest_tick().period_ns;
  }
  return told;
}

Json World(const PairWatch& watch) {
  const auto& side = watch.world();
  Json told{{"attached", side.attached},
            {"why", side.why},
            {"epoch", std::to_string(side.epoch)},
            {"heartbeat_ns", side.heartbeat_ns}};
  if (side.health) {
    const protocol::WorldHealth& health = *side.health;
    told["scene"] = Printable(health.scene.data(), health.scene.size());
    told["coupling"] = Key(health.coupling);
    told["haptic"] = Key(health.peer_state);
    told["period_ns"] = health.period_ns;
    told["missed"] = health.missed;
    told["lateness_us"] = Durations(health.lateness);
    told["applied"] = InSi(health.applied);
  }
  return told;
}

// Where open channels act: flashes are drawn there.
Json Contacts(const protocol::HapticTick& tick) {
  Json contacts = Json::array();
  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    const protocol::Channel& channel = tick.channels[i];
    contacts.push_back({{"body", channel.body},
                        {"generation", channel.generation},
                        {"pointer", channel.pointer},
                        {"point", channel.contact_point},
                        {"impulse", InSi(channel.impulse)}});
  }
  return contacts;
}

Json Frame(const SeenFrame& frame) {
  Json planes = Json::array();
  for (std::uint32_t i = 0; i < frame.message.plane_count; ++i) {
    const protocol::Plane& plane = frame.message.planes[i];
    planes.push_back({{"pointer", plane.pointer},
                      {"body", plane.body},
                      {"generation", plane.generation},
                      {"feature", plane.feature},
                      {"point", plane.point},
                      {"normal", plane.normal}});
  }
  Json copies = Json::array();
  for (std::uint32_t i = 0; i < frame.message.local_body_count; ++i) {
    const protocol::LocalBody& body = frame.message.local_bodies[i];
    copies.push_back({{"body", body.body},
                      {"generation", body.generation},
                      {"position", body.position},
                      {"orientation", body.orientation},
                      {"velocity", body.velocity}});
  }
  return {{"number", frame.message.frame}, {"stamp_ns", frame.stamp_ns},
          {"state_ns", frame.state_ns},    {"period_ns", frame.message.period_ns},
          {"planes", std::move(planes)},   {"copies", std::move(copies)},
          {"bodies", frame.bodies.size()}};
}

/// The first of the frames that a browser is told.
std::deque<SeenFrame>::const_iterator FirstToTell(const std::deque<SeenFrame>& frames,
                                                  std::uint64_t told) {
  auto first = frames.end();
  std::size_t bodies = 0;
  while (first != frames.begin() && std::prev(first)->sequence > told) {
    bodies += std::prev(first)->bodies.size();
    if (bodies > kMostBodies && first != frames.end()) break;
    --first;
  }
  return first;
}

void Append(std::vector<double>& numbers, const protocol::Vector& v) {
  numbers.insert(numbers.end(), v.begin(), v.end());
}

void Append(std::vector<double>& numbers, const SeenTick& tick, std::size_t pointers) {
  numbers.insert(numbers.end(), {static_cast<double>(tick.start_ns), static_cast<double>(tick.tick),
                                 static_cast<double>(tick.frame),
                                 static_cast<double>(tick.duration_ns), tick.feature_age_s});
  for (std::size_t i = 0; i < pointers; ++i) {
    const bool there = i < tick.pointer_count;
    const protocol::Pointer& pointer = tick.pointers[i];
    numbers.insert(numbers.end(),
                   {static_cast<double>(pointer.pointer), static_cast<double>(pointer.reason),
                    there ? pointer.radius : 0.0});
    Append(numbers, pointer.position);
    Append(numbers, pointer.force);
  }
}

void Append(std::vector<double>& numbers, const protocol::Body& body) {
  numbers.insert(numbers.end(),
                 {static_cast<double>(body.body), static_cast<double>(body.generation)});
  Append(numbers, body.position);
  numbers.insert(numbers.end(), body.orientation.begin(), body.orientation.end());
  Append(numbers, body.velocity);
}

}  // namespace

std::string MeshName(const protocol::SceneMesh& mesh) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string name;
  for (const std::uint8_t byte : mesh.sha256) {
    name += kDigits[byte >> 4];
    name += kDigits[byte & 15];
  }
  return name;
}

bool SceneIsNews(const PairWatch& watch, const Told& told) {
  return watch.scene().revision != 0 &&
         (watch.world().epoch != told.scene_epoch || watch.scene().revision != told.scene_revision);
}

std::string SceneMessage(const PairWatch& watch, Told& told) {
  const protocol::WorldScene& scene = watch.scene();
  Json bodies = Json::array();
  std::size_t collider = 0;
  std::size_t mesh = 0;
  for (const protocol::SceneBody& body : scene.bodies) {
    Json shapes = Json::array();
    for (std::uint32_t i = 0; i < body.collider_count; ++i, ++collider) {
      const protocol::SceneCollider& c = scene.colliders[collider];
      Json& shape = shapes.emplace_back(Json{{"shape", c.shape},
                                             {"dimensions", c.dimensions},
                                             {"position", c.position},
                                             {"orientation", c.orientation},
                                             {"colour", c.colour}});
      if (c.shape != protocol::ShapeType::kMesh || mesh >= scene.meshes.size()) continue;
      const protocol::SceneMesh& file = scene.meshes[mesh++];
      const std::string path = Printable(file.path.data(), file.path.size());
      shape["mesh"] = {{"name", MeshName(file)},
                       {"format", std::filesystem::path(path).extension().string()}};
    }
    bodies.push_back({{"body", body.body},
                      {"generation", body.generation},
                      {"fixed", body.fixed != 0},
                      {"name", Printable(body.name.data(), body.name.size())},
                      {"shapes", std::move(shapes)}});
  }
  told.scene_epoch = watch.world().epoch;
  told.scene_revision = scene.revision;
  return Json{
      {"instance", watch.instance()}, {"epoch", std::to_string(watch.world().epoch)},
      {"revision", scene.revision},   {"name", Printable(scene.name.data(), scene.name.size())},
      {"gravity", scene.gravity},     {"bodies", std::move(bodies)}}
      .dump();
}

std::string UpdateMessage(const PairWatch& watch, std::int64_t now_ns, Told& told) {
  const std::deque<SeenTick>& ticks = watch.ticks();
  const std::size_t count = static_cast<std::size_t>(
      std::min({watch.tick_count() - told.tick, kMostTicks, std::uint64_t{ticks.size()}}));
  const auto first = ticks.end() - static_cast<std::ptrdiff_t>(count);
  std::size_t pointers = 0;
  for (auto tick = first; tick != ticks.end(); ++tick) {
    pointers = std::max<std::size_t>(pointers, tick->pointer_count);
  }
  const auto first_frame = FirstToTell(watch.frames(), told.frame);

  Json head{{"now_ns", now_ns}, {"haptic", Haptic(watch)}, {"world", World(watch)}};
  head["contacts"] = Contacts(watch.newest_tick());
  head["ticks"] = {{"count", count}, {"pointers", pointers}};
  head["frames"] = Json::array();
  std::vector<double> numbers;
  for (auto tick = first; tick != ticks.end(); ++tick) Append(numbers, *tick, pointers);
  for (auto frame = first_frame; frame != watch.frames().end(); ++frame) {
    head["frames"].push_back(Frame(*frame));
    for (const protocol::Body& body : frame->bodies) Append(numbers, body);
    told.frame = frame->sequence;
  }
  told.tick = watch.tick_count();

  std::string text = head.dump();
  text.append((8 - (sizeof(std::uint32_t) + text.size()) % 8) % 8, ' ');
  const auto head_bytes = static_cast<std::uint32_t>(text.size());
  std::string message(sizeof head_bytes + text.size() + numbers.size() * sizeof(double), '\0');
  char* to = message.data();
  std::memcpy(to, &head_bytes, sizeof head_bytes);
  std::memcpy(to + sizeof head_bytes, text.data(), text.size());
  if (!numbers.empty()) {
    std::memcpy(to + sizeof head_bytes + text.size(), numbers.data(),
                numbers.size() * sizeof(double));
  }
  return message;
}

}  // namespace rikiseki::viewer
