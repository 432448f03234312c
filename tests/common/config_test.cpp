// SPDX-License-Identifier: MIT
#include "common/config.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "tests/common/temporary_file.h"

namespace rikiseki {
namespace {

enum class Fruit { kApple, kPear };

struct Bowl {
  double mass_kg = 1.5;
  int count = 3;
  bool washed = false;
  std::string name = "bowl";
  std::string picture;
  Fruit fruit = Fruit::kApple;
  Vec3 place_mm = Vec3::Zero();
  std::vector<Vec3> corners_m;
};

// A fresh schema over `bowl` for every read, as the daemons do.
ConfigSchema SchemaOf(Bowl& bowl) {
  ConfigSchema schema;
  schema.Number("bowl.mass_kg", &bowl.mass_kg, 0, 20, "what it weighs");
  schema.Integer("bowl.count", &bowl.count, 1, 9, "how many are in it");
  schema.Flag("bowl.washed", &bowl.washed, "whether they are clean");
  schema.Text("bowl.name", &bowl.name, "what it is called");
  schema.Path("bowl.picture", &bowl.picture, "what it looks like");
  schema.Choice<Fruit>("bowl.fruit", &bowl.fruit,
                       {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}}, "what is in it");
  schema.Vector("table.place_mm", &bowl.place_mm, -500, 500, "where it stands");
  schema.Vectors("table.corners_m", &bowl.corners_m, -1, 1, "where the table ends");
  return schema;
}

Bowl Read(const std::string& text) {
  const TemporaryFile file(text);
  Bowl bowl;
  SchemaOf(bowl).Load(file.path());
  return bowl;
}

// What the ConfigError says that `text` provokes, with the file's path replaced by F.
std::string Refusal(const std::string& text) {
  const TemporaryFile file(text);
  Bowl bowl;
  try {
    SchemaOf(bowl).Load(file.path());
  } catch (const ConfigError& error) {
    CHECK(error.exit_code() == 78);
    const std::string what = error.what();
    CHECK(what.find('\n') == std::string::npos);
    REQUIRE(what.starts_with(file.path()));
    return "F" + what.substr(file.path().size());
  }
  FAIL("nothing was refused in: " << text);
  return "";
}

std::string SetRefusal(const std::string& assignment) {
  Bowl bowl;
  try {
    SchemaOf(bowl).Set(assignment);
  } catch (const ConfigError& error) {
    return error.what();
  }
  FAIL("nothing was refused in: " << assignment);
  return "";
}

}  // namespace

TEST_CASE("every kind of value is read, what is left out keeps its default") {
  const Bowl bowl = Read(
      "# fruit\n[bowl]\nmass_kg = 2.25e0   # with the bowl\n  count=7\nwashed = true\n"
      "name = a blue = bowl\nfruit = pear\r\n\n[table]\nplace_mm = -1 2.5\t 500\n"
      "corners_m = 0 0 0, 1 0 0 ,0 -1 0.5\n");
  CHECK(bowl.mass_kg == 2.25);
  CHECK(bowl.count == 7);
  CHECK(bowl.washed);
  CHECK(bowl.name == "a blue = bowl");
  CHECK(bowl.fruit == Fruit::kPear);
  CHECK(bowl.place_mm == Vec3(-1, 2.5, 500));
  REQUIRE(bowl.corners_m.size() == 3);
  CHECK(bowl.corners_m[2] == Vec3(0, -1, 0.5));
  CHECK(bowl.picture.empty());

  const Bowl untouched = Read("# nothing\n\n[bowl]\n");
  CHECK(untouched.mass_kg == 1.5);
  CHECK(untouched.count == 3);
}

TEST_CASE("a section may come again, and blanks in its brackets mean nothing") {
  const Bowl bowl = Read("[bowl]\ncount = 2\n[table]\nplace_mm = 1 2 3\n[ bowl ]\nmass_kg = 4\n");
  CHECK(bowl.count == 2);
  CHECK(bowl.mass_kg == 4);
}

TEST_CASE("ranges are inclusive") {
  CHECK(Read("[bowl]\nmass_kg = 0\n").mass_kg == 0);
  CHECK(Read("[bowl]\nmass_kg = 20\n").mass_kg == 20);
  CHECK(Read("[bowl]\ncount = 9\n").count == 9);
}

TEST_CASE("a wrong value is refused with file, line, key, value and what would be right") {
  const auto refusal = [](const std::string& value) {
    return Refusal("# one\n[bowl]\nmass_kg = " + value + "\n");
  };
  const std::string cure = ": a number from 0 to 20 is expected";
  for (const std::string value :
       {"20.001", "-1e-9", "nan", "inf", "-inf", "1e999", "two", "2 kg", "0x10", "1,5", "2.0.0"}) {
    CAPTURE(value);
    CHECK(refusal(value).starts_with("F:3: bowl.mass_kg = " + value + cure));
  }
  CHECK(Refusal("[bowl]\nmass_kg =\n").starts_with("F:2: bowl.mass_kg = " + cure));
}

TEST_CASE("every type says what it expects") {
  const auto in_bowl = [](const std::string& line) { return Refusal("[bowl]\n" + line + "\n"); };
  const auto on_table = [](const std::string& line) { return Refusal("[table]\n" + line + "\n"); };
  CHECK(in_bowl("count = 2.5").starts_with("F:2: bowl.count = 2.5: a whole number from 1 to 9"));
  CHECK(in_bowl("count = 10").starts_with("F:2: bowl.count = 10: a whole number from 1 to 9"));
  CHECK(in_bowl("count = 99999999999").starts_with("F:2: bowl.count = 99999999999: a whole"));
  CHECK(in_bowl("washed = yes").starts_with("F:2: bowl.washed = yes: one of false | true"));
  CHECK(in_bowl("fruit = Pear").starts_with("F:2: bowl.fruit = Pear: one of apple | pear"));
  CHECK(in_bowl("picture =").starts_with("F:2: bowl.picture = : a path is expected"));
  const std::string vector = ": three numbers `x y z`, each from -500 to 500 is expected";
  CHECK(on_table("place_mm = 1 2").starts_with("F:2: table.place_mm = 1 2" + vector));
  CHECK(on_table("place_mm = 1 2 3 4").starts_with("F:2: table.place_mm = 1 2 3 4" + vector));
  CHECK(on_table("place_mm = 1, 2, 3").starts_with("F:2: table.place_mm = 1, 2, 3" + vector));
  CHECK(on_table("place_mm = 1 2 501").starts_with("F:2: table.place_mm = 1 2 501" + vector));
  CHECK(on_table("place_mm = 1 2 nan").starts_with("F:2: table.place_mm = 1 2 nan" + vector));
  for (const std::string value : {"0 0 0, 1 1", "0 0 0,, 1 1 1", "0 0 0,", "0 0 2"}) {
    CAPTURE(value);
    CHECK(on_table("corners_m = " + value)
              .starts_with("F:2: table.corners_m = " + value + ": vectors `x y z, x y z, ...`"));
  }
}

TEST_CASE("an unknown key is refused with the nearest one") {
  CHECK(Refusal("[bowl]\nmas_kg = 1\n") ==
        "F:2: bowl.mas_kg = 1: there is no such key; did you mean bowl.mass_kg?");
  CHECK(Refusal("[tabel]\nplace_mm = 1 2 3\n").find("did you mean table.place_mm?") !=
        std::string::npos);
}

TEST_CASE("a key before any section belongs to none") {
  CHECK(Refusal("count = 2\n[bowl]\n").starts_with("F:1: count = 2: there is no such key"));
}

TEST_CASE("a key stands once") {
  const std::string text = "[bowl]\ncount = 2\n\n[table]\n[bowl]\ncount = 3\n";
  CHECK(Refusal(text).starts_with("F:6: bowl.count: given before, in line 2"));
}

TEST_CASE("a line that is no assignment is refused") {
  CHECK(Refusal("[bowl]\ncount\n") == "F:2: count: a line is `key = value`");
  CHECK(Refusal("[bowl\ncount = 2\n").starts_with("F:1: [bowl: a section is written [name]"));
  CHECK(Refusal("[]\ncount = 2\n").starts_with("F:1: []: a section is written [name]"));
  CHECK(Refusal("[bowl]\n; count = 2\n").starts_with("F:2: "));
}

TEST_CASE("a file that cannot be read is refused with its path and the reason") {
  Bowl bowl;
  CHECK_THROWS_WITH(
      SchemaOf(bowl).Load("no/such/file.ini"),
      "no/such/file.ini: the configuration cannot be read: No such file or directory");
  const std::string folder = std::filesystem::temp_directory_path().string();
  CHECK_THROWS_WITH(SchemaOf(bowl).Load(folder),
                    folder + ": the configuration cannot be read: Is a directory");
}

TEST_CASE(
    "a path is relative to the file that gives it, and with --set, to the working directory") {
  const TemporaryFile file("[bowl]\npicture = ../a/./b.png\n");
  const std::filesystem::path folder = std::filesystem::path(file.path()).parent_path();
  Bowl bowl;
  ConfigSchema schema = SchemaOf(bowl);
  schema.Load(file.path());
  CHECK(bowl.picture == (folder / "../a/b.png").lexically_normal().string());
  schema.Set("bowl.picture=c.png");
  CHECK(bowl.picture == (std::filesystem::current_path() / "c.png").string());
  schema.Set("bowl.picture=/c.png");
  CHECK(bowl.picture == "/c.png");
}

TEST_CASE("an override wins over the file, and the last one wins") {
  const TemporaryFile file("[bowl]\ncount = 2\n");
  Bowl bowl;
  ConfigSchema schema = SchemaOf(bowl);
  schema.Load(file.path());
  schema.Set("bowl.count=4");
  schema.Set("bowl.count = 5 ");
  CHECK(bowl.count == 5);
}

TEST_CASE("a wrong --set is refused like a line of the file") {
  CHECK(SetRefusal("bowl.count") == "--set bowl.count: `section.key=value` is expected");
  CHECK(SetRefusal("bowl.count=10")
            .starts_with("--set bowl.count=10: bowl.count = 10: a whole number from 1 to 9"));
  CHECK(SetRefusal("bowl.cont=1").find("did you mean bowl.count?") != std::string::npos);
}

TEST_CASE("a refusal after reading names the place that gave the value") {
  const TemporaryFile file("[bowl]\n\ncount = 2\n");
  Bowl bowl;
  ConfigSchema schema = SchemaOf(bowl);
  schema.Load(file.path());
  CHECK_THROWS_WITH(schema.Refuse("bowl.count", "too few"),
                    file.path() + ":3: bowl.count = 2: too few");
  CHECK_THROWS_WITH(schema.Refuse("bowl.mass_kg", "too much"),
                    "default: bowl.mass_kg = 1.5: too much");
  schema.Set("bowl.count=3");
  CHECK_THROWS_WITH(schema.Refuse("bowl.count", "odd"), "--set bowl.count=3: bowl.count = 3: odd");
}

TEST_CASE("the description has every key with its value, origin and sentence") {
  const TemporaryFile file("[table]\nplace_mm = 1 2.5 3\n");
  Bowl bowl;
  ConfigSchema schema = SchemaOf(bowl);
  schema.Load(file.path());
  const std::string description = schema.Describe();
  CHECK(description.find("table.place_mm = 1 2.5 3 ") != std::string::npos);
  CHECK(description.find("from " + file.path() + ":2)") != std::string::npos);
  CHECK(description.find(
            "bowl.fruit = apple    # what is in it (one of apple | pear; from default)") !=
        std::string::npos);
  CHECK(schema.Keys() == std::vector<std::string>{"bowl.count", "bowl.fruit", "bowl.mass_kg",
                                                  "bowl.name", "bowl.picture", "bowl.washed",
                                                  "table.corners_m", "table.place_mm"});
  for (const std::string& key : schema.Keys()) {
    CHECK(description.find(key + " = ") != std::string::npos);
  }
}

TEST_CASE("a key cannot be registered twice") {
  Bowl bowl;
  ConfigSchema schema = SchemaOf(bowl);
  CHECK_THROWS_AS(schema.Flag("bowl.washed", &bowl.washed, "again"), std::logic_error);
}

}  // namespace rikiseki
