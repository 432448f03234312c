// SPDX-License-Identifier: MIT
// Serves the page and the live stream to any number of browsers up to a limit, from one thread.
//
// Never queued without bound: a browser that has not taken in kUpdatesAhead updates gets no further
// one, and then the newest. It says that it has by any message; more than it was sent it cannot
// claim. Who is silent for 20 s, or half a request for 5 s, is cut off.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstddef>
#include <cstdint>
#include <string>

#include "world_server/viewer/pair_watch.h"

namespace rikiseki::viewer {

inline constexpr std::size_t kMostConnections = 128;

class Server {
 public:
  /// Listens; port 0 takes a free one. Throws StartError where it cannot: 64 for what is no address,
  /// 75 for one that is taken.
  Server(PairWatch& watch, const std::string& address, std::uint16_t port);

  boost::asio::io_context& context() { return context_; }
  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

  /// Serves until the context is stopped.
  void Run() { context_.run(); }

 private:
  void Accept();

  PairWatch& watch_;
  std::size_t connections_ = 0;  // counted by those that context_ still holds: it goes first
  boost::asio::io_context context_{1};
  boost::asio::ip::tcp::acceptor acceptor_{context_};
  boost::asio::steady_timer pause_{context_};
};

}  // namespace rikiseki::viewer
