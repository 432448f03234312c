// SPDX-License-Identifier: MIT
#include "world_server/viewer/server.h"

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <memory>
#include <string_view>
#include <utility>

#include "common/clock.h"
#include "common/exit_code.h"
#include "world_server/viewer/connection_count.h"
#include "world_server/viewer/http_answer.h"
#include "world_server/viewer/live_stream.h"

namespace rikiseki::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

constexpr auto kRequestTime = std::chrono::seconds(5);  // for a whole request, and for its answer
constexpr auto kPause = std::chrono::milliseconds(100);
constexpr std::uint32_t kLargestHeader = 8192;

std::string_view View(beast::string_view text) {
  return {text.data(), text.size()};
}
beast::string_view View(std::string_view text) {
  return {text.data(), text.size()};
}

/// One connection: one request, which is answered or becomes a live stream.
class Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(tcp::socket socket, PairWatch& watch, CountedConnection counted)
      : stream_(std::move(socket)), watch_(watch), counted_(std::move(counted)) {
    parser_.header_limit(kLargestHeader);
    parser_.body_limit(std::uint64_t{0});
  }

  void Start() {
    stream_.expires_after(kRequestTime);
    http::async_read(stream_, buffer_, parser_,
                     [self = shared_from_this()](error_code error, std::size_t) {
                       if (!error) self->Reply();
                     });
  }

 private:
  void Reply() {
    const HttpRequest request = parser_.release();
    const auto header = [&request](http::field field) { return View(request[field]); };
    const HttpQuestion question{.method = View(request.method_string()),
                                .target = View(request.target()),
                                .host = header(http::field::host),
                                .origin = header(http::field::origin)};
    if (!beast::websocket::is_upgrade(request)) {
      watch_.Poll(MonotonicNow());
      return Send(Answer(question, watch_.scene()));
    }
    std::string refusal = RefuseLive(question);
    if (!refusal.empty()) return Send({403, "text/plain; charset=utf-8", std::move(refusal)});
    std::make_shared<LiveStream>(std::move(stream_), watch_, std::move(counted_))->Start(request);
  }

  void Send(HttpAnswer answer) {
    response_.result(answer.status);
    response_.set(http::field::content_type, View(answer.type));
    response_.set(http::field::cache_control, "no-store");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Content-Security-Policy",
                  "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'");
    response_.keep_alive(false);
    response_.body() = std::move(answer.body);
    response_.prepare_payload();
    stream_.expires_after(kRequestTime);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](error_code, std::size_t) { self->End(); });
  }

  void End() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  beast::tcp_stream stream_;
  PairWatch& watch_;
  CountedConnection counted_;
  beast::flat_buffer buffer_{2 * kLargestHeader};
  http::request_parser<http::string_body> parser_;
  http::response<http::string_body> response_;
};

}  // namespace

Server::Server(PairWatch& watch, const std::string& address, std::uint16_t port) : watch_(watch) {
  error_code error;
  const asio::ip::address ip = asio::ip::make_address(address, error);
  if (error) throw StartError(kExitUsage, "--address " + address + ": not an IP address");
  const tcp::endpoint endpoint(ip, port);
  try {
    acceptor_.open(endpoint.protocol());
    acceptor_.set_option(asio::socket_base::reuse_address(true));
    acceptor_.bind(endpoint);
    acceptor_.listen();
  } catch (const boost::system::system_error& failure) {
    throw StartError(kExitTemporary, "cannot listen on " + address + " port " +
                                         std::to_string(port) + ": " + failure.code().message());
  }
  Accept();
}

void Server::Accept() {
  acceptor_.async_accept([this](error_code error, tcp::socket socket) {
    if (error) {  // no descriptors left: some will be given back
      pause_.expires_after(kPause);
      pause_.async_wait([this](error_code stopped) {
        if (!stopped) Accept();
      });
      return;
    }
    if (connections_ < kMostConnections) {
      std::make_shared<Visit>(std::move(socket), watch_, CountedConnection(connections_))->Start();
    }
    Accept();
  });
}

}  // namespace rikiseki::viewer
