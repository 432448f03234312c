// SPDX-License-Identifier: MIT
// Finished rows on disk: what was written is read back to the bit, whatever happened to the file.
#include "tests/lab/report/kept_rows.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "tests/common/temporary_folder.h"

namespace rikiseki::lab {
namespace {

std::filesystem::path PathOf(const TemporaryFolder& folder) {
  return folder.File("");
}

Case Study() {
  Case study;
  study.name = "roots";
  study.results = {{"root"}, {"half"}, {"word"}};
  return study;
}

Table Rows() {
  Table table("rows", {"a", "note"});
  table.Append({"2", "x, y"});
  table.Append({"3", ""});
  table.Append({"-1", "\"quoted\""});
  return table;
}

KeptRow Made(double a) {
  return {{a < 0 ? RowStatus::kUnstable : RowStatus::kOk, {std::sqrt(a), a / 2}, {"12"}}, "here"};
}

std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void WriteAll(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

void KeepAll(const std::filesystem::path& folder, const std::string& part = "") {
  const Table rows = Rows();
  KeptRows kept(folder, "roots", Study(), rows);
  kept.Open(part);
  kept.Keep(rows.row(1), Made(3));
  kept.Keep(rows.row(0), Made(2));
  kept.Keep(rows.row(2), Made(-1));
}

}  // namespace

TEST_CASE("kept rows come back as they were, numbers to the bit, texts as texts") {
  const TemporaryFolder folder;
  KeepAll(PathOf(folder));
  const Table rows = Rows();
  const KeptRows kept(PathOf(folder), "roots", Study(), rows);
  const KeptRow* two = kept.Find(rows.row(0));
  REQUIRE(two != nullptr);
  CHECK(two->outcome.values == std::vector<double>{std::sqrt(2.0), 1});
  CHECK(two->outcome.texts == std::vector<std::string>{"12"});
  CHECK(two->machine == "here");
  const KeptRow* negative = kept.Find(rows.row(2));
  REQUIRE(negative != nullptr);
  CHECK(negative->outcome.status == RowStatus::kUnstable);
  CHECK(std::isnan(negative->outcome.values[0]));
}

TEST_CASE("kept rows: a line that was cut is not finished, and what follows is appended soundly") {
  const TemporaryFolder folder;
  KeepAll(PathOf(folder));
  const auto path = PathOf(folder) / "roots.csv";
  const std::string whole = ReadAll(path);
  WriteAll(path, whole.substr(0, whole.size() - 3));
  const Table rows = Rows();
  KeptRows kept(PathOf(folder), "roots", Study(), rows);
  CHECK(kept.Find(rows.row(0)) != nullptr);
  CHECK(kept.Find(rows.row(2)) == nullptr);
  kept.Open("");
  kept.Keep(rows.row(2), Made(-1));
  CHECK(ReadAll(path) == whole);
}

TEST_CASE("kept rows: shards in files of their own, or concatenated, are one table") {
  const TemporaryFolder folder;
  KeepAll(PathOf(folder), "1-of-2");
  CHECK(std::filesystem::exists(PathOf(folder) / "roots.1-of-2.csv"));
  const Table rows = Rows();
  KeptRows kept(PathOf(folder), "roots", Study(), rows);
  for (std::size_t i = 0; i < rows.size(); ++i) CHECK(kept.Find(rows.row(i)) != nullptr);
  kept.Rewrite(rows);
  const std::string ordered = ReadAll(PathOf(folder) / "roots.csv");

  const TemporaryFolder other;
  WriteAll(PathOf(other) / "roots.csv", ReadAll(PathOf(folder) / "roots.1-of-2.csv") + ordered);
  KeptRows concatenated(PathOf(other), "roots", Study(), rows);
  concatenated.Rewrite(rows);
  CHECK(ReadAll(PathOf(other) / "roots.csv") == ordered);
  CHECK(
      ordered.starts_with("a,note,got_root,got_half,got_word,got_status,got_texts,got_machine\n"
                          "2,\"x, y\",1.4142135623730951,1,12,ok,1,here\n3,,"));
}

TEST_CASE("kept rows of another table are refused by name") {
  const TemporaryFolder folder;
  WriteAll(PathOf(folder) / "roots.csv", "b,got_root\n1,1\n");
  CHECK_THROWS_WITH(KeptRows(PathOf(folder), "roots", Study(), Rows()),
                    Catch::Contains("roots.csv:1: these are other columns"));
  WriteAll(
      PathOf(folder) / "roots.csv",
      "a,note,got_root,got_half,got_word,got_status,got_texts,got_machine\n1,,1,1,,fine,1,x\n");
  CHECK_THROWS_WITH(KeptRows(PathOf(folder), "roots", Study(), Rows()),
                    Catch::Contains("got_status = fine: ok, missed"));
}

TEST_CASE("kept rows: a file of another chapter whose name begins alike is none of theirs") {
  const TemporaryFolder folder;
  WriteAll(PathOf(folder) / "roots-and-more.csv", "nonsense");
  const Table rows = Rows();
  const KeptRows kept(PathOf(folder), "roots", Study(), rows);
  CHECK(kept.Find(rows.row(0)) == nullptr);
}

}  // namespace rikiseki::lab
