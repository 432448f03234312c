// SPDX-License-Identifier: MIT
#include "tests/lab/report/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <sstream>

#include "common/text.h"

namespace rikiseki::lab {
namespace {

constexpr double kWidth = 460, kHeight = 300;
constexpr double kLeft = 62, kRight = 12, kTop = 28, kBottom = 46;
constexpr double kLegendLine = 15;
constexpr std::array kColours = {"c0", "c1", "c2", "c3", "c4", "c5"};

const char* Colour(const Series& series) {
  return kColours[static_cast<std::size_t>(series.colour) % kColours.size()];
}

// Where a value stands on its axis: 0 .. 1.
class Scale {
 public:
  Scale(const Axis& axis, std::vector<double> values) : logarithmic_(axis.logarithmic) {
    std::erase_if(values, [&](double v) { return !std::isfinite(v) || (logarithmic_ && v <= 0); });
    low_ = axis.low;
    high_ = axis.high;
    if (low_ == high_) {
      if (values.empty()) values = {1, 10};
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      low_ = *low;
      high_ = *high;
      Widen();
    }
  }

  double At(double value) const {
    const double place = (Place(value) - Place(low_)) / (Place(high_) - Place(low_));
    return std::isnan(place) ? 0 : std::clamp(place, 0.0, 1.0);
  }

  std::vector<double> Ticks() const {
    std::vector<double> ticks;
    if (logarithmic_) {
      const double decades = std::log10(high_ / low_);
      const int every = std::max(1, static_cast<int>(std::ceil(decades / 8)));
      for (double power = std::ceil(std::log10(low_) - 1e-9); power <= std::log10(high_) + 1e-9;
           power += every) {
        ticks.push_back(std::pow(10, power));
      }
      if (ticks.size() >= 2) return ticks;
      ticks.clear();
      for (double power = std::floor(std::log10(low_)); power <= std::log10(high_); ++power) {
        for (const double digit : {1.0, 2.0, 5.0}) ticks.push_back(digit * std::pow(10, power));
      }
      std::erase_if(ticks, [&](double t) { return t < low_ * 0.999 || t > high_ * 1.001; });
      return ticks;
    }
    const double rough = (high_ - low_) / 5;
    const double unit = std::pow(10, std::floor(std::log10(rough)));
    double step = unit;
    for (const double factor : {2.0, 5.0, 10.0}) {
      if (step < rough) step = factor * unit;
    }
    for (double i = std::ceil(low_ / step - 1e-9); i * step <= high_ + 1e-9 * step; ++i) {
      ticks.push_back(i * step);
    }
    return ticks;
  }

 private:
  double Place(double value) const {
    if (!logarithmic_) return value;
    return value > 0 ? std::log(value) : -std::numeric_limits<double>::infinity();
  }

  void Widen() {
    if (logarithmic_) {
      low_ /= 1.3;
      high_ *= 1.3;
      return;
    }
    const double width = high_ > low_ ? high_ - low_ : std::max(1e-9, std::abs(high_));
    if (low_ > 0 && low_ < 0.5 * high_) {
      low_ = 0;
    } else {
      low_ -= 0.04 * width;
    }
    high_ += 0.04 * width;
  }

  bool logarithmic_;
  double low_ = 0;
  double high_ = 1;
};

std::string Pixels(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

class Canvas {
 public:
  explicit Canvas(const Plot& plot)
      : plot_(plot), x_(plot.x, Values(plot, true)), y_(plot.y, Values(plot, false)) {}

  std::string Draw() {
    std::size_t labels = 0;
    for (const Series& series : plot_.series) labels += series.label.empty() ? 0 : 1;
    const double height = kHeight + kLegendLine * std::ceil(static_cast<double>(labels) / 2);
    out_ << "<svg class=\"plot\" viewBox=\"0 0 " << kWidth << " " << height
         << "\" role=\"img\" aria-label=\"" << Escaped(plot_.title) << "\">\n"
         << "<text class=\"title\" x=\"" << kLeft << "\" y=\"16\">" << Escaped(plot_.title)
         << "</text>\n";
    Grid();
    for (const Series& series : plot_.series) Draw(series);
    Legend();
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  static std::vector<double> Values(const Plot& plot, bool of_x) {
    std::vector<double> values;
    for (const Series& series : plot.series) {
      for (const PlotPoint& point : series.points) values.push_back(of_x ? point.x : point.y);
      if (!of_x) values.insert(values.end(), series.tops.begin(), series.tops.end());
    }
    return values;
  }

  double X(double value) const { return kLeft + x_.At(value) * (kWidth - kLeft - kRight); }
  double Y(double value) const {
    return kHeight - kBottom - y_.At(value) * (kHeight - kTop - kBottom);
  }

  void Grid() {
    for (const double tick : x_.Ticks()) {
      const std::string x = Pixels(X(tick));
      out_ << "<path class=\"grid\" d=\"M" << x << " " << kTop << "V" << kHeight - kBottom
           << "\"/><text class=\"tick\" text-anchor=\"middle\" x=\"" << x << "\" y=\""
           << kHeight - kBottom + 14 << "\">" << Short(tick) << "</text>\n";
    }
    for (const double tick : y_.Ticks()) {
      const std::string y = Pixels(Y(tick));
      out_ << "<path class=\"grid\" d=\"M" << kLeft << " " << y << "H" << kWidth - kRight
           << "\"/><text class=\"tick\" text-anchor=\"end\" x=\"" << kLeft - 5 << "\" y=\""
           << Pixels(Y(tick) + 4) << "\">" << Short(tick) << "</text>\n";
    }
    out_ << "<rect class=\"frame\" x=\"" << kLeft << "\" y=\"" << kTop << "\" width=\""
         << kWidth - kLeft - kRight << "\" height=\"" << kHeight - kTop - kBottom << "\"/>\n"
         << "<text class=\"axis\" text-anchor=\"middle\" x=\"" << (kLeft + kWidth - kRight) / 2
         << "\" y=\"" << kHeight - 12 << "\">" << Escaped(plot_.x.label) << "</text>\n"
         << "<text class=\"axis\" text-anchor=\"middle\" transform=\"translate(13 "
         << (kTop + kHeight - kBottom) / 2 << ") rotate(-90)\">" << Escaped(plot_.y.label)
         << "</text>\n";
  }

  void Draw(const Series& series) {
    const char* colour = Colour(series);
    if (series.mark == Mark::kLine || series.mark == Mark::kDotted) {
      std::string path;
      bool pen_down = false;
      for (const PlotPoint& point : series.points) {
        if (!std::isfinite(point.y)) {
          pen_down = false;
          continue;
        }
        path.append(pen_down ? "L" : "M").append(Pixels(X(point.x))).append(" ");
        path += Pixels(Y(point.y));
        pen_down = true;
      }
      out_ << "<path class=\"" << (series.mark == Mark::kLine ? "line " : "dotted ") << colour
           << "\" d=\"" << path << "\"/>\n";
    }
    for (std::size_t i = 0; i < series.points.size(); ++i) {
      const PlotPoint& point = series.points[i];
      const std::string x = Pixels(X(point.x));
      if (!std::isfinite(point.y)) {
        out_ << "<path class=\"cross " << colour << "\" d=\"M" << x << " " << kTop
             << "m-4 -4l8 8m0 -8l-8 8\"><title>diverged</title></path>\n";
      } else if (series.mark == Mark::kDots) {
        out_ << "<circle class=\"dot " << colour << "\" cx=\"" << x << "\" cy=\""
             << Pixels(Y(point.y)) << "\" r=\"3\"/>\n";
      } else if (series.mark == Mark::kBars) {
        out_ << "<path class=\"bar " << colour << "\" d=\"M" << x << " " << Pixels(Y(point.y))
             << "V" << Pixels(Y(series.tops[i])) << "\"/>\n";
      }
    }
  }

  void Legend() {
    int place = 0;
    for (const Series& series : plot_.series) {
      if (series.label.empty()) continue;
      const double x = kLeft + (place % 2) * (kWidth - kLeft - kRight) / 2;
      const double y = kHeight + (place / 2) * kLegendLine + 4;
      const bool line = series.mark == Mark::kLine || series.mark == Mark::kDotted;
      const char* colour = Colour(series);
      if (line) {
        out_ << "<path class=\"" << (series.mark == Mark::kLine ? "line " : "dotted ") << colour
             << "\" d=\"M" << x << " " << y - 4 << "h18\"/>";
      } else {
        out_ << "<circle class=\"dot " << colour << "\" cx=\"" << x + 9 << "\" cy=\"" << y - 4
             << "\" r=\"3\"/>";
      }
      out_ << "<text class=\"tick\" x=\"" << x + 23 << "\" y=\"" << y << "\">"
           << Escaped(series.label) << "</text>\n";
      ++place;
    }
  }

  const Plot& plot_;
  Scale x_;
  Scale y_;
  std::ostringstream out_;
};

}  // namespace

std::string Svg(const Plot& plot) {
  return Canvas(plot).Draw();
}

std::string Short(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  // What was rounded to three digits is written out while that is shorter to read.
  const double rounded = std::strtod(text.data(), nullptr);
  if (rounded == 0) return "0";
  if (std::abs(rounded) >= 1000 && std::abs(rounded) < 1e7) {
    std::snprintf(text.data(), text.size(), "%.0f", rounded);
  }
  return text.data();
}

}  // namespace rikiseki::lab
