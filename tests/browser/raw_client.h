// SPDX-License-Identifier: MIT
// A TCP client that may be as rude as it likes: what it sends is not looked at.
#pragma once

#include <string>

namespace rikiseki::test {

class RawClient {
 public:
  /// Connects to 127.0.0.1. Throws std::system_error.
  explicit RawClient(int port);
  ~RawClient();
  RawClient(RawClient&& other) noexcept;
  RawClient& operator=(RawClient&&) = delete;

  /// What the peer does not take at once is dropped, and so is what it refuses.
  void Send(const std::string& bytes) const;

  /// What comes until `bytes` are there, the peer closes, or nothing comes for `silence_s`.
  std::string Read(std::size_t bytes, double silence_s) const;

 private:
  int socket_;
};

/// A TCP port of 127.0.0.1 that nobody uses now.
int FreePort();

/// Waits until something listens on a port of 127.0.0.1, at most 30 s; whether it came.
bool WaitForPort(int port);

/// "GET target HTTP/1.1" with Host, `more` headers, and the end.
std::string GetRequest(int port, const std::string& target, const std::string& more = "");

/// The request that opens the live stream.
std::string LiveRequest(int port, const std::string& more = "");

}  // namespace rikiseki::test
