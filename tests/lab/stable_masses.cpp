// SPDX-License-Identifier: MIT
#include "tests/lab/stable_masses.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace rikiseki::lab {
namespace {

constexpr double kNoGrowth = 1e-8;

// Growth against the logarithm of the mass.
class GrowthCurve {
 public:
  explicit GrowthCurve(const PeriodMap& map) : map_(map) {}

  struct Sample {
    double place;  // log of the mass
    double growth;

    bool stable() const { return growth <= 1 + kNoGrowth; }
  };

  Sample At(double place) const { return {place, map_.SpectralRadius(std::exp(place))}; }

  // Where it becomes stable or unstable between two samples of which one is stable.
  double Edge(Sample a, Sample b) const {
    while (b.place - a.place > 1e-9) {
      const Sample middle = At((a.place + b.place) / 2);
      (middle.stable() == a.stable() ? a : b) = middle;
    }
    return (a.place + b.place) / 2;
  }

  // Of three neighbours alike, the outer ones of which are nearer to the stable side than the one in
  // the middle (or farther): a sample between them that is unlike them, if there is one.
  std::optional<Sample> Unlike(const Sample& a, const Sample& b, const Sample& c) const {
    const double sign = b.stable() ? -1 : 1;  // what is sought is where sign * growth is least
    const auto value = [sign](const Sample& sample) { return sign * sample.growth; };
    if (value(b) > value(a) || value(b) > value(c)) return std::nullopt;
    // Neither a curve nor a kink dips much deeper than it is steep beside.
    const double reach = 2 * (std::max(value(a), value(c)) - value(b));
    if (value(b) - reach > sign * (1 + kNoGrowth)) return std::nullopt;
    Sample low = a;
    Sample best = b;
    Sample high = c;
    while (high.place - low.place > 1e-8) {
      const bool left = best.place - low.place > high.place - best.place;
      const Sample tried = At(left ? best.place - 0.382 * (best.place - low.place)
                                   : best.place + 0.382 * (high.place - best.place));
      if (tried.stable() != b.stable()) return tried;
      if (value(tried) < value(best)) {
        (left ? high : low) = best;
        best = tried;
      } else {
        (left ? low : high) = tried;
      }
    }
    return std::nullopt;
  }

 private:
  const PeriodMap& map_;
};

}  // namespace

std::vector<StableInterval> StableIntervals(const PeriodMap& map) {
  using Sample = GrowthCurve::Sample;
  const GrowthCurve curve(map);
  constexpr double kSpacing = 0.01;
  const double from = std::log(kLeastMass);
  const double to = std::log(kGreatestMass);
  const int count = static_cast<int>(std::ceil((to - from) / kSpacing)) + 1;
  std::vector<Sample> coarse;
  for (int i = 0; i < count; ++i) coarse.push_back(curve.At(from + (to - from) * i / (count - 1)));

  std::vector<Sample> samples;
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    std::optional<Sample> unlike;
    if (i > 0 && i + 1 < coarse.size() && coarse[i - 1].stable() == coarse[i].stable() &&
        coarse[i].stable() == coarse[i + 1].stable()) {
      unlike = curve.Unlike(coarse[i - 1], coarse[i], coarse[i + 1]);
    }
    if (unlike && unlike->place < coarse[i].place) samples.push_back(*unlike);
    samples.push_back(coarse[i]);
    if (unlike && unlike->place > coarse[i].place) samples.push_back(*unlike);
  }
  // Two neighbours may have found the same place between them, each in its turn.
  std::sort(samples.begin(), samples.end(),
            [](const Sample& a, const Sample& b) { return a.place < b.place; });

  std::vector<StableInterval> intervals;
  if (samples.front().stable()) intervals.push_back({kLeastMass, kGreatestMass});
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i - 1].stable() == samples[i].stable()) continue;
    const double edge = std::exp(curve.Edge(samples[i - 1], samples[i]));
    if (samples[i].stable()) {
      intervals.push_back({edge, kGreatestMass});
    } else {
      intervals.back().to = edge;
    }
  }
  return intervals;
}

}  // namespace rikiseki::lab
