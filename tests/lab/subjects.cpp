// SPDX-License-Identifier: MIT
#include "tests/lab/subjects.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>
#include <random>
#include <stdexcept>
#include <vector>

#include "tests/lab/block_push.h"
#include "tests/lab/choose.h"
#include "tests/lab/coupling_column.h"

namespace rikiseki::lab {
namespace {

constexpr double kMark = 0.3;        // m, where the cube should stop
constexpr double kDuration = 2;      // s, of one trial
constexpr double kHome = -0.05;      // m
constexpr double kAmplitude = 0.15;  // m, of a first push
constexpr double kReach = 0.25;      // s
constexpr double kHold = 0.05;       // s
// Relative, one standard deviation; of the start in m.
constexpr double kAmplitudeNoise = 0.04;
constexpr double kDurationNoise = 0.03;
constexpr double kStartNoise = 0.002;
constexpr double kHandNoise = 0.05;
constexpr double kRunaway = 100;  // m

// numerics section 4, the device included.
constexpr Named<haptic::Impedance> kSubjectHands[] = {
    {"light", {0.13, 2.2, 50}}, {"medium", {0.58, 6.7, 135}}, {"firm", {0.93, 15.2, 500}}};

// The same numbers with every standard library.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}

  double Uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double Normal() {  // Box and Muller
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(2 * std::numbers::pi * Uniform());
  }
  double Around(double value, double relative) { return value * (1 + relative * Normal()); }

 private:
  std::mt19937_64 random_;
};

struct Subject {
  BlockPush push;  // but for the phase
  haptic::Impedance hand;
  int trials = 30;
};

haptic::Hand TrialHand(const Subject& subject, double skill, Noise& noise) {
  const double home = kHome + kStartNoise * noise.Normal();
  const double amplitude = noise.Around(kAmplitude * skill, kAmplitudeNoise);
  const double reach_s = noise.Around(kReach, kDurationNoise);
  const haptic::Impedance hand{noise.Around(subject.hand.mass_kg, kHandNoise),
                               noise.Around(subject.hand.damping_ns_per_m, kHandNoise),
                               noise.Around(subject.hand.stiffness_n_per_m, kHandNoise)};
  const Vec3 start(home, 0, 0);
  const Vec3 far(home + amplitude, 0, 0);
  return {haptic::MotorProgram(
              {.home = start, .strokes = {{far, reach_s}, {far, kHold}, {start, reach_s}}}),
          hand};
}

// Where the cube stopped in each trial [m].
std::vector<double> RunTrials(const Subject& subject, std::uint64_t seed) {
  Noise noise(seed);
  double skill = 1;
  std::vector<double> stops;
  for (int trial = 0; trial < subject.trials; ++trial) {
    BlockPush push = subject.push;
    const double ticks = std::round(push.world_period_s / push.haptic_period_s);
    push.phase_ticks = static_cast<int>(noise.Uniform() * ticks);
    const PreparedRun prepared = PrepareBlockPush(push, TrialHand(subject, skill, noise));
    for (long long k = 0; k < std::llround(kDuration / push.haptic_period_s); ++k) {
      prepared.loops->Tick();
    }
    const double stop = prepared.loops->world().Bodies()[0].position[0];
    stops.push_back(stop);
    if (!std::isfinite(stop)) return stops;
    const double correction = 1 - 0.5 * (stop - kMark) / (2 * std::max(stop, 0.1));
    skill = std::clamp(skill * std::clamp(correction, 0.7, 1.3), 0.3, 4.0);
  }
  return stops;
}

Outcome RunRow(const Row& row, std::uint64_t seed) {
  Subject subject;
  subject.hand = Choose(row, "hand", kSubjectHands);
  subject.push.coupling = Choose(row, "coupling", kCouplings);
  subject.push.world = PushedWorld::kSemiImplicitSlide;
  subject.push.friction = 0.3;
  subject.push.mass_kg = row.Number("mass_kg", 1e-3, 1e3);
  subject.push.world_period_s = row.Number("Tw_s", 1e-3, 1);
  subject.trials = row.Integer("trials", 2, 1000);
  const int scored = std::min(subject.trials, row.Integer("scored", 2, 1000));
  const int number = row.Integer("subject", 1, 1'000'000);
  std::vector<double> stops;
  try {
    // The same person with every coupling.
    stops = RunTrials(subject, seed * 1'000'003 + static_cast<std::uint64_t>(number));
  } catch (const std::invalid_argument& error) {
    row.Refuse("Tw_s", error.what());
  }
  double mean = 0, squares = 0;
  bool runaway = stops.size() < static_cast<std::size_t>(subject.trials);
  std::string text;
  for (std::size_t i = 0; i < stops.size(); ++i) {
    text.append(i == 0 ? "" : " ").append(ToField(stops[i]));
    runaway = runaway || !(std::abs(stops[i]) < kRunaway);
  }
  const auto first = stops.size() - std::min(stops.size(), static_cast<std::size_t>(scored));
  const auto count = static_cast<double>(stops.size() - first);
  for (std::size_t i = first; i < stops.size(); ++i) mean += stops[i] / count;
  for (std::size_t i = first; i < stops.size(); ++i) squares += std::pow(stops[i] - mean, 2);
  return {runaway ? RowStatus::kUnstable : RowStatus::kOk,
          {mean, std::sqrt(squares / (count - 1))},
          {text}};
}

void AppendSubjects(Table& table, const char* hand, double mass_kg, double world_period_s,
                    int subjects) {
  for (const auto& coupling : kCouplings) {
    for (int subject = 1; subject <= subjects; ++subject) {
      table.Append({hand, ToField(mass_kg), coupling.name, ToField(world_period_s), "30", "20",
                    std::to_string(subject)});
    }
  }
}

Table Grid(bool quick) {
  Table table("the grid of fig9",
              {"hand", "mass_kg", "coupling", "Tw_s", "trials", "scored", "subject"});
  AppendSubjects(table, "medium", 1, 0.05, quick ? 4 : 16);
  if (quick) return table;
  AppendSubjects(table, "medium", 2, 0.05, 16);
  AppendSubjects(table, "firm", 1, 0.05, 16);
  // Paper 5.4: how slow the world may be.
  for (const double world_period_s : {0.016, 0.033, 0.1, 0.2}) {
    AppendSubjects(table, "medium", 1, world_period_s, 16);
  }
  return table;
}

void Summarise(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out) {
  out << "Where the cube stopped in the scored trials [cm]: mean, SD\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (outcomes[i].values.size() != 2) continue;
    const Row row = rows.row(i);
    out << row.Text("hand") << " " << row.Text("mass_kg") << " kg, Tw " << row.Text("Tw_s")
        << " s, " << row.Text("coupling") << ", subject " << row.Text("subject") << ": "
        << 100 * outcomes[i].values[0] << ", " << 100 * outcomes[i].values[1] << "\n";
  }
}

}  // namespace

Case Subjects() {
  Case study;
  study.name = "fig9";
  study.purpose =
      "simulated subjects push a cube to the 30 cm mark and learn (--seed: of the noise)";
  study.results = {{"stop_mean_m"}, {"stop_sd_m"}, {"stops_m"}};
  study.grid = Grid;
  study.run = RunRow;
  study.summarise = Summarise;
  return study;
}

}  // namespace rikiseki::lab
