// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "tests/lab/report/error_rows.h"

namespace rikiseki::lab {
namespace {

std::string Largest(double stiffness) {
  return stiffness > 0 ? Short(stiffness) : "none";
}

// How far a rule is from what the loop holds, in percent.
struct RuleError {
  double most_above = 0;
  double most_below = 0;

  void Add(double rule, double holds) {
    most_above = std::max(most_above, 100 * (rule / holds - 1));
    most_below = std::max(most_below, 100 * (1 - rule / holds));
  }
};

// Rules of thumb against all walls without delay; those with light damping, (b + B) T/m < 0.2, by themselves.
void AnswerByRule(const Results& results, Html& page) {
  RuleError curved, curved_light, linear, linear_light;
  std::size_t walls = 0;
  for (const char* chapter : {"wall", "any-wall"}) {
    for (const ResultRow& row : RowsOf(results, chapter)) {
      const double holds = row.Got("kappa=Kmax*T^2/m");
      if (row.Text("delay_samples") != "0" || !(holds > 0)) continue;
      const double beta =
          (row.Number("b_Ns_m") + row.Number("B_Ns_m")) * row.Number("T_s") / row.Number("m_kg");
      const double curve = std::max(0.0, 2 * beta * (2 - beta) / (2 + beta));
      ++walls;
      curved.Add(curve, holds);
      linear.Add(2 * beta, holds);
      if (beta >= 0.2) continue;
      curved_light.Add(curve, holds);
      linear_light.Add(2 * beta, holds);
    }
  }
  page.Paragraph("Two rules, held against the " + std::to_string(walls) +
                 " walls here without delay. K = (m/T^2) 2 beta (2 - beta)/(2 + beta), beta = (b + "
                 "B) T/m, is exact for b = 0, at most " +
                 Short(curved.most_above) + " % too high anywhere, and at most " +
                 Short(curved_light.most_below) + " % too low where beta < 0.2 (" +
                 Short(curved.most_below) +
                 " % anywhere: it takes the device's own damping for rendered). The linear rule of "
                 "Gil and Hulin, K = (b + B)/(T/2 + d T), is at "
                 "most " +
                 Short(linear_light.most_above) + " % too high where beta < 0.2, but " +
                 Short(linear.most_above) +
                 " % beyond. Rendered damping alone gets nothing above 0.686 m/T^2; 0.1445, "
                 "0.0624, 0.0348 m/T^2 with 1, 2, 3 ticks of delay.");
}

// One table for every device, and how far rules of thumb may be trusted.
void AnswerAnyDevice(const Results& results, Html& page) {
  const std::vector<ResultRow>& rows = RowsOf(results, "any-wall");
  if (rows.empty()) return;
  page.Paragraph(
      "For your own device compute b T/m and B T/m, look up the number, and multiply by m/T^2: "
      "that is the stiffness in N/m "
      "(between the lines take the smaller one). More damping of the wall is not always better: "
      "past B T/m of about 0.8 it "
      "falls again, with a tick of delay past 0.3.");
  const auto all = [&](const char* column) {
    std::vector<double> values;
    for (const ResultRow& row : rows) {
      const double value = row.Number(column);
      if (std::find(values.begin(), values.end(), value) == values.end()) values.push_back(value);
    }
    return values;
  };
  const std::vector<double> device_dampings = all("b_Ns_m");
  const std::vector<double> wall_dampings = all("B_Ns_m");
  std::vector<std::string> header = {"K T^2/m, by b T/m (down) and B T/m"};
  for (const double wall : wall_dampings) header.push_back(Short(1e-3 * wall));
  std::vector<std::vector<std::string>> lines;
  for (const auto& [delay, said] :
       {std::pair("0", ""), std::pair("1", ", a tick late"), std::pair("2", ", two ticks late")}) {
    for (const double device : device_dampings) {
      std::vector<std::string> line = {Short(1e-3 * device) + said};
      for (const double wall : wall_dampings) {
        const ResultRow* row = FindRow(
            rows,
            {{"b_Ns_m", ToField(device)}, {"B_Ns_m", ToField(wall)}, {"delay_samples", delay}});
        line.push_back(row == nullptr ? "" : Largest(row->Got("kappa=Kmax*T^2/m")));
      }
      lines.push_back(line);
    }
  }
  page.Table(header, lines);

  AnswerByRule(results, page);
  page.Paragraph(
      "To the last digit: haptic_lab wall --cases mine.csv, with the columns T_s, m_kg, b_Ns_m, "
      "B_Ns_m, delay_samples. What the "
      "device feels is the stiffness of the config times motion scale times force scale: that is "
      "what must stay below.");
  Repeat("wall", "any-wall", rows, page);
}

void AnswerStiffness(const Results& results, Html& page) {
  page.Subheading("Which stiffness is stable on my device at my rate?");
  page.Paragraph(
      "Take the identified mass m [kg] and damping b [Ns/m] of your device (haptic_server "
      "--selftest names "
      "what the settings say; a hand that holds it adds its own to both), the damping B [Ns/m] "
      "that you render, "
      "the period T [s] and the delay d in ticks (0: read, computed and written in the same tick). "
      "What the loop that "
      "ships holds, in N/m:");
  const std::vector<ResultRow>& rows = RowsOf(results, "wall");
  std::vector<std::vector<std::string>> lines;
  for (const auto& [mass, damping, name] :
       {std::tuple("0.03", "0.2", "device alone"), std::tuple("0.58", "6.7", "in a medium hand"),
        std::tuple("0.93", "15.2", "in a firm hand")}) {
    for (const char* wall_damping : {"0", "2", "10"}) {
      std::vector<std::string> line = {std::string(name) + " (" + mass + " kg, " + damping +
                                       " Ns/m), B = " + wall_damping + " Ns/m"};
      for (const double period_s : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4}) {
        for (const char* delay : {"0", "1"}) {
          const ResultRow* row = FindRow(rows, {{"m_kg", mass},
                                                {"b_Ns_m", damping},
                                                {"B_Ns_m", wall_damping},
                                                {"delay_samples", delay},
                                                {"T_s", ToField(period_s)}});
          line.push_back(row == nullptr ? "" : Largest(row->Got("Kmax_eig_N_m")));
        }
      }
      lines.push_back(line);
    }
  }
  page.Table({"", "250 Hz", "a tick late", "500 Hz", "a tick late", "1 kHz", "a tick late", "2 kHz",
              "a tick late", "4 kHz", "a tick late"},
             lines);
  AnswerAnyDevice(results, page);
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
        const ResultRow* row = FindRow(rows, {{"Tw_s", world_period},
                                              {"hand", hand},
                                              {"method", method},
                                              {"kp_N_m", "2000"},
                                              {"T_s", "0.001"}});
        line.push_back(row == nullptr ? "" : StableMasses(*row));
      }
      lines.push_back(line);
    }
  }
  page.Table({"world", "position", "impulse", "local"}, lines);
}

std::string ErrorText(const ResultRow* row) {
  return row == nullptr ? "" : Value(Error(*row));
}

void AnswerSlowWorld(const Results& results, Html& page) {
  page.Subheading("What does a world at 10 Hz cost me?");
  page.Paragraph(
      "RMS error of where a pushed body ends, in mm, against the same push computed at 20 us, for "
      "worlds at 50, 20 and 10 Hz and haptics at 1 kHz; and the CPU of local, in % of a core.");
  std::vector<std::vector<std::string>> lines;
  double worst_local = 0;
  for (const auto& [system, title] : kErrorSystems) {
    std::vector<std::string> line = {system};
    for (const std::string& coupling : kCouplingNames) {
      for (const char* world_period : {"0.02", "0.05", "0.1"}) {
        const ResultRow* row = ErrorRow(results, system, coupling, "0.001", world_period);
        line.push_back(ErrorText(row));
        if (coupling == "local" && row != nullptr && std::string(world_period) == "0.1") {
          worst_local = std::max(worst_local, SplitError(*row));
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
    for (const auto& [system, title] : kErrorSystems) {
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

void WriteAnswers(const Results& results, Html& page) {
  page.Heading("Four answers", "answers");
  AnswerStiffness(results, page);
  AnswerMass(results, page);
  AnswerSlowWorld(results, page);
  AnswerFasterLoop(results, page);
}

}  // namespace rikiseki::lab
