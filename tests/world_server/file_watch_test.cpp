// SPDX-License-Identifier: MIT
#include "world_server/file_watch.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "tests/common/temporary_folder.h"

namespace rikiseki::world {
namespace {

// The first look after a change sees it, the second sees that nobody writes any more.
bool TwoLooks(FileWatch& watch) {
  const bool hasty = watch.Look();
  CHECK_FALSE(hasty);
  return watch.Look();
}

}  // namespace

TEST_CASE("a file that is written, renamed over or removed is told once, when it has settled") {
  const TemporaryFolder folder;
  const std::string a = folder.Write("a", "1");
  const std::string b = folder.Write("b", "1");
  FileWatch watch;
  watch.Watch({a, b});
  CHECK_FALSE(TwoLooks(watch));
  folder.Write("b", "12");
  CHECK(TwoLooks(watch));
  CHECK_FALSE(TwoLooks(watch));
  folder.Rename("a", "1");  // the same text is told as well: only its traces are looked at
  CHECK(TwoLooks(watch));
  std::filesystem::remove(a);
  CHECK(TwoLooks(watch));
  CHECK_FALSE(TwoLooks(watch));
  folder.Write("a", "1");
  CHECK(TwoLooks(watch));
}

TEST_CASE("a file that is being written is not told before it rests") {
  const TemporaryFolder folder;
  const std::string a = folder.Write("a", "");
  FileWatch watch;
  watch.Watch({a});
  std::string text;
  for (int i = 0; i < 5; ++i) {
    folder.Write("a", text += "x");
    CHECK_FALSE(watch.Look());
  }
  CHECK(watch.Look());
}

TEST_CASE("a change that is taken back before it was told is none, one that was accepted neither") {
  const TemporaryFolder folder;
  const std::string a = folder.Write("a", "1");
  FileWatch watch;
  watch.Watch({a});
  std::filesystem::rename(a, folder.File("away"));
  CHECK_FALSE(watch.Look());
  watch.Accept();
  CHECK_FALSE(TwoLooks(watch));
  folder.Write("a", "22");
  CHECK(TwoLooks(watch));
}

TEST_CASE("a link that is turned to another file is a change") {
  const TemporaryFolder folder;
  folder.Write("1", "same");
  folder.Write("2", "same");
  const std::string link = folder.File("link");
  std::filesystem::create_symlink("1", link);
  FileWatch watch;
  watch.Watch({link});
  std::filesystem::remove(link);
  std::filesystem::create_symlink("2", link);
  CHECK(TwoLooks(watch));
}

TEST_CASE("what changed while it was read is told after the files are watched again") {
  const TemporaryFolder folder;
  const std::string a = folder.Write("a", "1");
  FileWatch watch;
  watch.Watch({a});
  folder.Write("a", "22");
  CHECK(TwoLooks(watch));
  folder.Write("a", "333");
  const std::string b = folder.Write("b", "1");
  watch.Watch({a, b});
  CHECK(TwoLooks(watch));
  // Of a file that is about to be read for the first time, too.
  const std::string c = folder.Write("c", "1");
  watch.Add(c);
  watch.Add(a);
  folder.Write("c", "22");
  watch.Watch({a, b, c});
  CHECK(TwoLooks(watch));
  watch.Watch({b});
  folder.Write("a", "4444");
  CHECK_FALSE(TwoLooks(watch));
}

}  // namespace rikiseki::world
