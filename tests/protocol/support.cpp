// SPDX-License-Identifier: MIT
#include "tests/protocol/support.h"

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <thread>

namespace rikiseki::protocol::test {

std::string FreshInstance() {
  static std::atomic<int> count{0};
  return "test-" + std::to_string(getpid()) + "-" + std::to_string(++count);
}

TemporaryFolder::TemporaryFolder() {
  std::string pattern = std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
  path_ = pattern;
}
TemporaryFolder::~TemporaryFolder() {
  std::filesystem::remove_all(path_);
}

OwnerOptions HapticOptions(const std::string& instance, const std::string& runtime_directory) {
  OwnerOptions options;
  options.instance = instance;
  options.role = Role::kHaptic;
  options.streams = HapticStreams(1'000'000, 16, 100'000'000);
  options.build = "test";
  options.runtime_directory = runtime_directory;
  return options;
}

pid_t Fork(const std::function<void()>& body) {
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("fork");
  if (child == 0) {
    try {
      body();
    } catch (...) {
      _exit(99);
    }
    _exit(0);
  }
  return child;
}

int Reap(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

bool Eventually(const std::function<bool()>& condition, double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

Vector Generator::Direction() {
  for (;;) {
    const Vector v = Triple();
    const double norm = std::hypot(v[0], v[1], v[2]);
    if (norm > 0.1) return {v[0] / norm, v[1] / norm, v[2] / norm};
  }
}

Quaternion Generator::Orientation() {
  for (;;) {
    const Quaternion q{Real(), Real(), Real(), Real()};
    const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
    if (norm > 0.1) return {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
  }
}

HapticTick Generator::Tick() {
  HapticTick m;
  m.tick = Integer(1'000'000);
  m.start_ns = engine_();
  m.period_ns = 1 + Integer(10'000'000);
  m.previous_duration_ns = engine_();
  m.world_epoch = engine_();
  m.world_frame = engine_();
  m.stiffness = Positive();
  m.damping = Positive();
  m.force_cap = Positive();
  m.pointer_count = Small(kMaxPointers);
  m.channel_count = Small(kMaxChannels);
  const bool turning = Integer(1) == 1;
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    Pointer& p = m.pointers[i];
    p.pointer = kMaxPointers - 1 - i;
    p.reason = static_cast<ForceReason>(Integer(17));
    p.radius = Positive();
    p.position = Triple();
    p.velocity = Triple();
    p.force = Triple();
    if (turning) {
      p.orientation = Orientation();
      p.angular_velocity = Triple();
      p.torque = Triple();
    }
  }
  for (std::uint32_t i = 0; i < m.channel_count; ++i) {
    m.channels[i] = {
        Small(0xFFFFFFFF), Small(0xFFFFFFFF), Small(3), static_cast<ChannelState>(1 + Integer(1)),
        Integer(m.tick),   Units(),           Units(),  Triple(),
        Triple(),          Triple()};
  }
  if (Integer(1) == 1) m.ground = {Units(), Units()};
  return m;
}

HapticHealth Generator::Haptic() {
  HapticHealth m;
  for (std::uint64_t* word :
       {&m.ticks, &m.missed, &m.worst_missed_in_a_row, &m.reason_ticks, &m.peer_epoch,
        &m.feature_age_ns, &m.zero_force_after_ns, &m.minor_faults, &m.major_faults}) {
    *word = engine_();
  }
  m.period_ns = 1 + Integer(10'000'000);
  m.reason = static_cast<ForceReason>(Integer(17));
  m.peer_state = static_cast<PeerState>(Integer(5));
  m.largest_force = Real();
  m.largest_force_step = Real();
  m.slew_limit = Real();
  m.target = Triple();
  m.scheduling = {Small(7), Small(99), Small(1), Small(64)};
  m.books = {Units(), Units(), Units(), Units(), Units(), Units()};
  for (char& c : m.device) c = static_cast<char>('a' + Integer(25));
  for (auto& count : m.lateness) count = engine_();
  for (auto& count : m.duration) count = engine_();
  if (Integer(1) == 1) m.reconciliation = {1 + Integer(99), Positive(), Positive()};
  if (Integer(1) == 1) m.energy = {Real(), Positive(), engine_(), Small(1), Small(1)};
  return m;
}

WorldFrame Generator::Frame() {
  WorldFrame m;
  m.frame = 1 + Integer(1'000'000);
  m.world_time_ns = engine_();
  m.period_ns = 1 + Integer(100'000'000);
  m.acked_epoch = engine_();
  m.baseline_tick = Integer(1000);
  m.acked_tick = m.baseline_tick + Integer(1000);
  m.applied = Units();
  m.discarded = Units();
  m.coupling = static_cast<Coupling>(1 + Integer(2));
  m.plane_count = Small(kMaxPlanes);
  const bool own_surfaces = Integer(1) == 1;
  for (std::uint32_t i = 0; i < m.plane_count; ++i) {
    m.planes[i] = {Small(3), Small(99), Small(99), Small(0xFFFFFFFF), Triple(), Direction()};
    if (own_surfaces) {
      m.planes[i].stiffness = Positive();
      m.planes[i].damping = Positive();
    }
  }
  const bool rubbing = Integer(1) == 1;
  for (std::uint32_t i = 0; rubbing && i < m.plane_count; ++i) {
    m.planes[i].velocity = Triple();
    m.planes[i].static_friction = Positive();
    m.planes[i].dynamic_friction = Positive();
    m.planes[i].recovery_s = Positive();
  }
  const bool mobility = Integer(1) == 1;
  for (std::uint32_t i = 0; mobility && i < m.plane_count; ++i) {
    constexpr double kSaid[] = {0, kMobilityNotSaid};
    m.planes[i].inverse_mass = Integer(1) == 1 ? Positive() : kSaid[Integer(1)];
  }
  const bool round = Integer(1) == 1;
  for (std::uint32_t i = 0; round && i < m.plane_count; ++i) m.planes[i].radius = Positive();
  if (Integer(1) == 1) {
    m.local_body_count = 1 + Small(kMaxLocalBodies - 1);
    m.local_substep_ns = 1 + Integer(10'000'000);
    for (std::uint32_t i = 0; i < m.local_body_count; ++i) m.local_bodies[i] = OneLocalBody(i);
  }
  return m;
}

LocalBody Generator::OneLocalBody(std::uint32_t body) {
  LocalBody b;
  b.body = body;
  b.generation = Small(99);
  b.mass = 0.001 + Positive();
  b.inertia = {20 + Positive(), Real(), Real() / 2, 30 + Positive(), Real() / 4, 40 + Positive()};
  b.position = Triple();
  b.orientation = Orientation();
  b.velocity = Triple();
  b.angular_velocity = Triple();
  b.acceleration = Triple();
  b.angular_acceleration = Triple();
  b.contact_count = Small(kMaxContactPlanes);
  for (std::uint32_t i = 0; i < b.contact_count; ++i) {
    b.contacts[i] = {Small(99),  Small(99), Triple(),   Direction(), Real(),
                     Positive(), Triple(),  Positive(), Triple(),    Positive()};
  }
  return b;
}

WorldScene Generator::Scene() {
  WorldScene m;
  m.revision = 1 + Integer(1000);
  m.needs = Integer(kAllSceneNeeds);
  m.left_out = ~m.needs & kAllSceneNeeds;
  m.gravity = Triple();
  for (char& c : m.name) c = static_cast<char>('a' + Integer(25));
  m.bodies.resize(Small(20));
  for (SceneBody& body : m.bodies) {
    body = {Small(99), Small(99), Small(1), Small(3), {}};
    for (char& c : body.name) c = static_cast<char>('a' + Integer(25));
    for (std::uint32_t i = 0; i < body.collider_count; ++i) {
      SceneCollider c;
      c.shape = static_cast<ShapeType>(1 + Integer(6));
      c.position = Triple();
      c.orientation = Orientation();
      for (double& component : c.colour) component = static_cast<double>(Integer(8)) / 8;
      for (double& dimension : c.dimensions) dimension = 0.001 + Positive();
      if (c.shape == ShapeType::kHalfSpace) c.dimensions = Direction();
      if (c.shape == ShapeType::kMesh) {
        SceneMesh mesh;
        for (auto& byte : mesh.sha256) byte = static_cast<std::uint8_t>(Integer(255));
        for (char& letter : mesh.path) letter = static_cast<char>('a' + Integer(25));
        m.meshes.push_back(mesh);
      }
      m.colliders.push_back(c);
    }
  }
  return m;
}

WorldHealth Generator::World() {
  WorldHealth m;
  for (std::uint64_t* word :
       {&m.frames, &m.missed, &m.lapped, &m.peer_epoch, &m.moving_bodies, &m.resets}) {
    *word = engine_();
  }
  m.period_ns = 1 + Integer(100'000'000);
  m.peer_state = static_cast<PeerState>(Integer(5));
  m.coupling = static_cast<Coupling>(1 + Integer(2));
  m.applied = Units();
  for (auto& units : m.discarded) units = Units();
  m.penalty_impulse = Triple();
  m.scheduling = {Small(7), Small(99), Small(1), Small(64)};
  for (char& c : m.scene) c = static_cast<char>('a' + Integer(25));
  for (auto& count : m.lateness) count = engine_();
  for (auto& count : m.duration) count = engine_();
  return m;
}

Body Generator::OneBody() {
  return {Small(9999), Small(99), Positive(), Triple(), Orientation(), Triple(), Triple()};
}

HapticTick Numbered(std::uint64_t number) {
  HapticTick m;
  m.tick = number;
  m.start_ns = number * 3;
  m.period_ns = 1 + number % 1000;
  m.pointer_count = static_cast<std::uint32_t>(number % (kMaxPointers + 1));
  m.channel_count = static_cast<std::uint32_t>(number % (kMaxChannels + 1));
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    m.pointers[i].pointer = i;
    m.pointers[i].position.fill(static_cast<double>(number + i));
    m.pointers[i].force.fill(-static_cast<double>(number + i));
  }
  for (std::uint32_t i = 0; i < m.channel_count; ++i) {
    m.channels[i].body = static_cast<std::uint32_t>(number);
    m.channels[i].impulse.fill(static_cast<std::int64_t>(number * (i + 1)));
    m.channels[i].contact_point.fill(static_cast<double>(number) / 2);
  }
  return m;
}

bool IsNumbered(const HapticTick& tick) {
  const HapticTick right = Numbered(tick.tick);
  return std::memcmp(&right, &tick, sizeof tick) == 0;
}

}  // namespace rikiseki::protocol::test
