// SPDX-License-Identifier: MIT
#include "world_server/viewer/http_answer.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <span>
#include <string>

#include "common/sha256.h"
#include "tests/common/temporary_folder.h"
#include "world_server/viewer/live_message.h"

namespace rikiseki::viewer {
namespace {

HttpQuestion Get(std::string_view target) {
  return {.method = "GET", .target = target, .host = "127.0.0.1:8037", .origin = ""};
}

/// A scene with one mesh: this file, by the hash of `bytes`.
protocol::WorldScene SceneWithMesh(const std::string& path, const std::string& bytes) {
  protocol::SceneMesh mesh;
  const auto* first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  mesh.sha256 = Sha256(std::span(first, bytes.size()));
  std::copy(path.begin(), path.end(), mesh.path.begin());
  protocol::WorldScene scene;
  scene.meshes.push_back(mesh);
  return scene;
}

TEST_CASE("only addresses and localhost are this page's own") {
  for (const char* own : {"127.0.0.1:8037", "127.0.0.1", "localhost", "localhost:1", "[::1]:8037",
                          "[fe80::1]", "192.168.0.7:80"}) {
    CHECK(IsOwnHost(own));
  }
  for (const char* foreign : {"", "evil.example", "evil.example:8037", "localhost.evil.example",
                              "127.0.0.1.evil.example:8037", "[", "[]", "[::1", ":8037", "::1"}) {
    CHECK_FALSE(IsOwnHost(foreign));
  }
}

TEST_CASE("the live stream is for this page, not for another one in the same browser") {
  HttpQuestion question = Get(kLivePath);
  CHECK(RefuseLive(question).empty());  // a program
  question.origin = "http://127.0.0.1:8037";
  CHECK(RefuseLive(question).empty());
  for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1:80",
                             "https://127.0.0.1:8037", "http://127.0.0.1:8037.evil.example"}) {
    question.origin = origin;
    CHECK_FALSE(RefuseLive(question).empty());
  }
  // A name that leads here, as its page would ask for it.
  question.host = "evil.example:8037";
  question.origin = "http://evil.example:8037";
  CHECK_FALSE(RefuseLive(question).empty());
  CHECK_FALSE(RefuseLive(Get("/lives")).empty());
}

TEST_CASE("the page's files are there, and nothing else") {
  const protocol::WorldScene scene;
  const HttpAnswer page = Answer(Get("/"), scene);
  CHECK(page.status == 200);
  CHECK(page.type == "text/html; charset=utf-8");
  CHECK(page.body.find("/viewer.js") != std::string::npos);
  CHECK(Answer(Get("/style.css"), scene).type == "text/css; charset=utf-8");
  const HttpAnswer script = Answer(Get("/viewer.js"), scene);
  CHECK(script.status == 200);
  CHECK(script.body.find("from\"three") ==
        std::string::npos);  // bundled: nothing is left to be fetched
  CHECK(script.body.size() > 100'000);
  CHECK(Answer(Get("/etc/passwd"), scene).status == 404);
  CHECK(Answer(Get("/../etc/passwd"), scene).status == 404);
  HttpQuestion question = Get("/");
  question.method = "POST";
  CHECK(Answer(question, scene).status == 405);
  question.host = "evil.example";
  CHECK(Answer(question, scene).status == 421);
}

TEST_CASE("a mesh is handed out by its hash, and only with the bytes that have it") {
  const TemporaryFolder folder;
  const std::string bytes("solid\0cube", 10);
  const std::string path = folder.Write("cube.stl", bytes);
  protocol::WorldScene scene = SceneWithMesh(path, bytes);
  const std::string name = "/mesh/" + MeshName(scene.meshes[0]);
  CHECK(name.size() == 6 + 64);
  CHECK(Answer(Get(name), scene).status == 200);
  CHECK(Answer(Get(name), scene).body == bytes);
  CHECK(Answer(Get("/mesh/"), scene).status == 404);
  CHECK(Answer(Get(name), protocol::WorldScene()).status == 404);  // of another scene

  folder.Write("cube.stl", "another");
  CHECK(Answer(Get(name), scene).status == 404);
  scene = SceneWithMesh(folder.File("absent.stl"), bytes);
  CHECK(Answer(Get(name), scene).status == 404);
  scene = SceneWithMesh(folder.File(""), "");  // a folder
  CHECK(Answer(Get("/mesh/" + MeshName(scene.meshes[0])), scene).status == 404);
  scene.meshes[0].path.fill('x');  // a path without an end
  CHECK(Answer(Get("/mesh/" + MeshName(scene.meshes[0])), scene).status == 404);
}

}  // namespace
}  // namespace rikiseki::viewer
