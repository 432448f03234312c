// SPDX-License-Identifier: MIT
// The live stream to one browser: updates at up to 60 Hz, as many as it takes in.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket.hpp>
#include <memory>
#include <string>

#include "world_server/viewer/connection_count.h"
#include "world_server/viewer/live_message.h"
#include "world_server/viewer/pair_watch.h"

namespace rikiseki::viewer {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;

/// Lives as long as an operation of it is under way.
class LiveStream : public std::enable_shared_from_this<LiveStream> {
 public:
  LiveStream(boost::beast::tcp_stream stream, PairWatch& watch, CountedConnection counted);

  /// Accepts the WebSocket that `request` asks for, then goes on by itself.
  void Start(const HttpRequest& request);

 private:
  void Listen();
  void TellSoon();
  void Tell();
  void TellUpdate();
  void End();

  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  boost::asio::steady_timer pace_;
  PairWatch& watch_;
  CountedConnection counted_;
  Told told_;
  std::string message_;  // being sent
  boost::beast::flat_buffer word_;
  int credit_;  // updates that it may be sent before it says a word
  bool listening_ = false;
  bool ended_ = false;
};

}  // namespace rikiseki::viewer
