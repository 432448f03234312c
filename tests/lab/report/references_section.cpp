// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "tests/lab/report/sections.h"

namespace rikiseki::lab {
namespace {

enum class Measure { kAbsolute, kRelative, kLogarithm };

struct Reference {
  const char* chapter;
  std::vector<const char*> columns;
  Measure measure;
  const char* unit;
  const char* tolerance;  // in words; the study holds each row to it
};

const std::vector<Reference>& References() {
  static const std::vector<Reference> references = {
      {"fig6_runs_P", {"x_final_m"}, Measure::kAbsolute, "m", "1e-9 m"},
      {"fig6_runs_P", {"Jtot_Ns", "v_peak_world_m_s"}, Measure::kAbsolute, "N s, m/s", "1e-8"},
      {"fig6_runs_H", {"x_final_m"}, Measure::kAbsolute, "m", "1e-9 m"},
      {"fig6_runs_H", {"Jtot_Ns", "v_peak_world_m_s"}, Measure::kAbsolute, "N s, m/s", "1e-8"},
      {"plane_cases",
       {"dist"},
       Measure::kAbsolute,
       "m",
       "1e-9 (1 m + |D|) up to condition 1e8, 1e-6 beyond"},
      {"spidar_tension_cases", {"t0", "t1", "t2", "t3"}, Measure::kAbsolute, "N", "1e-6 N"},
      {"wall_kmax",
       {"Kmax_eig_N_m", "Kmax_gil_linear_N_m", "kappa=Kmax*T^2/m"},
       Measure::kRelative,
       "of it",
       "1e-4"},
      {"multirate_rho_samples",
       {"conv", "impulse_interp", "impulse_hold", "impulse_extrap", "local_SE", "local_TR",
        "local_M1", "local_AUTH", "local_M1_noreplay", "local_M1_implicit", "conv_worldkd"},
       Measure::kLogarithm,
       "in log(growth), where 0.9 < growth < 1.5",
       "0.01 + 2 %"},
      {"multirate_minmass",
       {"M_min_kg"},
       Measure::kRelative,
       "of it",
       "1 % of consistent local, else 10 %"},
      {"push_table",
       {"displacement_mean_m", "force_mean_n"},
       Measure::kRelative,
       "of it",
       "1 %, a poke 1.5 %"}};
  return references;
}

struct Deviation {
  std::size_t compared = 0;
  double worst = 0;
  std::string where;
};

Deviation WorstOf(const Reference& reference, const std::vector<ResultRow>& rows) {
  Deviation deviation;
  for (const ResultRow& row : rows) {
    for (const char* column : reference.columns) {
      const double expected = row.Number(column);
      const double got = row.Got(column);
      if (!std::isfinite(expected) || !std::isfinite(got)) continue;
      double off = std::abs(got - expected);
      if (reference.measure == Measure::kRelative) {
        if (expected == 0) continue;
        off /= std::abs(expected);
      } else if (reference.measure == Measure::kLogarithm) {
        if (expected <= 0.9 || expected >= 1.5) continue;
        off = std::abs(std::log(got / expected));
      }
      ++deviation.compared;
      if (off >= deviation.worst) {
        deviation.worst = off;
        deviation.where = std::string(column) + " = " + row.Text(column);
      }
    }
  }
  return deviation;
}

// The spread of Fig. 9's subjects, which no single row has.
void WriteSubjectReference(const Results& results, std::vector<std::vector<std::string>>& lines) {
  const std::vector<ResultRow>& rows = RowsOf(results, "fig9");
  const Table expected = Table::Load(RIKISEKI_DATA_DIR "/subjects_sd.csv");
  std::size_t compared = 0;
  std::size_t people = 0;  // in the largest group
  double worst = 0;
  std::string where;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Row row = expected.row(i);
    std::size_t subjects = 0;
    const double spread = SpreadOf(rows, row.Text("hand"), row.Text("mass_kg"), row.Text("Tw_s"),
                                   row.Text("coupling"), subjects);
    if (!std::isfinite(spread)) continue;
    people = std::max(people, subjects);
    const double off = std::abs(spread / row.Number("stop_sd_m", 0, 10) - 1);
    ++compared;
    if (off < worst) continue;
    worst = off;
    where = row.Text("hand") + " " + row.Text("mass_kg") + " kg, " + row.Text("coupling");
  }
  if (compared == 0) return;
  lines.push_back({"subjects_sd (" + std::to_string(people) + " subjects)",
                   std::to_string(compared), Short(worst) + " of it", where,
                   "20 % with 16 subjects",
                   worst <= 0.2  ? "0"
                   : people < 16 ? "too few to say"
                                 : "1"});
}

void WriteErrorReference(const Results& results, std::vector<std::vector<std::string>>& lines) {
  const Table expected = Table::Load(RIKISEKI_DATA_DIR "/error_h.csv");
  std::size_t compared = 0;
  double worst = 0;
  std::string where;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Row wanted = expected.row(i);
    for (const ResultRow& row : RowsOf(results, "error-vs-runtime")) {
      if (row.Text("system") != "H" || row.Text("coupling") != wanted.Text("coupling") ||
          row.Text("display") != wanted.Find("display").value_or("") ||
          row.Number("T_s") != wanted.Number("T_s", 0, 1) ||
          row.Number("Tw_s") != wanted.Number("Tw_s", 0, 1) ||
          row.Text("body_step") == "semi_implicit") {
        continue;
      }
      const double off =
          std::abs(1e3 * row.Got("continuous_rms_m") - wanted.Number("rms_mm", 0, 1e4));
      ++compared;
      if (off < worst) continue;
      worst = off;
      where = wanted.Text("coupling") + " at " + wanted.Text("Tw_s") + " s, expected " +
              wanted.Text("rms_mm") + " mm";
    }
  }
  if (compared == 0) return;
  lines.push_back({"error_h", std::to_string(compared), Short(worst) + " mm", where,
                   "none: sizes of a prototype", "-"});
}

}  // namespace

std::size_t WriteReferences(const std::vector<Chapter>& chapters, const Results& results,
                            Html& page) {
  page.Heading("Every reference row", "references");
  page.Paragraph(
      "Rows of tests/data, computed by programs that share no code with this project. Missed: rows "
      "that the study does not accept by the stated tolerance.");
  std::vector<std::vector<std::string>> lines;
  std::size_t all_missed = 0;
  std::string counted;
  for (const Reference& reference : References()) {
    const std::string chapter = std::string("reference_") + reference.chapter;
    const std::vector<ResultRow>& rows = RowsOf(results, chapter);
    if (rows.empty()) continue;
    const std::size_t missed = CountMissed(rows);
    if (counted != chapter) all_missed += missed;
    counted = chapter;
    const Deviation deviation = WorstOf(reference, rows);
    std::string columns;
    for (const char* column : reference.columns)
      columns += (columns.empty() ? "" : ", ") + std::string(column);
    if (reference.columns.size() > 4) columns = "growth of each method";
    lines.push_back({std::string(reference.chapter) + ": " + columns,
                     std::to_string(deviation.compared),
                     Short(deviation.worst) + " " + reference.unit, deviation.where,
                     reference.tolerance, std::to_string(missed)});
  }
  WriteSubjectReference(results, lines);
  WriteErrorReference(results, lines);
  page.Table({"file: columns", "compared", "worst deviation", "where", "tolerance", "missed"},
             lines);
  std::size_t left_out = 0;
  for (const Chapter& chapter : chapters) {
    if (!chapter.name.starts_with("reference_")) continue;
    const Table all = Table::Load(RIKISEKI_DATA_DIR "/" + chapter.name.substr(10) + ".csv");
    left_out += all.size() - chapter.rows.size();
  }
  if (left_out > 0) {
    page.Paragraph("This is the quick report: " + std::to_string(left_out) +
                   " rows of these files were left out; the full one runs all.");
  }
  return all_missed;
}

}  // namespace rikiseki::lab
