// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "tests/lab/report/sections.h"

namespace rikiseki::lab {
namespace {

constexpr double kLeastDrawn = 1e-4;  // kg
constexpr double kMostDrawn = 100;

std::string WallName(const ResultRow& row) {
  return "m " + row.Text("m_kg") + " kg, b " + row.Text("b_Ns_m") + " Ns/m";
}

// One figure for each device: K_max against the rate.
void WriteWalls(const std::vector<ResultRow>& rows, Html& page) {
  page.Subheading("How stiff a wall may be");
  page.Paragraph(
      "The largest stiffness for which a small deviation from a steady contact dies out, by the "
      "eigenvalues of the loop that ships (device mass m and damping b, wall damping B, held "
      "force). "
      "Dotted: the linear rule of Gil and Hulin, K < (b + B)/(T/2 + d T). Every point with "
      "K T^2/m > 0.001 is also run: stable at 0.97 and diverging at 1.03 of it.");
  std::vector<std::string> devices;
  for (const ResultRow& row : rows) {
    const std::string name = WallName(row);
    const bool is_pair = row.Text("b_Ns_m") == "35.2";  // Love & Book, below
    if (!is_pair && std::find(devices.begin(), devices.end(), name) == devices.end()) {
      devices.push_back(name);
    }
  }
  std::vector<Plot> plots;
  for (const std::string& device : devices) {
    Plot plot{.title = device,
              .x = {.label = "haptic rate, Hz", .logarithmic = true},
              .y = {.label = "largest stable stiffness, N/m", .logarithmic = true}};
    int colour = 0;
    for (const char* damping : {"0", "2", "10"}) {
      for (const char* delay : {"0", "1"}) {
        const bool late = std::string(delay) == "1";
        Series measured{
            .label = std::string("B ") + damping + " Ns/m" + (late ? ", a tick late" : ""),
            .colour = colour,
            .mark = Mark::kLine};
        Series rule{.colour = colour++, .mark = Mark::kDotted};
        for (const ResultRow& row : rows) {
          if (WallName(row) != device || row.Text("B_Ns_m") != damping ||
              row.Text("delay_samples") != delay) {
            continue;
          }
          const double rate = 1 / row.Number("T_s");
          const double largest = row.Got("Kmax_eig_N_m");
          if (largest > 0) measured.points.push_back({rate, largest});
          const double linear = row.Got("Kmax_gil_linear_N_m");
          if (linear > 0) rule.points.push_back({rate, linear});
        }
        plot.series.push_back(measured);
        plot.series.push_back(rule);
      }
    }
    plots.push_back(plot);
  }
  page.Figures(plots);
  std::size_t simulated = 0, bracketed = 0;
  for (const ResultRow& row : rows) {
    const auto verdict = row.texts.find("sim_bracketed");
    if (verdict == row.texts.end() || verdict->second.empty()) continue;
    ++simulated;
    if (verdict->second == "1") ++bracketed;
  }
  page.Paragraph("Both sides of the edge were run for " + std::to_string(simulated) +
                 " of the walls; in " + std::to_string(bracketed) + " the run agreed.");
  std::vector<std::vector<std::string>> pair;
  for (const ResultRow& row : rows) {
    if (row.Text("b_Ns_m") != "35.2") continue;
    pair.push_back({Short(1 / row.Number("T_s")) + " Hz, " + row.Text("m_kg") + " kg",
                    Value(1e-3 * row.Got("Kmax_eig_N_m"), " kN/m"),
                    row.Number("T_s") > 5e-3 ? "6.7 kN/m" : "70 kN/m"});
  }
  if (!pair.empty()) {
    page.Paragraph(
        "The pair that the paper quotes from Love and Book, 6.7 kN/m at 100 Hz and 70 kN/m at 1 "
        "kHz, "
        "is a heavy manipulator: b + B = 35.2 Ns/m.");
    page.Table({"rate and mass", "computed", "quoted"}, pair);
  }
  Repeat("wall", "wall", rows, page);
}

bool IsUsual(const ResultRow& row) {
  return row.Number("T_s") == 1e-3 && row.Number("kp_N_m") == 2000;
}

const std::vector<std::pair<std::string, std::string>> kMethods = {
    {"conv", "position"}, {"impulse_interp", "impulse"}, {"local_AUTH", "local"}};

void WriteMassMap(const std::vector<ResultRow>& rows, Html& page) {
  page.Subheading("How light an object may be");
  page.Paragraph(
      "Bars: masses of the object for which a lasting contact is stable, at 2 kN/m, 2 Ns/m and 1 "
      "kHz, "
      "against the world's period; with nothing drawn a contact is unstable. Dotted: what theory "
      "says "
      "of position and a finger that cannot yield, M > k Tw^2/4; and of local, M > k T^2/4 + d "
      "T/2, "
      "which no world period enters. Impulse with interpolated planes needs d > k Tw/2 (50 Ns/m at "
      "20 Hz) there, and has it nowhere here: what is stable is so because the hand yields.");
  std::vector<Plot> plots;
  for (const char* hand : {"light", "medium", "firm"}) {
    for (std::size_t i = 0; i < kMethods.size(); ++i) {
      Plot plot{.title = kMethods[i].second + ", " + hand + " hand",
                .x = {.label = "world period, s", .logarithmic = true, .low = 0.004, .high = 0.25},
                .y = {.label = "mass of the object, kg",
                      .logarithmic = true,
                      .low = kLeastDrawn,
                      .high = kMostDrawn}};
      Series stable{.label = "stable", .colour = static_cast<int>(i), .mark = Mark::kBars};
      Series theory{.label = "theory", .colour = 5, .mark = Mark::kDotted};
      for (const ResultRow& row : rows) {
        if (row.Text("method") != kMethods[i].first || row.Text("hand") != hand || !IsUsual(row)) {
          continue;
        }
        const double period_s = row.Number("Tw_s");
        for (const MassInterval& interval : StableIntervals(row)) {
          stable.points.push_back({period_s, interval.from_kg});
          stable.tops.push_back(interval.to_kg);
        }
        if (i == 0) theory.points.push_back({period_s, 2000 * period_s * period_s / 4});
        if (i == 2) theory.points.push_back({period_s, 2000 * 1e-6 / 4 + 2 * 1e-3 / 2});
      }
      plot.series.push_back(stable);
      if (!theory.points.empty()) plot.series.push_back(theory);
      plots.push_back(plot);
    }
  }
  page.Figures(plots);
}

void WriteMassTable(const std::string& title, const std::string& what,
                    const std::vector<const ResultRow*>& rows, const char* column, double scale,
                    const std::string& unit, Html& page) {
  page.Paragraph(title);
  std::vector<std::vector<std::string>> lines;
  for (const ResultRow* row : rows) {
    lines.push_back(
        {row->Text("method"), Short(scale * row->Number(column)) + unit, StableMasses(*row)});
  }
  page.Table({"method", what, "stable masses, kg"}, lines);
}

void WriteMasses(const std::vector<ResultRow>& rows, Html& page) {
  WriteMassMap(rows, page);
  std::vector<const ResultRow*> stiffness;
  std::vector<const ResultRow*> rate;
  for (const ResultRow& row : rows) {
    if (row.Number("kp_N_m") != 2000) stiffness.push_back(&row);
    if (row.Number("T_s") != 1e-3) rate.push_back(&row);
  }
  WriteMassTable(
      "Stiffness from soft to hard, medium hand, 20 Hz world, 2 Ns/m (local_M1_implicit: with the "
      "implicit body step, which what ships takes by itself where the explicit one would not "
      "hold). "
      "Where local is stable for no mass the wall itself is not: b + d > k T/2 is missed.",
      "stiffness", stiffness, "kp_N_m", 1, " N/m", page);
  WriteMassTable("The haptic rate, medium hand, 10 Hz world, 2 kN/m, 2 Ns/m.", "haptic period",
                 rate, "T_s", 1e3, " ms", page);
  Repeat("multirate", "masses", rows, page);
}

void WriteExtremes(const std::vector<ResultRow>& rows, Html& page) {
  page.Subheading("Extremes, and what the run-time detector said");
  std::size_t unsafe = 0;
  std::map<std::string, std::array<std::size_t, 5>> counts;  // by coupling
  std::vector<std::vector<std::string>> wrong;
  for (const ResultRow& row : rows) {
    const bool safe = row.Got("finite") == 1 && row.Got("cap_ok") == 1 && row.Got("slew_ok") == 1;
    unsafe += safe ? 0 : 1;
    auto& count = counts[row.Text("coupling")];
    const double unstable = row.Got("unstable");
    if (row.Text("event") != "slot") continue;
    if (std::isnan(unstable)) {
      ++count[4];
    } else {
      const std::size_t place = unstable == 1 ? 0 : 2;
      ++count[place];
      if (row.Got("flagged") == 1) ++count[place + 1];
    }
    if (row.Got("flag_ok") == 1) continue;
    wrong.push_back(
        {row.Text("coupling") + " " + row.Text("haptic_hz") + "/" + row.Text("world_hz") + " Hz",
         row.Text("kp"), row.Text("M"), Value(row.Got("growth")),
         unstable == 1 ? "unstable" : "stable", row.Got("flagged") == 1 ? "unstable" : "stable"});
  }
  page.Paragraph(
      "A finger at 1e6 m/s, at 1e8 m, samples that are no numbers, denormal penetrations, a silent "
      "world, and contacts from 10 N/m to 100 kN/m with bodies from 0.1 g to 10 t: of " +
      std::to_string(rows.size()) + " runs, " + std::to_string(unsafe) +
      " let out anything that was not finite, above the cap or beyond the slew limit.");
  std::vector<std::vector<std::string>> lines;
  for (const auto& [coupling, count] : counts) {
    lines.push_back({coupling, std::to_string(count[0]), std::to_string(count[1]),
                     std::to_string(count[2]), std::to_string(count[3]), std::to_string(count[4])});
  }
  page.Paragraph(
      "Contacts that never end, judged by the linear loop (growth per world period above 1.02: "
      "unstable, below 0.98: stable, between: not judged) and, independently, by the energy meter "
      "while they ran:");
  page.Table({"coupling", "unstable", "of which flagged", "stable", "of which flagged", "between"},
             lines);
  if (!wrong.empty()) {
    page.Warning("The detector was wrong here:");
    page.Table({"run", "k N/m", "M kg", "growth", "theory", "detector"}, wrong);
  }
  Repeat("extremes", "extremes", rows, page);
}

}  // namespace

void WriteStability(const Results& results, Html& page) {
  page.Heading("Stability", "stability");
  if (const auto& rows = RowsOf(results, "wall"); !rows.empty()) WriteWalls(rows, page);
  if (const auto& rows = RowsOf(results, "masses"); !rows.empty()) WriteMasses(rows, page);
  if (const auto& rows = RowsOf(results, "extremes"); !rows.empty()) WriteExtremes(rows, page);
}

}  // namespace rikiseki::lab
