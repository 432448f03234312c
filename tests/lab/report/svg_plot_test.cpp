// SPDX-License-Identifier: MIT
#include "tests/lab/report/svg_plot.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/text.h"

namespace rikiseki::lab {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

Plot Simple() {
  return {.title = "a < b",
          .x = {.label = "rate, Hz", .logarithmic = true},
          .y = {.label = "error, mm", .logarithmic = true},
          .series = {{.label = "one", .points = {{1, 1}, {10, 100}, {100, kInfinite}}}}};
}

// The first number behind `key`.
double After(const std::string& text, const std::string& key) {
  return std::stod(text.substr(text.find(key) + key.size()));
}

}  // namespace

TEST_CASE("a figure names its axes, escapes its words and marks what diverged, never as a point") {
  const std::string svg = Svg(Simple());
  CHECK(svg.find("rate, Hz") != std::string::npos);
  CHECK(svg.find("error, mm") != std::string::npos);
  CHECK(svg.find("a &lt; b") != std::string::npos);
  CHECK(Count(svg, "class=\"cross c0\"") == 1);
  CHECK(Count(svg, "<title>diverged</title>") == 1);
  CHECK(Count(svg, "<circle class=\"dot c0\"") == 3);  // two points and the legend
  CHECK(svg.find("inf") == std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
}

TEST_CASE("places on a logarithmic axis are those of the logarithm") {
  Plot plot = Simple();
  plot.x.low = plot.y.low = 1;
  plot.x.high = plot.y.high = 100;
  plot.series[0].points = {{1, 1}, {10, 10}, {100, 100}};
  const std::string svg = Svg(plot);
  std::vector<double> x;
  for (std::size_t at = svg.find("cx="); at != std::string::npos; at = svg.find("cx=", at + 1)) {
    x.push_back(After(svg.substr(at), "cx=\""));
  }
  REQUIRE(x.size() >= 3);
  CHECK(x[1] - x[0] == Approx(x[2] - x[1]).margin(0.11));  // written to a tenth of a pixel
  CHECK(x[1] > x[0] + 100);
}

TEST_CASE("a figure without points, with zeros on a logarithmic axis or with one value is drawn") {
  Plot plot = Simple();
  plot.series.clear();
  CHECK(Svg(plot).find("</svg>") != std::string::npos);
  plot.series = {{.label = "zero", .points = {{0, 0}, {1, 0}}}};
  CHECK(Svg(plot).find("nan") == std::string::npos);
  plot.x.logarithmic = plot.y.logarithmic = false;
  plot.series = {{.label = "same", .mark = Mark::kLine, .points = {{5, 5}, {5, 5}}}};
  CHECK(Svg(plot).find("nan") == std::string::npos);
}

TEST_CASE("a line is broken where a run diverged, and bars end where they are told to") {
  Plot plot = Simple();
  plot.series[0].mark = Mark::kLine;
  plot.series[0].points = {{1, 1}, {10, kInfinite}, {100, 1}};
  const std::string line = Svg(plot);
  const std::string path = line.substr(line.find("class=\"line c0\" d=\""));
  CHECK(Count(path.substr(0, path.find("/>")), "M") == 2);
  plot.series = {{.label = "bars", .mark = Mark::kBars, .points = {{1, 1}}, .tops = {100}}};
  CHECK(Count(Svg(plot), "class=\"bar c0\"") == 1);
}

TEST_CASE("numbers are short") {
  CHECK(Short(0.0012345) == "0.00123");
  CHECK(Short(123456) == "123000");
  CHECK(Short(-1234.5) == "-1230");
  CHECK(Short(-0.0) == "0");
  CHECK(Short(1.5e-7) == "1.5e-07");
  CHECK(Short(kInfinite) == "inf");
  CHECK(Escaped("a<b>&\"c\"") == "a&lt;b&gt;&amp;&quot;c&quot;");
}

}  // namespace rikiseki::lab
