// SPDX-License-Identifier: MIT
// Clients that mean no good: the viewer goes on, serves those that do, and the pair does not notice.
#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <random>
#include <thread>

#include "tests/browser/raw_client.h"
#include "tests/browser/watched_pair.h"
#include "tests/process/observer.h"
#include "world_server/viewer/live_message.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)

constexpr double kCutOff = 5;  // s, how long half a request may take; the test waits twice as long
constexpr double kSlewLimit = 5000;
constexpr std::size_t kHead = 4096;

std::string StatusLine(const std::string& answer) {
  return answer.substr(0, answer.find("\r\n"));
}

/// Whether an honest client gets the page: it may have to wait until the others are cut off.
bool ServesThePage(int port) {
  return Eventually(
      [port] {
        const RawClient client(port);
        client.Send(GetRequest(port, "/"));
        return StatusLine(client.Read(kHead, kCutOff)).find(" 200 ") != std::string::npos;
      },
      60);
}

/// Binary messages in what a live stream sent, its HTTP head first. Server frames are not masked.
std::size_t CountUpdates(const std::string& stream) {
  std::size_t at = stream.find("\r\n\r\n") + 4;
  std::size_t updates = 0;
  while (at + 10 <= stream.size()) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(stream[at + i]); };
    std::size_t length = byte(1);
    std::size_t head = 2;
    if (length >= 126) {
      const std::size_t wide = length == 126 ? 2 : 8;
      length = 0;
      for (std::size_t i = 0; i < wide; ++i) length = length << 8 | byte(2 + i);
      head += wide;
    }
    if ((byte(0) & 15) == 2) ++updates;
    at += head + length;
  }
  return updates;
}

/// One masked text message "+", mask 0.
const std::string kWord("\x81\x81\0\0\0\0+", 7);

std::size_t ResidentKb(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stoul(line.substr(6));
  }
  return 0;
}

}  // namespace

TEST_CASE("a browser that says nothing gets as many updates as are sent ahead, and no more") {
  WatchedPair pair;
  pair.StartAll();
  Observe(pair.instance(), protocol::Role::kHaptic);
  const RawClient silent(pair.port());
  silent.Send(LiveRequest(pair.port()));
  CHECK(CountUpdates(silent.Read(10'000'000, 1)) == viewer::kUpdatesAhead);
  // One word, one update more.
  silent.Send(kWord);
  CHECK(CountUpdates("\r\n\r\n" + silent.Read(10'000'000, 1)) == 1);
}

TEST_CASE("foreign pages and foreign names get nothing") {
  WatchedPair pair;
  pair.StartViewer();
  const int port = pair.port();
  const auto answer = [port](const std::string& request) {
    const RawClient client(port);
    client.Send(request);
    return StatusLine(client.Read(kHead, kCutOff));
  };
  const std::string own = "Origin: http://127.0.0.1:" + std::to_string(port) + "\r\n";
  CHECK(answer(LiveRequest(port, own)) == "HTTP/1.1 101 Switching Protocols");
  CHECK(answer(LiveRequest(port, "Origin: http://evil.example\r\n")) == "HTTP/1.1 403 Forbidden");
  CHECK(answer("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").find(" 421 ") != std::string::npos);
  CHECK(answer("GET / HTTP/1.1\r\n\r\n").find(" 421 ") != std::string::npos);
  CHECK(answer("DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n").find(" 405 ") != std::string::npos);
  CHECK(answer(GetRequest(port, "/mesh/../../etc/passwd")) == "HTTP/1.1 404 Not Found");
}

TEST_CASE(
    "garbage, half requests and a thousand connections neither end it nor reach the daemons") {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  const rlimit soft = files;
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  const std::size_t most = std::min<std::size_t>(1000, files.rlim_cur - 100);

  WatchedPair pair;
  pair.StartAll();
  const int port = pair.port();
  const TickWatch watch(pair.instance(), kSlewLimit);
  const auto haptic = Observe(pair.instance(), protocol::Role::kHaptic);
  const auto world = Observe(pair.instance(), protocol::Role::kWorld);
  REQUIRE(ServesThePage(port));
  const std::size_t before_kb = ResidentKb(pair.viewer->pid());

  std::mt19937 random(1);
  const auto garbage = [&random](std::size_t length) {
    std::string bytes(length, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    return bytes;
  };
  {
    std::vector<RawClient> crowd;
    for (std::size_t i = 0; i < most; ++i) {
      RawClient& client = crowd.emplace_back(port);
      switch (i % 5) {
        case 0:
          client.Send(garbage(1 + random() % 2000));
          break;
        case 1:
          client.Send("GET / HTTP/1.1\r\nHost: 127.");  // and no more
          break;
        case 2:
          client.Send("GET / HTTP/1.1\r\nX: " + std::string(20'000, 'x'));
          break;
        case 3:
          client.Send(LiveRequest(port) + garbage(1 + random() % 2000));
          break;
        case 4:
          break;  // not a word
      }
    }
    CHECK(pair.viewer->IsRunning());
  }
  REQUIRE(ServesThePage(port));

  // Live streams that break the rules of WebSocket, one by one, so that each is let in.
  for (int i = 0; i < 100; ++i) {
    const RawClient client(port);
    client.Send(LiveRequest(port));
    client.Read(129, kCutOff);
    client.Send(garbage(1 + random() % 300));
  }
  const RawClient giant(port);
  giant.Send(LiveRequest(port));
  giant.Read(129, kCutOff);
  giant.Send(std::string("\x82\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14));  // 2^63 bytes
  // It claims to have taken in everything, and reads nothing.
  const RawClient liar(port);
  liar.Send(LiveRequest(port));
  std::string words;
  for (int i = 0; i < 1000; ++i) words += kWord;
  for (int i = 0; i < 20; ++i) {
    liar.Send(words);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  REQUIRE(ServesThePage(port));
  CHECK(pair.viewer->IsRunning());
  // What 128 connections may hold: 2 * 8 kB each of request, some updates of some kB, and the
  // allocator's slack.
  CHECK(ResidentKb(pair.viewer->pid()) < before_kb + 32'000);

  CHECK(pair.haptic->IsRunning());
  CHECK(pair.world->IsRunning());
  CHECK(haptic->Ready());
  CHECK(world->Ready());
  const std::uint64_t tick = watch.Latest().tick;
  CHECK(Eventually([&] { return watch.Latest().tick > tick + 100; }));
  CHECK(watch.finite());
  CHECK(watch.worst_over_cap() <= 1e-9);
  setrlimit(RLIMIT_NOFILE, &soft);
}
