// SPDX-License-Identifier: Apache-2.0
#include "tools/preview/preview_server.h"

#include <atomic>
#include <charconv>
#include <chrono>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <httplib.h>

#include "preview_page.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLongestWait = 5;  // seconds, for a state that is newer
constexpr size_t kThreads = 16;     // each waiting page takes one

// HOST of HOST:PORT.
std::string hostOf(const std::string& authority) {
  const size_t colon = authority.rfind(':');
  return authority.substr(0, colon == std::string::npos || authority.back() == ']' ? authority.size() : colon);
}

// Other names of this machine would let pages of a site that resolves to it read what is served here.
bool namesThisMachine(const httplib::Request& request) {
  const std::string host = hostOf(request.get_header_value("Host"));
  return host == "127.0.0.1" || host == "localhost" || host == "[::1]";
}

// Browsers say which page a request comes from.
bool comesFromOwnPage(const httplib::Request& request) {
  return !request.has_header("Origin") ||
         request.get_header_value("Origin") == "http://" + request.get_header_value("Host");
}

void refuse(httplib::Response& response, int status, const std::string& text) {
  response.status = status;
  response.set_content(text + "\n", "text/plain; charset=utf-8");
}

}  // namespace

struct PreviewServer::Implementation {
  Implementation(PreviewBoard& b, std::function<void()> s) : board(b), stop(std::move(s)) {}

  void handle();
  void sendState(const httplib::Request& request, httplib::Response& response);
  void sendImage(const httplib::Request& request, httplib::Response& response) const;
  httplib::Server::HandlerResponse beforeRouting(const httplib::Request& request, httplib::Response& response) const;

  PreviewBoard& board;
  const std::function<void()> stop;
  httplib::Server server;
  std::thread thread;
  std::string url;
  std::atomic<int> waiting{0};
  std::atomic<Clock::rep> lastAsked{0};
};

void PreviewServer::Implementation::handle() {
  // The library's default also lets several processes share a port.
  server.set_socket_options([](socket_t s) {
    const int yes = 1;
    setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_keep_alive_timeout(1);  // also how long the end may wait for idle connections
  server.set_tcp_nodelay(true);
  server.set_payload_max_length(4096);
  server.set_default_headers({{"Cache-Control", "no-store"}, {"X-Content-Type-Options", "nosniff"}});
  server.set_pre_routing_handler([this](const auto& q, auto& r) { return beforeRouting(q, r); });
  server.Get("/", [](const httplib::Request&, httplib::Response& r) {
    r.set_header("Content-Security-Policy",
                 "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; "
                 "img-src data:");
    r.set_content(kPreviewPage, sizeof kPreviewPage - 1, "text/html; charset=utf-8");
  });
  server.Get("/state.json", [this](const auto& q, auto& r) { sendState(q, r); });
  server.Get("/image", [this](const auto& q, auto& r) { sendImage(q, r); });
}

// Before a body is read: a request to stop needs none, and need not say so.
httplib::Server::HandlerResponse PreviewServer::Implementation::beforeRouting(const httplib::Request& request,
                                                                              httplib::Response& response) const {
  using Result = httplib::Server::HandlerResponse;
  if (!namesThisMachine(request)) {
    refuse(response, 403, "this preview is for browsers of this machine: use http://127.0.0.1");
    return Result::Handled;
  }
  if (request.path != "/stop") return Result::Unhandled;
  if (request.method != "POST") {
    response.set_header("Allow", "POST");
    refuse(response, 405, "stop the render with POST");
  } else if (!comesFromOwnPage(request)) {
    refuse(response, 403, "only the preview's own page may stop the render");
  } else {
    stop();
    response.set_content("{\"schema\":1,\"stopping\":true}\n", "application/json");
  }
  return Result::Handled;
}

void PreviewServer::Implementation::sendState(const httplib::Request& request, httplib::Response& response) {
  const std::string after = request.get_param_value("after");
  uint64_t version = 0;
  const auto parsed = std::from_chars(after.data(), after.data() + after.size(), version);
  if (!after.empty() && (parsed.ec != std::errc() || *parsed.ptr != '\0'))
    return refuse(response, 400, "after: expected the version of an earlier answer");
  if (!after.empty()) {
    ++waiting;
    board.waitForChange(version, kLongestWait);
    --waiting;
  }
  lastAsked = Clock::now().time_since_epoch().count();
  response.set_content(board.state().dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
                       "application/json");
}

void PreviewServer::Implementation::sendImage(const httplib::Request& request, httplib::Response& response) const {
  const std::string view = request.get_param_value("view");
  if (!PreviewBoard::isView(view))
    return refuse(response, 400, "view: expected noisy, combined, error, noisy-error or combined-error");
  const std::shared_ptr<const PreviewImage> image = board.image(view);
  if (!image) return refuse(response, 404, "there is no such image yet");
  response.set_header("X-Braid-Width", std::to_string(image->width));
  response.set_header("X-Braid-Height", std::to_string(image->height));
  response.set_header("X-Braid-Channels", std::to_string(image->channels));
  response.set_header("X-Braid-Exponent", std::to_string(image->exponent));
  response.set_header("X-Braid-Auto-Exposure", fmt::format("{:.2f}", image->autoExposure));
  response.set_header("X-Braid-Spp", std::to_string(image->spp));
  response.set_header("X-Braid-Version", std::to_string(image->version));
  response.set_content_provider(image->pixels.size(), "application/octet-stream",
                                [image](size_t offset, size_t length, httplib::DataSink& sink) {
                                  return sink.write(image->pixels.data() + offset, length);
                                });
}

PreviewServer::PreviewServer(PreviewBoard& board, int port, std::function<void()> stop)
    : implementation_(std::make_unique<Implementation>(board, std::move(stop))) {
  Implementation& i = *implementation_;
  i.handle();
  const char* host = "127.0.0.1";
  if (port == 0)
    port = i.server.bind_to_any_port(host);
  else if (!i.server.bind_to_port(host, port))
    port = -1 - port;
  if (port < 0)
    throw Error(ExitCode::OutputFailed,
                fmt::format("--http {}: cannot listen on {}:{}: the port is taken or not allowed: choose another, or 0 "
                            "for any that is free",
                            -1 - port, host, -1 - port));
  i.url = fmt::format("http://{}:{}/", host, port);
  i.thread = std::thread([&i] { i.server.listen_after_bind(); });
  // The server cannot be stopped before it runs.
  while (!i.server.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

PreviewServer::~PreviewServer() {
  implementation_->board.close();
  implementation_->server.stop();
  implementation_->thread.join();
}

const std::string& PreviewServer::url() const { return implementation_->url; }

bool PreviewServer::watched(double seconds) const {
  if (implementation_->waiting > 0) return true;
  const Clock::rep asked = implementation_->lastAsked;
  return asked > 0 &&
         std::chrono::duration<double>(Clock::now().time_since_epoch() - Clock::duration(asked)).count() < seconds;
}

}  // namespace braid
