// SPDX-License-Identifier: MIT
#include "tests/lab/study.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <limits>
#include <sstream>

namespace rikiseki::lab {
namespace {

// Squares the column a; negative numbers are unsupported, 99 diverges.
Case Squares() {
  Case study;
  study.name = "squares";
  study.results = {{"square", 1e-9}};
  study.run = [](const Row& row, std::uint64_t seed) {
    const double a = row.Number("a", -100, 100);
    if (a < 0) return Outcome{RowStatus::kUnsupported, {}};
    if (a == 99) return Outcome{RowStatus::kUnstable, {std::numeric_limits<double>::infinity()}};
    return Outcome{RowStatus::kOk, {a * a + static_cast<double>(seed) - 1}};
  };
  return study;
}

Table Parse(const std::string& text) {
  std::istringstream in(text);
  return Table::Read(in, "t.csv");
}

std::string Run(const std::string& text, const StudyOptions& options = {}) {
  std::ostringstream out;
  WriteStudy(Squares(), RunStudy(Squares(), Parse(text), options), out);
  return out.str();
}

}  // namespace

TEST_CASE("rows are compared with what they expect") {
  CHECK(Run("a,square,note\n2,4,x\n3,9.1, y \n4,,z\n-1,7,\n99,,\n") ==
        "a,square,note,got_square,got_status\n"
        "2,4,x,4,ok\n3,9.1, y ,9,missed\n4,,z,16,ok\n-1,7,,,unsupported\n99,,,inf,unstable\n");
}

TEST_CASE("without the result column nothing can be missed") {
  const StudyResult result = RunStudy(Squares(), Parse("a\n2\n3\n"), {});
  CHECK(result.Count(RowStatus::kOk) == 2);
  CHECK(result.Count(RowStatus::kMissed) == 0);
}

TEST_CASE("a diverging run meets a reference that diverged, and misses a finite one") {
  CHECK(
      Run("a,square\n99,inf\n99,nan\n99,1\n2,inf\n") ==
      "a,square,got_square,got_status\n99,inf,inf,unstable\n99,nan,inf,unstable\n99,1,inf,missed\n"
      "2,inf,4,missed\n");
}

TEST_CASE("the tolerance is absolute, beside the rounding of the written reference") {
  // Nine digits of 2.25 leave 5e-9 to rounding, the tolerance adds 1e-9.
  CHECK(Run("a,square\n1.5000000019,2.25\n").find(",ok") != std::string::npos);      // 5.7e-9
  CHECK(Run("a,square\n1.5000000021,2.25\n").find(",missed") != std::string::npos);  // 6.3e-9
  // Ten digits leave 5e-10.
  CHECK(Run("a,square\n1.5,2.250000001\n").find(",ok") != std::string::npos);
  CHECK(Run("a,square\n1.5,2.250000002\n").find(",missed") != std::string::npos);
}

TEST_CASE("the rounding of a written number is half a unit of its ninth digit or its last") {
  CHECK(RoundingOf("0.676327474") == Approx(5e-10));
  CHECK(RoundingOf("1.10288511") == Approx(5e-9));
  CHECK(RoundingOf("0.25") == Approx(5e-10));
  CHECK(RoundingOf("2.5e-3") == Approx(5e-12));
  CHECK(RoundingOf("0.00012345678901") == Approx(5e-15));
  CHECK(RoundingOf("0") == 0);
  CHECK(RoundingOf("inf") == 0);
  CHECK_THROWS_AS(RoundingOf("much"), std::invalid_argument);
}

TEST_CASE("older results of the same study are replaced") {
  CHECK(Run("a,got_square,b,got_status\n2,77,x,missed\n") ==
        "a,b,got_square,got_status\n2,x,4,ok\n");
}

TEST_CASE("neither threads nor shards change a row") {
  std::string text = "a\n";
  for (int i = 0; i < 60; ++i) text += std::to_string(i) + "\n";
  const std::string whole = Run(text);
  CHECK(Run(text, {.jobs = 5}) == whole);

  std::vector<std::string> rows(60);
  for (int shard = 1; shard <= 7; ++shard) {
    std::istringstream lines(Run(text, {.jobs = 2, .shard = shard, .shards = 7}));
    std::string line;
    std::getline(lines, line);
    for (std::size_t i = static_cast<std::size_t>(shard - 1); std::getline(lines, line); i += 7) {
      REQUIRE(i < rows.size());
      rows[i] = line;
    }
  }
  std::string joined = "a,got_square,got_status\n";
  for (const std::string& row : rows) joined += row + "\n";
  CHECK(joined == whole);
}

TEST_CASE("a case may judge for itself, and give results that are no numbers") {
  Case study = Squares();
  study.results.push_back({.name = "parity"});
  study.run = [](const Row& row, std::uint64_t) {
    const int a = row.Integer("a", 0, 100);
    return Outcome{.values = {1.0 * a * a}, .texts = {a % 2 == 0 ? "even" : "odd"}};
  };
  study.agrees = [](const Row& row, const Outcome& outcome, std::size_t index) {
    return index == 0 ? ExpectedNumber(row, "square") <= outcome.values[0]
                      : row.Text("parity") == outcome.texts[0];
  };
  const auto run = [&](const std::string& text) {
    std::ostringstream out;
    WriteStudy(study, RunStudy(study, Parse(text), {}), out);
    return out.str();
  };
  CHECK(run("a,square,parity\n2,3,even\n2,5,even\n3,,even\n3,8,odd\n2,nan,\n") ==
        "a,square,parity,got_square,got_parity,got_status\n2,3,even,4,even,ok\n"
        "2,5,even,4,even,missed\n3,,even,9,odd,missed\n3,8,odd,9,odd,ok\n2,nan,,4,even,missed\n");
  CHECK_THROWS_AS(run("a,square\n2,much\n"), ConfigError);
}

TEST_CASE("the seed reaches the case") {
  CHECK(Run("a\n2\n", {.seed = 5}) == "a,got_square,got_status\n2,8,ok\n");
}

TEST_CASE("a row that makes no sense is refused, the first one for any number of threads") {
  std::string text = "a\n";
  for (int i = 0; i < 50; ++i) text += i == 20 || i == 30 ? "x\n" : "1\n";
  for (const int jobs : {1, 4}) {
    try {
      Run(text, {.jobs = jobs});
      FAIL("nothing was refused");
    } catch (const ConfigError& error) {
      CHECK(std::string(error.what()) == "t.csv:22: a = x: a number is expected");
    }
  }
  CHECK_THROWS_AS(Run("a,square\n1,one\n"), ConfigError);
}

}  // namespace rikiseki::lab
