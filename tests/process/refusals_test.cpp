// SPDX-License-Identifier: MIT
// What a user gets wrong is refused before anything starts: exit 78 and one line that names the file, the
// line, the key or element, and what would be right.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "tests/process/child.h"

namespace {

using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;

// A file that lives as long as its test.
class TemporaryFile {
 public:
  TemporaryFile(const std::string& name, const std::string& text)
      : path_(std::filesystem::temp_directory_path() /
              (static_cast<const std::string&>(Instance()) + "-" + name)) {
    std::ofstream(path_) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

struct Refusal {
  int status;
  std::string line;
};

Refusal Run(const std::vector<std::string>& arguments) {
  Child child(arguments);
  const int status = child.Wait();
  return {status, child.Stderr()};
}

void CheckOneLine(const Refusal& refusal, const std::vector<std::string>& parts) {
  CHECK(refusal.status == 78);
  CHECK(std::count(refusal.line.begin(), refusal.line.end(), '\n') == 1);
  for (const std::string& part : parts) CHECK_THAT(refusal.line, Contains(part));
}

Refusal RunHaptic(const TemporaryFile& file) {
  return Run({Program("haptic_server"), "--config", file.path(), "--instance", Instance()});
}

}  // namespace

TEST_CASE("an unknown key") {
  const TemporaryFile file("bad.ini", "[render]\n# a comment\nstifness_n_per_m = 2000\n");
  CheckOneLine(RunHaptic(file),
               {file.path() + ":3", "render.stifness_n_per_m", "2000", "render.stiffness_n_per_m"});
}

TEST_CASE("a guided procedure on a device of eight strings") {
  for (const char* procedure : {"--calibrate", "--identify", "--z-width"}) {
    CheckOneLine(
        Run({Program("haptic_server"), "--config", SourceFile("config/haptic_server.ini"), "--set",
             "device.file=" + SourceFile("config/devices/spidar_g6x3r_simple.ini"), procedure}),
        {"spidar_g6x3r_simple.ini", "devices of 4 strings only, and this one has 8"});
  }
}

TEST_CASE("a wrong value") {
  const TemporaryFile file("bad.ini", "[render]\nstiffness_n_per_m = stiff\n");
  CheckOneLine(RunHaptic(file),
               {file.path() + ":2", "render.stiffness_n_per_m", "stiff", "a number from"});
}

TEST_CASE("a value out of range, and one that is not finite") {
  const TemporaryFile negative("bad.ini", "[render]\nstiffness_n_per_m = -5\n");
  CheckOneLine(RunHaptic(negative), {negative.path() + ":2", "-5", "a number from"});
  const TemporaryFile infinite("bad.ini", "[safety]\nforce_cap_n = inf\n");
  CheckOneLine(RunHaptic(infinite), {infinite.path() + ":2", "inf", "a number from"});
}

TEST_CASE("a unit in the value") {
  const TemporaryFile file("bad.ini", "[render]\nstiffness_n_per_m = 2 kN/m\n");
  CheckOneLine(RunHaptic(file), {file.path() + ":2", "2 kN/m", "the unit is part of the key"});
}

TEST_CASE("a missing file") {
  CheckOneLine(Run({Program("haptic_server"), "--config", "/nonexistent/haptic.ini"}),
               {"/nonexistent/haptic.ini", "No such file"});
  CheckOneLine(Run({Program("world_server"), "--config", "/nonexistent/world.ini"}),
               {"/nonexistent/world.ini", "No such file"});
}

TEST_CASE("a missing scene") {
  CheckOneLine(Run({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                    "--scene", "/nonexistent/push.sdf"}),
               {"/nonexistent/push.sdf"});
}

TEST_CASE("a broken SDF") {
  const TemporaryFile file("bad.sdf",
                           "<?xml version='1.0'?>\n<sdf version='1.9'>\n<world name='w'>\n");
  CheckOneLine(Run({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                    "--scene", file.path()}),
               {file.path()});
}

TEST_CASE("an SDF that names no world, and one with a shape of nonsense size") {
  const TemporaryFile empty("bad.sdf", "<?xml version='1.0'?>\n<sdf version='1.9'>\n</sdf>\n");
  CheckOneLine(Run({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                    "--scene", empty.path()}),
               {empty.path(), "world"});
  const TemporaryFile negative(
      "bad.sdf",
      "<?xml version='1.0'?>\n<sdf version='1.9'>\n<world name='w'>\n"
      "<model name='m'><link name='l'><collision name='c'><geometry><box>\n"
      "<size>-1 1 1</size></box></geometry></collision></link></model>\n"
      "</world></sdf>\n");
  CheckOneLine(Run({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                    "--scene", negative.path()}),
               {negative.path() + ":4", "box", "above 0"});
}

TEST_CASE("a coupling that does not exist names those that do") {
  CheckOneLine(Run({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                    "--set", "coupling.coupling=magic"}),
               {"coupling.coupling", "magic", "position", "impulse", "local"});
}

TEST_CASE("a wrong command line exits 64") {
  CHECK(Run({Program("haptic_server"), "--confg", "x"}).status == 64);
  CHECK(Run({Program("haptic_server")}).status == 64);
}
