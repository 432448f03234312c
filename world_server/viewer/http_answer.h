// SPDX-License-Identifier: MIT
// What the viewer's HTTP answers: the page's files, and the mesh files of the running scene.
//
// Whom it answers: a Host header that is an address or localhost, and for the live stream an Origin
// that is this page's own. A foreign web page in the same browser, or a foreign name that leads here
// (DNS rebinding), gets nothing: what is shown is motion data of people.
#pragma once

#include <string>
#include <string_view>

#include "protocol/messages.h"

namespace rikiseki::viewer {

/// Where the live stream is.
inline constexpr std::string_view kLivePath = "/live";

struct HttpQuestion {
  std::string_view method;  // "GET"
  std::string_view target;  // "/"
  std::string_view host;    // headers; empty where they are absent
  std::string_view origin;
};

struct HttpAnswer {
  unsigned status = 200;
  std::string_view type;  // of the content
  std::string body;
};

/// Is this the address of an own page: "127.0.0.1:8037", "[::1]:8037", "localhost"?
bool IsOwnHost(std::string_view host);

/// Empty, or why a WebSocket that is asked for so is refused.
std::string RefuseLive(const HttpQuestion& question);

/// A mesh file is named /mesh/<SHA-256>; it is read where the scene says, and handed out only if it
/// is a regular file of at most 64 MB whose bytes have that hash.
HttpAnswer Answer(const HttpQuestion& question, const protocol::WorldScene& scene);

}  // namespace rikiseki::viewer
