// SPDX-License-Identifier: MIT
#include "world_server/viewer/live_stream.h"

#include <chrono>
#include <utility>

#include "common/clock.h"

namespace rikiseki::viewer {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr auto kUpdateEvery = std::chrono::milliseconds(16);
constexpr auto kHandshakeTime = std::chrono::seconds(5);
constexpr auto kSilence = std::chrono::seconds(20);  // of a browser: not even a pong
constexpr std::size_t kLargestWord = 64;             // of a browser to us, bytes

}  // namespace

LiveStream::LiveStream(beast::tcp_stream stream, PairWatch& watch, CountedConnection counted)
    : socket_(std::move(stream)),
      pace_(socket_.get_executor()),
      watch_(watch),
      counted_(std::move(counted)),
      credit_(kUpdatesAhead) {
  socket_.set_option(websocket::stream_base::timeout{
      .handshake_timeout = kHandshakeTime, .idle_timeout = kSilence, .keep_alive_pings = true});
  socket_.read_message_max(kLargestWord);
  socket_.auto_fragment(false);
}

void LiveStream::Start(const HttpRequest& request) {
  beast::get_lowest_layer(socket_).expires_never();  // the WebSocket keeps its own time
  error_code ignored;
  beast::get_lowest_layer(socket_).socket().set_option(boost::asio::ip::tcp::no_delay(true),
                                                       ignored);
  socket_.async_accept(request, [self = shared_from_this()](error_code error) {
    if (error) return;
    self->Listen();
    self->Tell();
  });
}

// Not while there is nothing to be said for: a flood of words waits in its sender.
void LiveStream::Listen() {
  if (listening_ || credit_ >= kUpdatesAhead || ended_) return;
  listening_ = true;
  socket_.async_read(word_, [self = shared_from_this()](error_code error, std::size_t) {
    self->listening_ = false;
    if (error) return self->End();
    self->word_.consume(self->word_.size());
    ++self->credit_;
    self->Listen();
  });
}

void LiveStream::TellSoon() {
  pace_.expires_after(kUpdateEvery);
  pace_.async_wait([self = shared_from_this()](error_code error) {
    if (!error) self->Tell();
  });
}

void LiveStream::Tell() {
  if (ended_) return;
  watch_.Poll(MonotonicNow());  // also for a slow browser: what it will be told must not be missed
  if (credit_ == 0) return TellSoon();
  --credit_;
  Listen();
  if (!SceneIsNews(watch_, told_)) return TellUpdate();
  message_ = SceneMessage(watch_, told_);
  socket_.text(true);
  socket_.async_write(boost::asio::buffer(message_),
                      [self = shared_from_this()](error_code error, std::size_t) {
                        if (error) return self->End();
                        self->TellUpdate();
                      });
}

void LiveStream::TellUpdate() {
  message_ = UpdateMessage(watch_, MonotonicNow(), told_);
  socket_.binary(true);
  socket_.async_write(boost::asio::buffer(message_),
                      [self = shared_from_this()](error_code error, std::size_t) {
                        if (error) return self->End();
                        self->TellSoon();
                      });
}

void LiveStream::End() {
  ended_ = true;
  pace_.cancel();
  beast::get_lowest_layer(socket_).close();
}

}  // namespace rikiseki::viewer
