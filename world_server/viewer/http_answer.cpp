// SPDX-License-Identifier: MIT
#include "world_server/viewer/http_answer.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <span>

#include "common/sha256.h"
#include "world_server/viewer/live_message.h"
#include "world_server/viewer/page_files.h"

namespace rikiseki::viewer {
namespace {

constexpr std::uintmax_t kLargestMesh = 64'000'000;  // bytes
constexpr std::string_view kMeshPath = "/mesh/";
constexpr const char* kForeignHost = "the Host header must be an address or localhost";

HttpAnswer Refusal(unsigned status, std::string why) {
  return {status, "text/plain; charset=utf-8", std::move(why) + "\n"};
}

/// The bytes of a mesh file, if they are what the scene's hash says. SPEC.md 6.5-5.
std::optional<std::string> ReadMesh(const protocol::SceneMesh& mesh) {
  const auto end = std::find(mesh.path.begin(), mesh.path.end(), '\0');
  const std::filesystem::path path(std::string(mesh.path.begin(), end));
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  if (std::filesystem::file_size(path, error) > kLargestMesh || error) return std::nullopt;
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto* first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (Sha256(std::span(first, bytes.size())) != mesh.sha256) return std::nullopt;
  return bytes;
}

HttpAnswer AnswerMesh(std::string_view name, const protocol::WorldScene& scene) {
  for (const protocol::SceneMesh& mesh : scene.meshes) {
    if (MeshName(mesh) != name) continue;
    std::optional<std::string> bytes = ReadMesh(mesh);
    if (!bytes) break;
    return {200, "application/octet-stream", std::move(*bytes)};
  }
  return Refusal(404, "no mesh of the running scene has these bytes where the scene says it is");
}

}  // namespace

bool IsOwnHost(std::string_view host) {
  const bool bracketed = host.starts_with('[');
  const std::size_t end = host.find(bracketed ? ']' : ':');
  if (bracketed && end == std::string_view::npos) return false;
  const std::string name(bracketed ? host.substr(1, end - 1) : host.substr(0, end));
  if (name == "localhost") return true;
  std::array<std::uint8_t, sizeof(in6_addr)> address{};
  return inet_pton(bracketed ? AF_INET6 : AF_INET, name.c_str(), address.data()) == 1;
}

std::string RefuseLive(const HttpQuestion& question) {
  if (!IsOwnHost(question.host)) return kForeignHost;
  if (!question.origin.empty() && question.origin != "http://" + std::string(question.host)) {
    return "another web page may not look on";
  }
  return question.target == kLivePath ? "" : "the live stream is at /live";
}

HttpAnswer Answer(const HttpQuestion& question, const protocol::WorldScene& scene) {
  if (!IsOwnHost(question.host)) return Refusal(421, kForeignHost);
  if (question.method != "GET") return Refusal(405, "only GET is answered here");
  for (const PageFile& file : PageFiles()) {
    if (question.target == file.path) return {200, file.type, std::string(file.bytes)};
  }
  if (question.target.starts_with(kMeshPath)) {
    return AnswerMesh(question.target.substr(kMeshPath.size()), scene);
  }
  return Refusal(404, "there is nothing here; the page is at /");
}

}  // namespace rikiseki::viewer
