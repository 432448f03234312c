// SPDX-License-Identifier: MIT
#include "tests/browser/chromium.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

namespace rikiseki::test {
namespace {

using Json = nlohmann::json;
using boost::system::error_code;

constexpr auto kPatience = std::chrono::seconds(60);

std::vector<std::string> Command(const std::string& profile) {
  return {RIKISEKI_CHROMIUM,
          "--headless=new",
          "--no-sandbox",
          "--disable-dev-shm-usage",
          "--enable-unsafe-swiftshader",
          "--no-first-run",
          "--disable-extensions",
          "--disable-background-networking",
          "--disable-component-update",
          "--disable-sync",
          "--hide-scrollbars",
          "--remote-debugging-port=0",
          "--user-data-dir=" + profile,
          "about:blank"};
}

/// Port and path of the browser's own DevTools endpoint, once it has written them down.
std::pair<int, std::string> Endpoint(const std::filesystem::path& profile, Child& process) {
  const auto limit = std::chrono::steady_clock::now() + kPatience;
  while (std::chrono::steady_clock::now() < limit && process.IsRunning()) {
    std::ifstream file(profile / "DevToolsActivePort");
    int port = 0;
    std::string path;
    if (file >> port >> path) return {port, path};
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  throw std::runtime_error("Chromium did not start: " + process.Stderr());
}

std::string FromBase64(const std::string& text) {
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const std::string_view digits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const std::size_t digit = digits.find(c);
    if (digit == std::string_view::npos) break;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes += static_cast<char>(bits >> count & 0xff);
  }
  return bytes;
}

}  // namespace

/// The sockets to the browser and to its page.
class Chromium::DevTools {
 public:
  /// Connects to the browser and opens an empty page.
  DevTools(int port, const std::string& path) {
    browser_ = Connect(port, path);
    const Json target = Call(*browser_, "Target.createTarget", {{"url", "about:blank"}});
    page_ = Connect(port, "/devtools/page/" + target["targetId"].get<std::string>());
  }

  Json CallPage(const std::string& method, const Json& parameters) {
    return Call(*page_, method, parameters);
  }
  void Close() { Call(*browser_, "Browser.close", Json::object()); }

 private:
  using Socket = boost::beast::websocket::stream<boost::asio::ip::tcp::socket>;

  std::unique_ptr<Socket> Connect(int port, const std::string& path) {
    auto socket = std::make_unique<Socket>(context_);
    socket->read_message_max(64 << 20);
    socket->next_layer().connect(
        {boost::asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(port)});
    Await("handshake " + path, [&](const auto& finished) {
      socket->async_handshake("127.0.0.1:" + std::to_string(port), path, finished);
    });
    return socket;
  }

  Json Call(Socket& socket, const std::string& method, const Json& parameters) {
    const int id = ++calls_;
    socket.write(
        boost::asio::buffer(Json{{"id", id}, {"method", method}, {"params", parameters}}.dump()));
    while (true) {
      boost::beast::flat_buffer buffer;
      Await(method, [&](const auto& finished) {
        socket.async_read(buffer, [finished](error_code error, std::size_t) { finished(error); });
      });
      const Json answer = Json::parse(boost::beast::buffers_to_string(buffer.data()));
      if (answer.value("id", 0) != id) continue;  // an event
      if (answer.contains("error"))
        throw std::runtime_error(method + ": " + answer["error"].dump());
      return answer["result"];
    }
  }

  /// Begins an operation and waits for its end, at most kPatience: nothing here takes so long.
  template <typename Begin>
  void Await(const std::string& what, const Begin& begin) {
    bool done = false;
    error_code failure;
    begin([&done, &failure](error_code error) {
      failure = error;
      done = true;
    });
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (!done && std::chrono::steady_clock::now() < limit) {
      context_.restart();
      context_.run_one_for(std::chrono::milliseconds(100));
    }
    if (!done) throw std::runtime_error("Chromium does not answer: " + what);
    if (failure) throw boost::system::system_error(failure, what);
  }

  boost::asio::io_context context_;
  std::unique_ptr<Socket> browser_;
  std::unique_ptr<Socket> page_;
  int calls_ = 0;
};

Chromium::Chromium(const std::string& url, int width, int height)
    : process_(Command(profile_.File(""))) {
  const auto [port, path] = Endpoint(profile_.File(""), process_);
  devtools_ = std::make_unique<DevTools>(port, path);
  Resize(width, height);
  Call("Page.navigate", {{"url", url}});
}

Chromium::~Chromium() {
  try {
    devtools_->Close();
  } catch (const std::exception&) {  // then it is killed below
  }
  process_.Wait(10);
}

Json Chromium::Call(const std::string& method, const Json& parameters) {
  return devtools_->CallPage(method, parameters);
}

Json Chromium::Evaluate(const std::string& expression) {
  const Json answer =
      Call("Runtime.evaluate",
           {{"expression", expression}, {"returnByValue", true}, {"awaitPromise", true}});
  if (answer.contains("exceptionDetails")) {
    throw std::runtime_error(expression + ": " + answer["exceptionDetails"].dump());
  }
  return answer["result"].value("value", Json());
}

void Chromium::Press(const std::string& key, bool shift) {
  Json event{{"type", "keyDown"}, {"key", key}, {"modifiers", shift ? 8 : 0}};
  Call("Input.dispatchKeyEvent", event);
  event["type"] = "keyUp";
  Call("Input.dispatchKeyEvent", event);
}

void Chromium::Resize(int width, int height) {
  Call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
}

void Chromium::SetDark(bool dark) {
  Call("Emulation.setEmulatedMedia",
       {{"features", {{{"name", "prefers-color-scheme"}, {"value", dark ? "dark" : "light"}}}}});
}

std::string Chromium::Screenshot(const std::string& name) {
  const std::string png =
      FromBase64(Call("Page.captureScreenshot", Json::object())["data"].get<std::string>());
  std::filesystem::create_directories(RIKISEKI_ARTEFACTS_DIR);
  std::ofstream(std::filesystem::path(RIKISEKI_ARTEFACTS_DIR) / (name + ".png"), std::ios::binary)
      << png;
  return png;
}

}  // namespace rikiseki::test
