// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "tests/lab/report/sections.h"

namespace rikiseki::lab {
namespace {

// The first row of a chapter in which every named column has that text; null if there is none.
const ResultRow* FindRow(const std::vector<ResultRow>& rows,
                         const std::vector<std::pair<std::string, std::string>>& columns) {
  for (const ResultRow& row : rows) {
    const bool fits = std::all_of(columns.begin(), columns.end(), [&](const auto& column) {
      return row.Text(column.first) == column.second;
    });
    if (fits) return &row;
  }
  return nullptr;
}

void AnswerStiffness(const Results& results, Html& page) {
  page.Subheading("Which stiffness is stable on my device at my rate?");
  page.Paragraph(
      "Take the identified mass m and damping b of your device (haptic_server --selftest names "
      "what "
      "the settings say), the damping B that you render and the delay d in ticks. A wall is stable "
      "below K = (b + B)/(T/2 + d T), and never above 0.686 m/T^2, whatever B is; with 1, 2, 3 "
      "ticks of "
      "delay 0.1445, 0.0624, 0.0348. What the loop that ships holds, in N/m:");
  const std::vector<ResultRow>& rows = RowsOf(results, "wall");
  std::vector<std::vector<std::string>> lines;
  for (const auto& [mass, damping, name] :
       {std::tuple("0.03", "0.2", "device alone"), std::tuple("0.58", "6.7", "in a medium hand"),
        std::tuple("0.93", "15.2", "in a firm hand")}) {
    for (const char* wall_damping : {"0", "2", "10"}) {
      std::vector<std::string> line = {std::string(name) + " (" + mass + " kg, " + damping +
                                       " Ns/m), B = " + wall_damping + " Ns/m"};
      for (const double period_s : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4}) {
        const ResultRow* row = FindRow(rows, {{"m_kg", mass},
                                              {"b_Ns_m", damping},
                                              {"B_Ns_m", wall_damping},
                                              {"delay_samples", "0"},
                                              {"T_s", ToField(period_s)}});
        line.push_back(row == nullptr ? "" : Value(row->Got("Kmax_eig_N_m")));
      }
      lines.push_back(line);
    }
  }
  page.Table({"", "250 Hz", "500 Hz", "1 kHz", "2 kHz", "4 kHz"}, lines);
  page.Paragraph(
      "For your own: haptic_lab wall --cases mine.csv with the columns T_s, m_kg, b_Ns_m, B_Ns_m, "
      "delay_samples.");
}

std::string StableMasses(const ResultRow* row) {
  if (row == nullptr) return "";
  const auto text = row->texts.find("stable_intervals_kg_in_1e-5..1e4");
  return text == row->texts.end() || text->second.empty() ? "none" : text->second;
}

void AnswerMass(const Results& results, Html& page) {
  page.Subheading("How light may an object be?");
  page.Paragraph(
      "With local: M > k T^2/4 + d T/2 at any world rate and latency (1.5 g at 2 kN/m, 2 Ns/m, 1 "
      "kHz), "
      "and with the implicit step, which is taken where that fails, any mass; given that the wall "
      "itself is stable (b + d > k T/2). With position and impulse the world's rate decides. "
      "Masses in "
      "kg that are stable at 2 kN/m, 2 Ns/m, 1 kHz:");
  const std::vector<ResultRow>& rows = RowsOf(results, "masses");
  std::vector<std::vector<std::string>> lines;
  for (const char* world_period : {"0.02", "0.05", "0.1"}) {
    for (const char* hand : {"light", "medium", "firm"}) {
      std::vector<std::string> line = {Short(1 / std::strtod(world_period, nullptr)) + " Hz, " +
                                       hand + " hand"};
      for (const char* method : {"conv", "impulse_interp", "local_AUTH"}) {
        line.push_back(StableMasses(FindRow(rows, {{"Tw_s", world_period},
                                                   {"hand", hand},
                                                   {"method", method},
                                                   {"kp_N_m", "2000"},
                                                   {"T_s", "0.001"}})));
      }
      lines.push_back(line);
    }
  }
  page.Table({"world", "position", "impulse", "local"}, lines);
}

const ResultRow* ErrorRow(const Results& results, const std::string& system,
                          const std::string& coupling, const std::string& period,
                          const std::string& world_period) {
  const std::string display = coupling == "local" ? "" : "interpolate";
  for (const ResultRow& row : RowsOf(results, "error-vs-runtime")) {
    const std::string substep = row.Text("substep_s");
    if (row.Text("system") == system && row.Text("coupling") == coupling &&
        row.Text("display") == display && row.Text("T_s") == period &&
        row.Text("Tw_s") == world_period && row.Text("body_step") != "semi_implicit" &&
        (substep.empty() || substep == "0.001")) {
      return &row;
    }
  }
  return nullptr;
}

std::string ErrorText(const ResultRow* row) {
  return row == nullptr ? "" : Value(1e3 * row->Got("continuous_rms_m"));
}

const std::vector<std::string> kSystems = {"P", "H", "offcentre", "corner", "stack"};

void AnswerSlowWorld(const Results& results, Html& page) {
  page.Subheading("What does a world at 10 Hz cost me?");
  page.Paragraph(
      "RMS error of where a pushed body ends, in mm, against the same push computed at 20 us, for "
      "worlds at 50, 20 and 10 Hz and haptics at 1 kHz; and the CPU of local, in % of a core.");
  std::vector<std::vector<std::string>> lines;
  double worst_local = 0;
  for (const std::string& system : kSystems) {
    std::vector<std::string> line = {system};
    for (const std::string& coupling : kCouplingNames) {
      for (const char* world_period : {"0.02", "0.05", "0.1"}) {
        const ResultRow* row = ErrorRow(results, system, coupling, "0.001", world_period);
        line.push_back(ErrorText(row));
        if (coupling == "local" && row != nullptr && std::string(world_period) == "0.1") {
          worst_local = std::max(worst_local, 1e3 * row->Got("split_rms_m"));
        }
      }
    }
    for (const char* world_period : {"0.02", "0.1"}) {
      const ResultRow* row = ErrorRow(results, system, "local", "0.001", world_period);
      line.push_back(row == nullptr ? "" : Value(100 * row->Got("cpu_s_per_s")));
    }
    lines.push_back(line);
  }
  page.Table({"push", "position 50 Hz", "20 Hz", "10 Hz", "impulse 50 Hz", "20 Hz", "10 Hz",
              "local 50 Hz", "20 Hz", "10 Hz", "CPU 50 Hz", "CPU 10 Hz"},
             lines);
  page.Paragraph(
      "With local, what the split itself adds at 10 Hz is at most " + Short(worst_local) +
      " mm in these pushes, and the limits of mass and stiffness do not move: 10 Hz costs a "
      "picture that must be interpolated, and new objects that appear up to 100 ms late. "
      "With position and impulse it costs what the table says, and the stable masses above.");
}

void AnswerFasterLoop(const Results& results, Html& page) {
  page.Subheading("What would a faster haptic loop buy?");
  page.Paragraph(
      "Stiffness in proportion to the rate where damping limits it (K = (b + B)/(T/2)), light "
      "objects "
      "with its square (k T^2/4); error in proportion to the period. And it costs CPU in "
      "proportion. "
      "Local, world at 10 Hz:");
  std::vector<std::vector<std::string>> lines;
  for (const char* period : {"0.004", "0.002", "0.001", "0.0005", "0.00025", "0.000125"}) {
    const double period_s = std::strtod(period, nullptr);
    std::vector<std::string> line = {Short(1 / period_s) + " Hz"};
    const ResultRow* wall = FindRow(RowsOf(results, "wall"), {{"m_kg", "0.58"},
                                                              {"b_Ns_m", "6.7"},
                                                              {"B_Ns_m", "2"},
                                                              {"delay_samples", "0"},
                                                              {"T_s", ToField(period_s)}});
    line.push_back(wall == nullptr ? "" : Value(1e-3 * wall->Got("Kmax_eig_N_m")));
    line.push_back(Short(1e3 * (2000 * period_s * period_s / 4 + 2 * period_s / 2)));
    const ResultRow* cost = nullptr;
    for (const std::string& system : kSystems) {
      const ResultRow* row = ErrorRow(results, system, "local", ToField(period_s), "0.1");
      line.push_back(ErrorText(row));
      if (row != nullptr) cost = row;
    }
    line.push_back(cost == nullptr ? "" : Value(100 * cost->Got("cpu_s_per_s")));
    if (wall != nullptr || cost != nullptr) lines.push_back(line);
  }
  page.Table({"haptic rate", "K_max kN/m, medium hand, B 2", "lightest g at 2 kN/m", "error P mm",
              "H", "offcentre", "corner", "stack", "CPU % (stack)"},
             lines);
}

}  // namespace

const std::vector<ResultRow>& RowsOf(const Results& results, const std::string& chapter) {
  static const std::vector<ResultRow> none;
  const auto found = results.find(chapter);
  return found == results.end() ? none : found->second;
}

std::string Value(double value, const std::string& unit) {
  return std::isfinite(value) ? Short(value) + unit : "diverged";
}

void WriteAnswers(const Results& results, Html& page) {
  page.Heading("Four answers", "answers");
  AnswerStiffness(results, page);
  AnswerMass(results, page);
  AnswerSlowWorld(results, page);
  AnswerFasterLoop(results, page);
}

}  // namespace rikiseki::lab
