// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/lab/report/error_rows.h"

namespace rikiseki::lab {
namespace {

// What nothing is both cheaper and better than.
std::vector<PlotPoint> ParetoFront(ErrorRows rows, double (*cost)(const ResultRow&)) {
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

Plot ErrorAgainst(const std::string& title, const std::string& cost_label, const ErrorRows& rows,
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

void WriteWorldPeriods(const std::vector<ResultRow>& all, Html& page) {
  std::vector<Plot> plots;
  for (const auto& [system, title] : kErrorSystems) {
    Plot plot{.title = title,
              .x = {.label = "world period Tw, s (haptics at 1 kHz)", .logarithmic = true},
              .y = {.label = "RMS error against a single rate, mm", .logarithmic = true}};
    int colour = 0;
    for (const auto& [coupling, display, label] :
         {std::tuple("position", "interpolate", "position"),
          std::tuple("impulse", "interpolate", "impulse, interpolated"),
          std::tuple("local", "", "local"), std::tuple("impulse", "hold", "impulse, held")}) {
      Series series{.label = label, .colour = colour++, .mark = Mark::kLine};
      for (const ResultRow* row : ErrorRowsOf(all, system, coupling)) {
        if (row->Text("display") != display || row->Number("T_s") != 1e-3 ||
            row->Text("body_step") == "semi_implicit" ||
            (!row->Text("substep_s").empty() && row->Number("substep_s") != 1e-3)) {
          continue;
        }
        // Below a micrometre nothing is told apart.
        series.points.push_back({row->Number("Tw_s"), std::max(1e-3, SplitError(*row))});
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
  for (const auto& [system, title] : kErrorSystems) {
    by_cpu.push_back(ErrorAgainst(title, "CPU, % of a core", ErrorRowsOf(rows, system), Cpu));
    by_bytes.push_back(
        ErrorAgainst(title, "bytes exchanged per world second", ErrorRowsOf(rows, system), Bytes));
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
                  {Short(Error(row)), Short(SplitError(row)), Short(1e3 * row.Got("split_bias_m")),
                   Short(1e3 * row.Got("split_sd_m")), Short(row.Got("impulse_rms_ns")),
                   Short(row.Got("force_rms_n")), Short(1e3 * row.Got("injected_j")),
                   Short(1e3 * row.Got("jump_m"))});
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
