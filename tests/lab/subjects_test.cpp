// SPDX-License-Identifier: MIT
// Simulated subjects: numerics section 5 has the spread that they must show.
#include "tests/lab/subjects.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "tests/lab/case_row.h"

namespace rikiseki::lab {
namespace {

test::RowResult Run(const std::string& hand, double mass_kg, const std::string& coupling,
                    int subject, std::uint64_t seed = 1) {
  return test::RunText(Subjects(),
                       "hand,mass_kg,coupling,Tw_s,trials,scored,subject\n" + hand + "," +
                           ToField(mass_kg) + "," + coupling + ",0.05,30,20," +
                           std::to_string(subject) + "\n",
                       seed);
}

// RMS over subjects of the SD of each.
double Spread(const std::string& coupling, int subjects) {
  double squares = 0;
  for (int subject = 1; subject <= subjects; ++subject) {
    squares += std::pow(Run("medium", 1, coupling, subject).got.at("stop_sd_m"), 2) / subjects;
  }
  return std::sqrt(squares);
}

}  // namespace

// 16 subjects of 20 trials sample an SD to 1/sqrt(640) = 4 %, and people differ.
TEST_CASE("fig9: the spread is that of the prototypes within 20 %, and so is the order") {
  const double position = Spread("position", 16);
  const double impulse = Spread("impulse", 16);
  const double local = Spread("local", 16);
  CHECK(position == Approx(0.257).epsilon(0.2));
  CHECK(impulse == Approx(0.098).epsilon(0.2));
  CHECK(local == Approx(0.037).epsilon(0.2));
  CHECK(position / impulse >= 1.7);
  CHECK(impulse / local >= 1.4);
}

TEST_CASE("fig9: a subject is the same person every time, and another one is another") {
  const auto a = Run("firm", 2, "impulse", 3);
  CHECK(Run("firm", 2, "impulse", 3).texts.at("stops_m") == a.texts.at("stops_m"));
  CHECK(Run("firm", 2, "impulse", 4).texts.at("stops_m") != a.texts.at("stops_m"));
  CHECK(Run("firm", 2, "impulse", 3, 2).texts.at("stops_m") != a.texts.at("stops_m"));
  std::istringstream stops(a.texts.at("stops_m"));
  int count = 0;
  for (double stop = 0; stops >> stop; ++count) CHECK(std::abs(stop) < 5);
  CHECK(count == 30);
}

TEST_CASE("fig9: subjects learn: the mean of the scored trials is near the mark") {
  double mean = 0;
  for (int subject = 1; subject <= 4; ++subject) {
    mean += Run("medium", 1, "local", subject).got.at("stop_mean_m") / 4;
  }
  CHECK(mean ==
        Approx(0.3).margin(0.02));  // SD 3.7 cm over 80 trials: 0.4 cm, and what was learnt late
}

}  // namespace rikiseki::lab
