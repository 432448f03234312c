// SPDX-License-Identifier: MIT
#include "common/config_edit.h"

#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "common/config.h"

namespace rikiseki {
namespace {

constexpr char kBefore[] =
    "# A device of ours.\n"
    "spare.count = 7\n"
    "\n"
    "[spidar]\n"
    "# kg\n"
    "  mass_kg =  0.03   # weighed\n"
    "name=x\r\n"
    "\n"
    "# Behind the section.\n"
    "[usb]\n"
    "mass_kg = 9\n";

TEST_CASE("values are replaced, and nothing else") {
  CHECK(WithValues(kBefore, {}) == kBefore);
  CHECK(WithValues(kBefore, {{"spidar.mass_kg", "0.0415"}, {"spidar.name", "long name"}}) ==
        "# A device of ours.\n"
        "spare.count = 7\n"
        "\n"
        "[spidar]\n"
        "# kg\n"
        "  mass_kg =  0.0415   # weighed\n"
        "name=long name\r\n"
        "\n"
        "# Behind the section.\n"
        "[usb]\n"
        "mass_kg = 9\n");
  CHECK_THAT(WithValues(kBefore, {{"spare.count", "8"}}), Catch::Contains("spare.count = 8\n"));
}

TEST_CASE("what a file does not say yet is added to its section, or with it") {
  CHECK_THAT(WithValues(kBefore, {{"spidar.latency_us", "12"}}),
             Catch::Contains("name=x\r\nlatency_us = 12\n\n# Behind"));
  CHECK_THAT(WithValues(kBefore, {{"new.a", "1"}, {"new.b", "2"}}),
             Catch::EndsWith("mass_kg = 9\n[new]\na = 1\nb = 2\n"));
  CHECK(WithValues("", {{"new.a", "1"}}) == "[new]\na = 1\n");
}

TEST_CASE("a file keeps its permissions and its name, and a link stays one") {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("rikiseki-edit-" + std::to_string(getpid()));
  std::filesystem::create_directory(folder);
  const std::filesystem::path file = folder / "device.ini";
  std::ofstream(file) << kBefore;
  chmod(file.c_str(), 0640);
  std::filesystem::create_symlink(file, folder / "link.ini");

  SetValuesInFile(folder / "link.ini", {{"spidar.mass_kg", "0.5"}});
  CHECK(std::filesystem::is_symlink(folder / "link.ini"));
  struct stat status {};
  stat(file.c_str(), &status);
  CHECK((status.st_mode & 0777) == 0640);
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  CHECK(text.str() == WithValues(kBefore, {{"spidar.mass_kg", "0.5"}}));
  CHECK(std::distance(std::filesystem::directory_iterator(folder), {}) == 2);

  CHECK_THROWS_AS(SetValuesInFile(folder / "absent.ini", {}), ConfigError);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rikiseki
