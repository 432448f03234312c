// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/lab/report/error_rows.h"

namespace rikiseki::lab {
namespace {

void WriteTenHertz(const Results& results, Html& page) {
  std::vector<std::vector<std::string>> lines;
  for (const std::string& coupling : kCouplingNames) {
    std::vector<std::string> line = {coupling};
    for (const char* column : {"continuous_rms_m", "force_rms_n", "force_step_n"}) {
      for (const char* world_period : {"0.02", "0.1"}) {
        const ResultRow* row = ErrorRow(results, "H", coupling, "0.001", world_period);
        const double scale = std::string(column) == "continuous_rms_m" ? 1e3 : 1;
        line.push_back(row == nullptr ? "" : Value(scale * row->Got(column)));
      }
    }
    lines.push_back(line);
  }
  page.Paragraph(
      "5.2, a world at 10 Hz. The paper: with impulses touching still feels natural, the picture "
      "stutters. Push H, "
      "worlds at 50 and at 10 Hz: how far off the block ends, how far off the force is while it is "
      "pushed, and the largest "
      "step of the force.");
  page.Table({"coupling", "off, mm, 50 Hz", "10 Hz", "force off, N RMS, 50 Hz", "10 Hz",
              "step, N, 50 Hz", "10 Hz"},
             lines);
  page.Paragraph(
      "It holds for local: neither place nor force know the world's rate. With impulse the force "
      "stays smooth, which is what "
      "a hand calls natural, but it is another force, and the block goes elsewhere.");
}

// The worst force error of a script, by coupling and world period.
void WriteFriction(const std::vector<ResultRow>& rows, Html& page) {
  std::vector<std::vector<std::string>> lines;
  for (const auto& [script, what] :
       {std::pair("sphere", "twice round a fixed ball"), std::pair("edge", "off the edge of a box"),
        std::pair("free", "into a block of 0.5 kg that nothing holds")}) {
    for (const std::string& coupling : kCouplingNames) {
      std::vector<std::string> line = {std::string(what) + ", " + coupling};
      for (const char* world_period : {"0.02", "0.05", "0.1", "0.2"}) {
        const ResultRow* row =
            FindRow(rows, {{"script", script}, {"coupling", coupling}, {"Tw_s", world_period}});
        line.push_back(
            row == nullptr ? "" : Value(std::round(1e3 * row->Got("force_error_rms_n")) / 1e3));
      }
      lines.push_back(line);
    }
  }
  page.Paragraph(
      "5.3, friction. The paper: the velocity of a displayed plane is not that of the object, so "
      "friction against the plane "
      "is wrong. Here frames carry the object's velocity, and friction is against it. A finger "
      "with friction 0.3 at 0.3 m/s, "
      "2 mm deep (4 N); RMS error of the whole force against the same slide at a single rate, N:");
  page.Table({"slide", "50 Hz", "20 Hz", "10 Hz", "5 Hz"}, lines);
  page.Paragraph(
      "Where the surface does not move friction is exact at every rate, since it does not come "
      "from the slope of planes that "
      "turn (a ball is displayed as a ball). At an edge it is the end of the surface that comes "
      "late, not friction. What "
      "moves needs local.");
  Repeat("slides", "slides", rows, page);
}

void WriteDeformation(const std::vector<ResultRow>& rows, Html& page) {
  double worst = 0, swing = 0, least_mm = std::numeric_limits<double>::infinity(), most_mm = 0;
  for (const ResultRow& row : rows) {
    worst = std::max(worst, std::abs(row.Got("force_n") / row.Got("expected_n") - 1));
    swing = std::max(swing, row.Got("swing_n"));
    if (row.Number("youngs_modulus_pa") == 8000) {
      least_mm = std::min(least_mm, 1e3 * row.Got("dent_m"));
      most_mm = std::max(most_mm, 1e3 * row.Got("dent_m"));
    }
  }
  page.Paragraph(
      "5.5, deformation. Proposed in the paper as an experiment, without figures; built here, as a "
      "finite element mesh that "
      "gets the same impulses, node by node. 2 N on a block of 8 kPa: the force is that of finger "
      "and block as two springs in "
      "series, to within " +
      Short(100 * worst) + " %, it swings by at most " + Short(1e3 * swing) +
      " mN, and the block is dented by " + Short(least_mm) +
      (most_mm - least_mm < 0.01 * most_mm ? "" : " to " + Short(most_mm)) +
      " mm: at 60, 20 and 10 Hz, with every coupling and up to two periods of latency (" +
      std::to_string(rows.size()) + " runs, " + std::to_string(CountMissed(rows)) +
      " of them off by more than 1 % or called unstable).");
  Repeat("soft-press", "soft-press", rows, page);
}

}  // namespace

void WriteRemarks(const Results& results, Html& page) {
  page.Subheading("Remarks of section 5");
  WriteTenHertz(results, page);
  if (const auto& rows = RowsOf(results, "slides"); !rows.empty()) WriteFriction(rows, page);
  page.Paragraph(
      "5.4, levels of splitting. The paper: to move the body in the haptic process as well "
      "improved the feel at low world "
      "rates, without figures. The figures are the columns impulse and local of the table under "
      "Figs. 8 and 9, from 60 to 5 Hz, "
      "and the curves of error against the world's period above.");
  if (const auto& rows = RowsOf(results, "soft-press"); !rows.empty()) {
    WriteDeformation(rows, page);
  }
}

}  // namespace rikiseki::lab
