// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/lab/report/sections.h"

namespace rikiseki::lab {
namespace {

const std::vector<std::pair<std::string, std::string>> kSystems = {
    {"P", "P: a light hand pokes a block of 0.5 kg"},
    {"H", "H: a firm hand pushes a block of 2 kg"},
    {"offcentre", "A cube of 0.5 kg, pushed 10 mm off its middle"},
    {"corner", "A cube of 0.5 kg, the finger pressed to the floor"},
    {"stack", "A cube of 0.5 kg with 0.25 kg on top"}};
const std::vector<double> kBudgets = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2};  // CPU s/s

using Rows = std::vector<const ResultRow*>;

Rows Of(const std::vector<ResultRow>& all, const std::string& system,
        const std::string& coupling = "") {
  Rows rows;
  for (const ResultRow& row : all) {
    if (row.Text("system") == system && (coupling.empty() || row.Text("coupling") == coupling)) {
      rows.push_back(&row);
    }
  }
  return rows;
}

double Error(const ResultRow& row) {
  return 1e3 * row.Got("continuous_rms_m");
}

double Cpu(const ResultRow& row) {
  const auto found = row.got.find("cpu_s_per_s");  // of what diverged, too
  return found == row.got.end() ? 0 : 100 * found->second;
}

// What nothing is both cheaper and better than.
std::vector<PlotPoint> ParetoFront(Rows rows, double (*cost)(const ResultRow&)) {
  std::erase_if(rows, [](const ResultRow* row) { return !std::isfinite(Error(*row)); });
  std::sort(rows.begin(), rows.end(),
            [&](const ResultRow* a, const ResultRow* b) { return cost(*a) < cost(*b); });
  std::vector<PlotPoint> front;
  double best = std::numeric_limits<double>::infinity();
  for (const ResultRow* row : rows) {
    if (Error(*row) >= best) continue;
    if (!front.empty()) front.push_back({cost(*row), best});  // a staircase
    best = Error(*row);
    front.push_back({cost(*row), best});
  }
  return front;
}

Plot ErrorAgainst(const std::string& title, const std::string& cost_label, const Rows& rows,
                  double (*cost)(const ResultRow&)) {
  Plot plot{.title = title,
            .x = {.label = cost_label, .logarithmic = true},
            .y = {.label = "RMS error of the final place, mm", .logarithmic = true}};
  for (std::size_t i = 0; i < kCouplingNames.size(); ++i) {
    Series series{.label = kCouplingNames[i], .colour = static_cast<int>(i)};
    for (const ResultRow* row : rows) {
      if (row->Text("coupling") == kCouplingNames[i]) {
        series.points.push_back({cost(*row), Error(*row)});
      }
    }
    plot.series.push_back(series);
  }
  plot.series.push_back({.label = "Pareto front",
                         .colour = 5,
                         .mark = Mark::kDotted,
                         .points = ParetoFront(rows, cost)});
  return plot;
}

double Bytes(const ResultRow& row) {
  const auto found = row.got.find("bytes_per_s");
  return found == row.got.end() ? 0 : found->second;
}

// The best run of a coupling that costs at most this; none where all cost more or diverge.
const ResultRow* BestWithin(const Rows& rows, double cpu_percent,
                            double (*error)(const ResultRow&) = Error) {
  const ResultRow* best = nullptr;
  for (const ResultRow* row : rows) {
    if (Cpu(*row) > cpu_percent || !std::isfinite(error(*row))) continue;
    if (best == nullptr || error(*row) < error(*best)) best = row;
  }
  return best;
}

double SplitError(const ResultRow& row) {
  return 1e3 * row.Got("split_rms_m");
}

// Without what the haptic period itself gets wrong, which may cancel what a split does.
void WriteSplitBudgets(const std::vector<ResultRow>& all, Html& page) {
  std::size_t cells = 0, won = 0;
  for (const auto& [system, title] : kSystems) {
    for (const double budget : kBudgets) {
      const ResultRow* any = BestWithin(Of(all, system), 100 * budget, SplitError);
      if (any == nullptr) continue;
      ++cells;
      won += any->Text("coupling") == "local" ? 1 : 0;
    }
  }
  page.Paragraph(
      "Of what the split alone does, the error against a single rate of the same haptic "
      "period, that of local is the smallest in " +
      std::to_string(won) + " of " + std::to_string(cells) +
      " cells. An error that another one cancels is luck: it is gone with another mass, hand "
      "or speed.");
}

std::string How(const ResultRow& row) {
  std::string text =
      Short(1e3 * row.Number("T_s")) + " / " + Short(1e3 * row.Number("Tw_s")) + " ms";
  const std::string display = row.Text("display");
  if (row.Text("coupling") == "impulse" && !display.empty()) text += ", " + display;
  if (row.Text("body_step") == "semi_implicit") text += ", semi-implicit";
  return text;
}

// Why another coupling came out ahead, from what the rows hold.
std::string Why(const Rows& locals, const ResultRow* local, const ResultRow& winner) {
  if (local == nullptr) {
    double cheapest = std::numeric_limits<double>::infinity();
    for (const ResultRow* row : locals) cheapest = std::min(cheapest, Cpu(*row));
    return "the cheapest run with local costs " + Short(cheapest) +
           " %: copies of bodies and the replay of every tick are not free";
  }
  const double split = 1e3 * local->Got("split_rms_m");
  const double winner_split = 1e3 * winner.Got("split_rms_m");
  const std::string winner_name = winner.Text("coupling");
  if (split < winner_split) {
    return "the split costs local " + Short(split) + " mm and " + winner_name + " " +
           Short(winner_split) + " mm, but a haptic period of " +
           Short(1e3 * local->Number("T_s")) + " ms has an error of its own, which that of " +
           winner_name + " happens to cancel here";
  }
  return "its split costs " + Short(split) + " mm there, that of " + winner_name + " " +
         Short(winner_split) + " mm";
}

// What holds at several budgets is said once.
struct Exception {
  std::string system;
  std::string text;
  double from;
  double to;
};

void WriteBudgets(const std::vector<ResultRow>& all, Html& page) {
  page.Subheading("The best that each coupling does within a CPU budget");
  page.Paragraph(
      "Error in mm of the best run that costs at most so much of one core (haptic and world loop "
      "and the simulated finger together), and behind it its haptic and world period. The smallest "
      "of a line is marked *.");
  std::vector<Exception> exceptions;
  std::size_t cells = 0;
  std::size_t lost = 0;
  for (const auto& [system, title] : kSystems) {
    std::vector<std::vector<std::string>> lines;
    for (const double budget : kBudgets) {
      std::vector<const ResultRow*> best;
      double least = std::numeric_limits<double>::infinity();
      for (const std::string& coupling : kCouplingNames) {
        best.push_back(BestWithin(Of(all, system, coupling), 100 * budget));
        if (best.back() != nullptr) least = std::min(least, Error(*best.back()));
      }
      std::vector<std::string> line = {Short(100 * budget) + " %"};
      for (const ResultRow* row : best) {
        line.push_back(row == nullptr ? "-"
                                      : Short(Error(*row)) + (Error(*row) == least ? " *" : "") +
                                            "  (" + How(*row) + ")");
      }
      lines.push_back(line);
      if (!std::isfinite(least)) continue;
      ++cells;
      const ResultRow* local = best[2];
      if (local != nullptr && Error(*local) <= least) continue;
      const std::size_t winner = best[0] != nullptr && Error(*best[0]) == least ? 0 : 1;
      const std::string text = kCouplingNames[winner] + " " + Short(least) + " mm, local " +
                               (local == nullptr ? "none" : Short(Error(*local)) + " mm") + ": " +
                               Why(Of(all, system, "local"), local, *best[winner]) + ".";
      ++lost;
      if (!exceptions.empty() && exceptions.back().system == system &&
          exceptions.back().text == text) {
        exceptions.back().to = budget;
      } else {
        exceptions.push_back({system, text, budget, budget});
      }
    }
    page.Paragraph(title);
    page.Table({"budget", "position", "impulse", "local"}, lines);
  }
  page.Paragraph("Local has the smallest error in " + std::to_string(cells - lost) + " of " +
                 std::to_string(cells) + " cells in which any coupling works." +
                 (lost == 0 ? "" : " Where it has not, and why:"));
  std::vector<std::string> items;
  for (const Exception& exception : exceptions) {
    std::string where = exception.system + " at " + Short(100 * exception.from) + " %";
    if (exception.to > exception.from) where += " to " + Short(100 * exception.to) + " %";
    items.push_back(where + ": " + exception.text);
  }
  if (!items.empty()) page.List(items);
  WriteSplitBudgets(all, page);
}

void WriteWorldPeriods(const std::vector<ResultRow>& all, Html& page) {
  std::vector<Plot> plots;
  for (const auto& [system, title] : kSystems) {
    Plot plot{.title = title,
              .x = {.label = "world period Tw, s (haptics at 1 kHz)", .logarithmic = true},
              .y = {.label = "RMS error against a single rate, mm", .logarithmic = true}};
    int colour = 0;
    for (const auto& [coupling, display, label] :
         {std::tuple("position", "interpolate", "position"),
          std::tuple("impulse", "interpolate", "impulse, interpolated"),
          std::tuple("local", "", "local"), std::tuple("impulse", "hold", "impulse, held")}) {
      Series series{.label = label, .colour = colour++, .mark = Mark::kLine};
      for (const ResultRow* row : Of(all, system, coupling)) {
        if (row->Text("display") != display || row->Number("T_s") != 1e-3 ||
            row->Text("body_step") == "semi_implicit" ||
            (!row->Text("substep_s").empty() && row->Number("substep_s") != 1e-3)) {
          continue;
        }
        // Below a micrometre nothing is told apart.
        series.points.push_back(
            {row->Number("Tw_s"), std::max(1e-3, 1e3 * row->Got("split_rms_m"))});
      }
      std::sort(series.points.begin(), series.points.end(),
                [](const PlotPoint& a, const PlotPoint& b) { return a.x < b.x; });
      plot.series.push_back(series);
    }
    plots.push_back(plot);
  }
  page.Subheading("The split alone: error against the world's period");
  page.Figures(plots);
}

void WriteEngine(const std::vector<ResultRow>& rows, Html& page) {
  page.Subheading("The engine's own error");
  page.Paragraph(
      "What no coupling can mend: a slide from 2 m/s and a spin from 30 rad/s on a floor against "
      "their closed forms, a free body that tumbles about its unstable axis for 2 s against an "
      "integration of Euler's equations, and how far stacks move in 5 s after a nudge of 1 cm/s.");
  std::vector<Plot> plots;
  for (const auto& [scenario, unit] :
       {std::pair("slide", "m"), std::pair("spin", "rad"), std::pair("tumble", "rad")}) {
    Plot plot{.title = scenario,
              .x = {.label = "CPU, % of a core", .logarithmic = true},
              .y = {.label = std::string("error, ") + unit, .logarithmic = true}};
    Series series{.mark = Mark::kDots};
    for (const ResultRow& row : rows) {
      if (row.Text("scenario") != scenario) continue;
      series.points.push_back({Cpu(row), std::max(1e-12, row.Got("error"))});
    }
    plot.series.push_back(series);
    plots.push_back(plot);
  }
  page.Figures(plots);
  std::vector<std::vector<std::string>> lines;
  for (const ResultRow& row : rows) {
    const std::string scenario = row.Text("scenario");
    const bool is_stack = scenario == "stack";
    const bool is_way = is_stack || scenario == "slide";
    const double error = row.Got("error");
    lines.push_back(
        {is_stack ? "stack of " + row.Text("bodies") + ", topmost " + row.Text("mass_ratio") +
                        " times as heavy"
                  : scenario,
         Short(1e3 * row.Number("substep_s")) + " ms",
         std::isfinite(error) ? Short(1e3 * error) + (is_way ? " mm" : " mrad") : "fell",
         Short(Cpu(row)) + " %"});
  }
  page.Table({"scenario", "substep", "error", "CPU of a core"}, lines);
  Repeat("engine-error", "engine-error", rows, page);
}

}  // namespace

void WriteError(const Results& results, Html& page) {
  page.Heading("Error against run time", "error");
  const std::vector<ResultRow>& rows = RowsOf(results, "error-vs-runtime");
  if (rows.empty()) {
    page.Warning("The study error-vs-runtime was not run.");
    return;
  }
  page.Paragraph(
      "Five pushes, each over several sampling phases of the world. The truth is the same push "
      "with "
      "haptics, world and engine at 20 us; a cross on the upper edge is a run that diverged. CPU "
      "is "
      "this computer's, of one core, the median over the phases.");
  std::vector<Plot> by_cpu;
  std::vector<Plot> by_bytes;
  for (const auto& [system, title] : kSystems) {
    by_cpu.push_back(ErrorAgainst(title, "CPU, % of a core", Of(rows, system), Cpu));
    by_bytes.push_back(
        ErrorAgainst(title, "bytes exchanged per world second", Of(rows, system), Bytes));
  }
  page.Figures(by_cpu);
  WriteBudgets(rows, page);
  WriteWorldPeriods(rows, page);
  page.Subheading("Error against what is sent");
  page.Figures(by_bytes);
  page.Subheading("All runs");
  page.Paragraph(
      "Ticks are timed by the wall clock of a computer that may do other things meanwhile: p50 is "
      "the "
      "tick, p99.9 also what disturbed it.");
  std::vector<std::vector<std::string>> lines;
  for (const ResultRow& row : rows) {
    std::vector<std::string> line = {row.Text("system") + " " + row.Text("coupling") + " " +
                                     row.Text("display") + row.Text("body_step")};
    for (const char* column : {"T_s", "Tw_s", "substep_s"}) {
      const double value = 1e3 * row.Number(column);
      line.push_back(std::isnan(value) ? "" : Short(value));
    }
    if (row.diverged()) {
      line.insert(line.end(), {"diverged", "", "", "", "", "", "", ""});
    } else {
      line.insert(line.end(),
                  {Short(Error(row)), Short(1e3 * row.Got("split_rms_m")),
                   Short(1e3 * row.Got("split_bias_m")), Short(1e3 * row.Got("split_sd_m")),
                   Short(row.Got("impulse_rms_ns")), Short(row.Got("force_rms_n")),
                   Short(1e3 * row.Got("injected_j")), Short(1e3 * row.Got("jump_m"))});
    }
    line.insert(line.end(), {Short(Cpu(row)), Short(row.got.at("haptic_p50_us")),
                             Short(row.got.at("haptic_p999_us"))});
    lines.push_back(line);
  }
  page.FoldedTable(std::to_string(rows.size()) + " runs, a line each",
                   {"run", "T ms", "Tw ms", "substep ms", "error mm", "of the split mm",
                    "its bias mm", "its SD mm", "impulse N s", "force RMS N", "injected mJ",
                    "jump mm", "CPU %", "tick us p50", "p99.9"},
                   lines);
  Repeat("error-vs-runtime", "error-vs-runtime", rows, page);
  if (const auto& engine = RowsOf(results, "engine-error"); !engine.empty()) {
    WriteEngine(engine, page);
  }
}

}  // namespace rikiseki::lab
