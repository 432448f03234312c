// SPDX-License-Identifier: MIT
#include "protocol/peer_link.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <optional>

#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::Eventually;
using test::FreshInstance;
using test::HapticOptions;
using test::TemporaryFolder;

PeerLinkOptions Watching(const std::string& instance) {
  PeerLinkOptions options;
  options.peer.instance = instance;
  options.peer.role = Role::kHaptic;
  options.peer.required = {{StreamType::kHapticTick}};
  options.poll_ms = 3;
  return options;
}

int CountLines(const std::vector<std::string>& news, const std::string& text) {
  return static_cast<int>(std::count_if(news.begin(), news.end(), [&](const std::string& line) {
    return line.find(text) != std::string::npos;
  }));
}

TEST_CASE("either may start first") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SECTION("the reader") {
    PeerLink link(Watching(instance));
    CHECK(link.current() == nullptr);
    CHECK(link.TakeNext() == nullptr);
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    REQUIRE(Eventually([&] { return link.HasNext(); }));
    REQUIRE(link.TakeNext() != nullptr);
    CHECK(link.current()->epoch() == owner.epoch());
    CHECK_FALSE(link.HasNext());
    CHECK(link.TakeNext() == link.current());
  }
  SECTION("the writer") {
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    PeerLink link(Watching(instance));
    REQUIRE(Eventually([&] { return link.HasNext(); }));
    CHECK(link.TakeNext()->Ready());
    CHECK(CountLines(link.PollNews(), "attached") == 1);
  }
}

TEST_CASE("the old view stays readable until the loop takes the next") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  PeerLink link(Watching(instance));
  std::optional<SegmentOwner> owner;
  owner.emplace(HapticOptions(instance, folder.path()));
  auto writer = owner->Writer<HapticTick>();
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  PeerView* const old = link.TakeNext();
  auto reader = old->Reader<HapticTick>();
  writer.Publish(test::Numbered(1), 1);
  HapticTick got;
  REQUIRE(reader.ReadNext(got) == ReadStatus::kFresh);
  writer.Publish(test::Numbered(2), 2);
  writer.Publish(test::Numbered(3), 3);
  const std::uint64_t old_epoch = owner->epoch();
  owner.reset();
  CHECK_FALSE(old->Ready());  // the state says so before the attacher looked
  owner.emplace(HapticOptions(instance, folder.path()));
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  CHECK(old->gone());
  REQUIRE(link.current() == old);
  REQUIRE(reader.ReadNext(got) == ReadStatus::kFresh);
  CHECK(got.tick == 2);
  REQUIRE(reader.ReadNext(got) == ReadStatus::kFresh);
  CHECK(got.tick == 3);
  CHECK(reader.ReadNext(got) == ReadStatus::kEmpty);
  REQUIRE(link.TakeNext() != old);
  CHECK(link.current()->epoch() == owner->epoch());
  CHECK(owner->epoch() > old_epoch);
}

std::size_t CountMappings(const std::string& name) {
  std::ifstream maps("/proc/self/maps");
  std::size_t count = 0;
  for (std::string line; std::getline(maps, line);) count += line.find(name) != std::string::npos;
  return count;
}

std::size_t CountDescriptors() {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}));
}

TEST_CASE("many restarts leave neither maps nor descriptors behind") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const std::size_t descriptors = CountDescriptors();
  {
    PeerLink link(Watching(instance));
    std::uint64_t epoch = 0;
    for (int i = 0; i < 30; ++i) {
      SegmentOwner owner(HapticOptions(instance, folder.path()));
      REQUIRE(Eventually([&] { return link.HasNext(); }));
      REQUIRE(link.TakeNext()->epoch() > epoch);
      epoch = link.current()->epoch();
      CHECK(epoch == owner.epoch());
    }
    // The one that the loop still holds.
    CHECK(Eventually([&] { return CountMappings(SegmentName(instance, Role::kHaptic)) == 1; }));
  }
  CHECK(CountMappings(SegmentName(instance, Role::kHaptic)) == 0);
  CHECK(CountDescriptors() == descriptors);
}

TEST_CASE("an incompatible peer is reported once, by field, and tried again when it changes") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  PeerLinkOptions options = Watching(instance);
  options.peer.required.push_back({StreamType::kWorldFrame});
  PeerLink link(options);
  std::vector<std::string> news;
  const auto gather = [&] {
    for (auto& line : link.PollNews()) news.push_back(std::move(line));
    return news.size();
  };
  for (int restart = 1; restart <= 2; ++restart) {
    SegmentOwner owner(HapticOptions(instance, folder.path()));
    REQUIRE(Eventually([&] { return link.incompatible(); }));
    usleep(30'000);  // ten polls
    CHECK_FALSE(link.HasNext());
    owner.Close();
    CHECK(Eventually([&] { return !link.incompatible(); }));
  }
  gather();
  // The same words about the second: one line is enough.
  CHECK(CountLines(news, "stream type 16 is missing") == 1);
  CHECK(news.size() == 1);
  OwnerOptions right = HapticOptions(instance, folder.path());
  right.streams.push_back({StreamType::kWorldFrame, kWorldFrameBytes, 8, 1'000'000});
  SegmentOwner owner(right);
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  CHECK_FALSE(link.incompatible());
}

TEST_CASE("a refused peer is gone until its object changes") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  PeerLink link(Watching(instance));
  link.Refuse();  // nobody there: nothing happens
  std::optional<SegmentOwner> owner;
  owner.emplace(HapticOptions(instance, folder.path()));
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  link.TakeNext();
  link.Refuse();
  CHECK_FALSE(link.current()->Ready());
  REQUIRE(Eventually([&] { return link.incompatible(); }));
  usleep(30'000);
  CHECK_FALSE(link.HasNext());
  CHECK(CountLines(link.PollNews(), "refused") == 1);
  owner.reset();
  owner.emplace(HapticOptions(instance, folder.path()));
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  CHECK(link.TakeNext()->Ready());
  CHECK_FALSE(link.incompatible());
}

TEST_CASE("a name removed behind the owner's back is reported, and the pair works on") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  PeerLink link(Watching(instance));
  REQUIRE(Eventually([&] { return link.HasNext(); }));
  link.TakeNext();
  link.PollNews();
  shm_unlink(owner.name().c_str());
  std::vector<std::string> news;
  REQUIRE(Eventually([&] {
    for (auto& line : link.PollNews()) news.push_back(std::move(line));
    return !news.empty();
  }));
  CHECK(CountLines(news, "removed the name") == 1);
  CHECK(link.current()->Ready());
}

}  // namespace
}  // namespace rikiseki::protocol
