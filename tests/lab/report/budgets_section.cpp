// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include "tests/lab/report/error_rows.h"

namespace rikiseki::lab {
namespace {

const std::vector<double> kBudgets = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2};  // CPU s/s

// The best run of a coupling that costs at most this; none where all cost more or diverge.
const ResultRow* BestWithin(const ErrorRows& rows, double cpu_percent,
                            double (*error)(const ResultRow&) = Error) {
  const ResultRow* best = nullptr;
  for (const ResultRow* row : rows) {
    if (Cpu(*row) > cpu_percent || !std::isfinite(error(*row))) continue;
    if (best == nullptr || error(*row) < error(*best)) best = row;
  }
  return best;
}

// Without what the haptic period itself gets wrong, which may cancel what a split does.
void WriteSplitBudgets(const std::vector<ResultRow>& all, Html& page) {
  std::size_t cells = 0, won = 0;
  for (const auto& [system, title] : kErrorSystems) {
    for (const double budget : kBudgets) {
      const ResultRow* any = BestWithin(ErrorRowsOf(all, system), 100 * budget, SplitError);
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
std::string Why(const ErrorRows& locals, const ResultRow* local, const ResultRow& winner) {
  if (local == nullptr) {
    double cheapest = std::numeric_limits<double>::infinity();
    for (const ResultRow* row : locals) cheapest = std::min(cheapest, Cpu(*row));
    return "the cheapest run with local costs " + Short(cheapest) +
           " %: copies of bodies and the replay of every tick are not free";
  }
  const double split = SplitError(*local);
  const double winner_split = SplitError(winner);
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

}  // namespace

void WriteBudgets(const std::vector<ResultRow>& all, Html& page) {
  page.Subheading("The best that each coupling does within a CPU budget");
  page.Paragraph(
      "Error in mm of the best run that costs at most so much of one core (haptic and world loop "
      "and the simulated finger together), and behind it its haptic and world period. The smallest "
      "of a line is marked *.");
  std::vector<Exception> exceptions;
  std::size_t cells = 0;
  std::size_t lost = 0;
  for (const auto& [system, title] : kErrorSystems) {
    std::vector<std::vector<std::string>> lines;
    for (const double budget : kBudgets) {
      std::vector<const ResultRow*> best;
      double least = std::numeric_limits<double>::infinity();
      for (const std::string& coupling : kCouplingNames) {
        best.push_back(BestWithin(ErrorRowsOf(all, system, coupling), 100 * budget));
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
                               Why(ErrorRowsOf(all, system, "local"), local, *best[winner]) + ".";
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

}  // namespace rikiseki::lab
