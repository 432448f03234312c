// SPDX-License-Identifier: MIT
#include "tests/lab/table.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <limits>
#include <sstream>

namespace rikiseki::lab {
namespace {

Table Parse(const std::string& text) {
  std::istringstream in(text);
  return Table::Read(in, "t.csv");
}

std::string Written(const Table& table) {
  std::ostringstream out;
  table.Write(out, {}, std::vector<std::vector<std::string>>(table.size()));
  return out.str();
}

// The message of the ConfigError that `action` throws.
template <typename Action>
std::string Refusal(Action action) {
  try {
    action();
  } catch (const ConfigError& error) {
    CHECK(error.exit_code() == kExitConfig);
    return error.what();
  }
  FAIL("nothing was refused");
  return "";
}

std::string RefusalOf(const std::string& text) {
  return Refusal([&] { Parse(text); });
}

}  // namespace

TEST_CASE("a table gives fields by column name, without quotes and blanks") {
  const Table table = Parse("a, b ,\"c, d\"\n1,  x y ,\"say \"\"no\"\"\"\n");
  REQUIRE(table.size() == 1);
  CHECK(table.columns() == std::vector<std::string>{"a", "b", "c, d"});
  CHECK(table.row(0).Number("a", 0, 2) == 1);
  CHECK(table.row(0).Text("b") == "x y");
  CHECK(table.row(0).Text("c, d") == "say \"no\"");
  CHECK_FALSE(table.row(0).Find("e").has_value());
}

TEST_CASE("a table is written back byte by byte") {
  const std::string text =
      "a, b ,\"c, d\"\n1.50,  x y ,\"say \"\"no\"\"\"\n ,\"two\nlines\", 1e-3\n";
  CHECK(Written(Parse(text)) == text);
}

TEST_CASE("byte order mark, CRLF, empty lines and a missing last line end are read over") {
  const Table table = Parse(
      "\xEF\xBB\xBF"
      "a,b\r\n\r\n1,2\r\n  \n3,4");
  REQUIRE(table.size() == 2);
  CHECK(table.columns() == std::vector<std::string>{"a", "b"});
  CHECK(table.row(1).Text("b") == "4");
  CHECK(Written(table) == "a,b\n1,2\n3,4\n");
}

TEST_CASE("extra columns follow, quoted where they must be") {
  const Table table = Parse("a\n1\n2\n");
  std::ostringstream out;
  table.Write(out, {"got_a", "note"}, {{"1", "x, y"}, {"", "\"q\""}});
  CHECK(out.str() == "a,got_a,note\n1,1,\"x, y\"\n2,,\"\"\"q\"\"\"\n");
}

TEST_CASE("rows and columns are selected in order, and keep their lines") {
  const Table table = Parse("a,got_a,b\n1,x,2\n3,y,4\n5,z,oops\n").Select({0, 2}, {"got_a"});
  CHECK(Written(table) == "a,b\n1,2\n5,oops\n");
  CHECK(Refusal([&] { table.row(1).Number("b", 0, 1); }).starts_with("t.csv:4: b = oops"));
}

TEST_CASE("rows from code read like rows from a file") {
  Table table("grid", {"a", "b"});
  table.Append({"1", "x,y"});
  CHECK(table.row(0).Text("b") == "x,y");
  CHECK(Written(table) == "a,b\n1,\"x,y\"\n");
  CHECK_THROWS_AS(table.Append({"1"}), std::invalid_argument);
  CHECK(Refusal([&] { table.row(0).Number("b", 0, 1); }).starts_with("grid: b = x,y"));
}

TEST_CASE("a malformed table is refused with file and line") {
  CHECK(RefusalOf("").starts_with("t.csv: "));
  CHECK(RefusalOf("a,,c\n").starts_with("t.csv:1: "));
  CHECK(RefusalOf("a,b,a\n").find("column a stands twice") != std::string::npos);
  CHECK(RefusalOf("a,b\n1,2\n1\n").starts_with("t.csv:3: 1 fields; the header has 2"));
  CHECK(RefusalOf("a,b\n1,2,3\n").starts_with("t.csv:2: 3 fields; the header has 2"));
  CHECK(RefusalOf("a,b\n\n1,\"2\n3,4\n").starts_with("t.csv:3: a quote is opened"));
  CHECK(RefusalOf("a,b\n1,x\"2\"\n").starts_with("t.csv:2: x\"2\""));
  CHECK(RefusalOf("a,b\n1,\"x\"y\"\"\n").starts_with("t.csv:2: "));
  CHECK(Refusal([] { Table::Load("no/such/file.csv"); }).starts_with("no/such/file.csv: "));
}

TEST_CASE("a field that does not fit is refused with file, line, column and value") {
  const Table table = Parse("a,b\n1,\nx,2.5\n");
  CHECK(Refusal([&] { table.row(0).Text("b"); }) == "t.csv:2: column b is empty");
  CHECK(Refusal([&] { table.row(0).Text("c"); }) == "t.csv:2: column c is missing");
  CHECK(Refusal([&] { table.row(1).Number("a", 0, 1); }) == "t.csv:3: a = x: a number is expected");
  CHECK(Refusal([&] { table.row(1).Number("b", 0, 1); }) ==
        "t.csv:3: b = 2.5: a number from 0 to 1 is expected");
  CHECK(Refusal([&] { table.row(1).Integer("b", 0, 9); }) ==
        "t.csv:3: b = 2.5: a whole number is expected");
  CHECK(table.row(0).NumberOr("b", 0, 1, 0.25) == 0.25);
  const Table nan = Parse("a,b\nnan,inf\n");
  CHECK_THROWS_AS(nan.row(0).Number("a", -1e300, 1e300), ConfigError);
  CHECK_THROWS_AS(nan.row(0).Number("b", -1e300, 1e300), ConfigError);
}

TEST_CASE("numbers are written so that they read back to the same bits") {
  for (const double value : {0.1, 1.0 / 3, 5e-324, 1e22, -0.20538476983261, 0.0}) {
    CHECK(std::strtod(ToField(value).c_str(), nullptr) == value);
  }
  CHECK(ToField(std::numeric_limits<double>::infinity()) == "inf");
}

}  // namespace rikiseki::lab
