// SPDX-License-Identifier: MIT
#include "tests/lab/slide_run.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include "protocol/impulse_units.h"
#include "tests/lab/coupled_run.h"
#include "tests/lab/prescribed_device.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kHapticPeriod = 1e-3;  // s
constexpr double kUnlimited = 1e9;      // for limits that must not act: N, N/s, m/s
constexpr double kUnit = 1e-12;         // N s, of the books
const Vec3 kTurned(20, -35, 50);        // degrees, roll pitch yaw of a device that is scaled

haptic::Settings HapticSettings(const SlideLoops& loops, double world_period_s) {
  haptic::Settings settings;
  settings.loop.rate_hz = 1 / kHapticPeriod;
  settings.loop.longest_world_period_ms =
      std::max(settings.loop.longest_world_period_ms,
               1e3 * (world_period_s + loops.latency_ticks * kHapticPeriod));
  settings.render.stiffness_n_per_m = loops.stiffness_n_per_m;
  settings.render.damping_ns_per_m = loops.damping_ns_per_m;
  settings.render.display =
      loops.single ? haptic::DisplayRule::kHold : haptic::DisplayRule::kInterpolate;
  settings.render.finger_radius_mm = kSlideRadius * 1e3;
  settings.safety.force_cap_n = kUnlimited;
  settings.safety.slew_limit_n_per_s = kUnlimited * 1e6;
  settings.safety.speed_limit_m_per_s = kUnlimited;
  settings.safety.soft_start_ms = 0;
  settings.mapping.motion_scale = loops.motion_scale;
  settings.mapping.force_scale = loops.force_scale;
  if (loops.motion_scale != 1) settings.mapping.rotation_deg = kTurned;
  return settings;
}

world::Settings WorldSettings(const Slide& slide, const SlideLoops& loops, double world_period_s) {
  world::Settings settings;
  settings.loop.rate_hz = 1 / world_period_s;
  settings.coupling.coupling = loops.single ? protocol::Coupling::kImpulse : loops.coupling;
  settings.coupling.force_cap_n = kUnlimited;
  settings.features.finger_friction = slide.friction;
  return settings;
}

// What the device is told and where it is, from which impulse and work follow without any of the
// stations.
class MeasuringDevice final : public haptic::Device {
 public:
  MeasuringDevice(PrescribedDevice::Path path, std::int64_t start_ns)
      : device_(std::move(path), start_ns) {}

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override {
    const haptic::DeviceStatus status = device_.Read(now_ns, sample);
    moved_ = sample.position - position_;
    position_ = sample.position;
    return status;
  }
  Vec3 Write(const Vec3& force) noexcept override {
    before_ = force_;
    return force_ = force;
  }
  void Release() noexcept override { Write(Vec3::Zero()); }
  std::string Name() const override { return device_.Name(); }

  const Vec3& force() const { return force_; }
  double step() const { return (force_ - before_).norm(); }
  /// On the user, since the last sample, by the force that was held until this one.
  double work() const { return before_.dot(moved_); }

 private:
  PrescribedDevice device_;
  Vec3 position_ = Vec3::Zero();
  Vec3 moved_ = Vec3::Zero();
  Vec3 force_ = Vec3::Zero();
  Vec3 before_ = Vec3::Zero();
};

// How the device of a run lies in the world: C = s_x R C_device, f_device = s_f R^T f_world.
Mat3 RotationOf(const Vec3& roll_pitch_yaw_deg) {
  const Vec3 angle = roll_pitch_yaw_deg * (std::numbers::pi / 180);
  return (Eigen::AngleAxisd(angle.z(), Vec3::UnitZ()) *
          Eigen::AngleAxisd(angle.y(), Vec3::UnitY()) * Eigen::AngleAxisd(angle.x(), Vec3::UnitX()))
      .toRotationMatrix();
}

Vec3 InSi(const protocol::ImpulseUnits& units) {
  return ToVec3(protocol::InSi(units));
}

// Sums of what was displayed, from the device and from the published ticks.
class Accounts {
 public:
  Accounts(const Mat3& rotation, const SlideLoops& loops) : rotation_(rotation), loops_(loops) {}

  void Add(const MeasuringDevice& device, const protocol::HapticTick& tick) {
    const protocol::Pointer& pointer = tick.pointers[0];
    const Vec3 position = ToVec3(pointer.position);
    const double world_work = known_ ? force_.dot(position - position_) : 0;
    position_ = position;
    force_ = ToVec3(pointer.force);
    known_ = true;
    const Vec3 impulse = -(rotation_ * device.force()) / loops_.force_scale * kHapticPeriod;
    impulse_ += impulse;
    impulse_squares_ += impulse.squaredNorm();
    flow_ += impulse.norm();
    device_work_ += device.work();
    world_work_ += world_work;
    work_flow_ += std::abs(device.work());
  }

  double BooksError(const CoupledRun& run, bool applies) const {
    const protocol::Books& books = run.haptic_health().books;
    const Vec3 booked = InSi(protocol::Plus(books.displayed, books.ground));
    const Vec3 unaccounted =
        InSi(protocol::Minus(books.displayed, books.covered)) +
        InSi(protocol::Minus(protocol::Minus(books.covered, books.applied), books.discarded));
    double error = (booked - impulse_).norm() + unaccounted.norm();
    const protocol::Body& body = run.world().Bodies()[0];
    if (applies) error += (InSi(books.applied) - body.mass * ToVec3(body.velocity)).norm();
    return std::max(0.0, error - kUnit) / std::max(flow_, kUnit);
  }

  double EnergyError(const CoupledRun& run, bool rides) const {
    const double scale = loops_.force_scale / loops_.motion_scale;
    double error = std::abs(device_work_ - scale * world_work_);
    if (rides) {
      // The kick comes at the start of the tick that its force lasts, and the surface goes with what
      // it made of the velocity: J . v_after is the gain of kinetic energy and J^2/2M more.
      const protocol::Body& block = run.world().Bodies()[0];
      const Vec3 spin = ToVec3(block.angular_velocity);
      const double given = block.mass / 2 * ToVec3(block.velocity).squaredNorm() +
                           FreeInertia() / 2 * spin.squaredNorm() +
                           impulse_squares_ / (2 * block.mass);
      error += std::abs(device_work_ - run.haptic_health().energy.injected + scale * given);
    }
    return error / std::max(work_flow_, std::numeric_limits<double>::min());
  }

 private:
  Mat3 rotation_;
  SlideLoops loops_;
  bool known_ = false;
  Vec3 position_ = Vec3::Zero();  // m, W, of the tick before
  Vec3 force_ = Vec3::Zero();     // N, W
  Vec3 impulse_ = Vec3::Zero();   // N s, W, on the world
  double impulse_squares_ = 0;    // (N s)^2, of single ticks
  double flow_ = 0;               // N s
  double device_work_ = 0;        // J, on the user
  double world_work_ = 0;         // J, likewise, in the world
  double work_flow_ = 0;          // J
};

}  // namespace

SlideResult SimulateSlide(const Slide& slide, const SlideLoops& loops) {
  const double world_period_s = loops.single ? kHapticPeriod : loops.world_period_s;
  const haptic::Settings haptic_settings = HapticSettings(loops, world_period_s);
  const world::Settings world_settings = WorldSettings(slide, loops, world_period_s);
  const world::Scene scene = SlideScene(slide);
  const Mat3 rotation = RotationOf(haptic_settings.mapping.rotation_deg);
  // As in the pushes: the loops have run for a whole world period when the finger starts.
  const auto lead_ticks =
      std::llround(std::ceil(world_period_s / kHapticPeriod - 1e-9)) + loops.latency_ticks;
  MeasuringDevice device(
      [&](double t_s) -> Vec3 {
        return rotation.transpose() * FingerPosition(slide, t_s) / loops.motion_scale;
      },
      CoupledRun::StartNs(haptic_settings) + lead_ticks * haptic_settings.period_ns());
  CoupledRun run(
      haptic_settings, device, world_settings, scene,
      std::make_unique<world::BulletWorld>(scene, world_settings.physics.substep_ms * 1e-3),
      loops.phase_ticks, loops.latency_ticks);
  for (long long k = 0; k < lead_ticks; ++k) run.Tick();

  SlideResult result;
  Accounts accounts(rotation, loops);
  const double allowed_step = haptic::SafetySettings{}.slew_limit_n_per_s * kHapticPeriod;
  const long long ticks = std::llround(Duration(slide) / kHapticPeriod);
  const auto tick = [&](long long k) {
    const bool world_ticked = run.Tick();
    accounts.Add(device, run.haptic_tick());
    result.step_ratio = std::max(result.step_ratio, device.step() / allowed_step);
    const double t_s = static_cast<double>(k) * kHapticPeriod;
    if (t_s >= SlideStart(slide) && t_s < SlideEnd(slide)) result.force.push_back(device.force());
    result.sound = result.sound && device.force().allFinite();
    return world_ticked;
  };
  // Until the haptic side has seen what the world made of every impulse of the script.
  const long long shown = ticks + lead_ticks + 2;
  for (long long k = 0; !(tick(k) && k >= shown); ++k) {
  }
  const bool is_free = slide.script == SlideScript::kFree;
  const bool applies = loops.single || loops.coupling != protocol::Coupling::kPosition;
  const bool rides = !loops.single && loops.coupling == protocol::Coupling::kLocal;
  result.books_error = accounts.BooksError(run, is_free && applies);
  result.energy_error = accounts.EnergyError(run, is_free && rides);
  return result;
}

SlideComparison CompareSlides(const Slide& slide, SlideLoops loops, int phases) {
  SlideLoops at_single_rate = loops;
  at_single_rate.single = true;
  at_single_rate.latency_ticks = at_single_rate.phase_ticks = 0;
  const SlideResult single = SimulateSlide(slide, at_single_rate);
  SlideComparison all;
  const auto add = [&](const SlideResult& run) {
    all.step_ratio = std::max(all.step_ratio, run.step_ratio);
    all.books_error = std::max(all.books_error, run.books_error);
    all.energy_error = std::max(all.energy_error, run.energy_error);
    all.sound = all.sound && run.sound;
  };
  add(single);
  const auto ticks = static_cast<double>(single.force.size());
  for (const Vec3& force : single.force) all.single_rms_n += force.squaredNorm() / ticks;
  all.single_rms_n = std::sqrt(all.single_rms_n);

  const double ticks_per_period = std::round(loops.world_period_s / kHapticPeriod);
  for (int i = 0; i < phases; ++i) {
    loops.phase_ticks = static_cast<int>(std::lround(i * ticks_per_period / phases));
    const SlideResult run = SimulateSlide(slide, loops);
    add(run);
    for (std::size_t k = 0; k < run.force.size(); ++k) {
      const double error = (run.force[k] - single.force[k]).norm();
      all.force_error_rms_n += error * error / (ticks * phases);
      all.force_error_peak_n = std::max(all.force_error_peak_n, error);
    }
  }
  all.force_error_rms_n = std::sqrt(all.force_error_rms_n);
  return all;
}

}  // namespace rikiseki::lab
