// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/tev_client.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"

namespace braid {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int kTile = 256;                 // pixels; a tile is sent if it has changed
constexpr milliseconds kPatience(3000);    // for a viewer that takes no more bytes, and for a connection
constexpr milliseconds kRetry(1000);       // between attempts to connect, and between looks whether it is still there
constexpr milliseconds kPollInterval(50);  // how late the end of the render is noticed

std::vector<PixelWindow> tilesOf(int width, int height) {
  std::vector<PixelWindow> tiles;
  for (int y = 0; y < height; y += kTile)
    for (int x = 0; x < width; x += kTile)
      tiles.push_back({x, y, std::min(width, x + kTile), std::min(height, y + kTile)});
  return tiles;
}

// What the viewer knows of an image, to tell which changes it can be sent.
std::string layoutOf(const TevImage& image) {
  std::string text = fmt::format("{}x{}", image.front().plane.width, image.front().plane.height);
  for (const TevChannel& c : image) text += "/" + c.name;
  return text;
}

uint64_t hashOf(const std::string& bytes) {
  ContentHash hash;
  hash.add(bytes);
  return hash.value();
}

}  // namespace

TevAddress parseTevAddress(const std::string& text) {
  TevAddress a;
  const size_t bracket = text.rfind(']'), colon = text.rfind(':');
  const bool hasPort = colon != std::string::npos && (bracket == std::string::npos || bracket < colon);
  a.host = text.substr(0, hasPort ? colon : std::string::npos);
  if (hasPort) a.port = text.substr(colon + 1);
  if (a.host.size() > 2 && a.host.front() == '[' && a.host.back() == ']') a.host = a.host.substr(1, a.host.size() - 2);
  int port = 0;
  const auto parsed = std::from_chars(a.port.data(), a.port.data() + a.port.size(), port);
  if (a.host.empty() || parsed.ec != std::errc() || *parsed.ptr != '\0' || port < 1 || port > 65535)
    throw Error(ExitCode::Usage,
                "'" + text + "': expected HOST:PORT such as 127.0.0.1:14158, the port from 1 to 65535");
  return a;
}

// What the two threads share.
struct TevClient::Mailbox {
  struct Item {
    std::shared_ptr<const TevImage> image;
    uint64_t version = 0;
  };
  std::mutex mutex;
  std::condition_variable changed;
  std::map<std::string, Item> images;
  std::string warning;
  bool warned = false, ending = false, ended = false;
  Clock::time_point deadline;  // of the end
};

// The thread's side: a connection, and what went through it.
class TevClient::Sender {
 public:
  Sender(std::shared_ptr<Mailbox> mailbox, std::string host, std::string port)
      : box_(std::move(mailbox)), host_(std::move(host)), port_(std::move(port)) {}
  ~Sender() { disconnect(); }

  void run() {
    while (std::optional<std::pair<std::string, Mailbox::Item>> next = nextImage()) {
      if ((socket_ < 0 && !connect()) || !send(next->first, next->second)) lose();
    }
    const std::lock_guard lock(box_->mutex);
    box_->ended = true;
    box_->changed.notify_all();
  }

 private:
  struct Sent {
    std::string layout;
    std::vector<uint64_t> tiles;
    uint64_t version = 0;
  };

  // Waits for an image that the viewer does not have yet; nothing: it is time to end.
  std::optional<std::pair<std::string, Mailbox::Item>> nextImage() {
    std::unique_lock lock(box_->mutex);
    while (true) {
      const Clock::time_point now = Clock::now();
      if (box_->ending && (now >= box_->deadline || lost_)) return std::nullopt;
      if (!lost_ || now >= retryAt_)
        for (const auto& [name, item] : box_->images)
          if (sent_[name].version != item.version) return std::pair(name, item);
      if (box_->ending) return std::nullopt;
      box_->changed.wait_for(lock, kRetry / 2);
      if (socket_ >= 0 && viewerHungUp()) {
        disconnect();
        sent_.clear();
      }
    }
  }

  bool viewerHungUp() const {
    pollfd p{socket_, POLLIN | POLLRDHUP, 0};
    return poll(&p, 1, 0) > 0 && (p.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
  }

  void lose() {
    const std::string reason = std::strerror(errno);
    disconnect();
    sent_.clear();
    lost_ = true;
    retryAt_ = Clock::now() + kRetry;
    const std::lock_guard lock(box_->mutex);
    if (!std::exchange(box_->warned, true))
      box_->warning = fmt::format("--tev {}:{}: {}: no images are shown there until the viewer can be reached", host_,
                                  port_, reason_.empty() ? reason : reason_);
  }

  void disconnect() {
    if (socket_ >= 0) close(socket_);
    socket_ = -1;
  }

  bool outOfTime(Clock::time_point limit) const {
    const std::lock_guard lock(box_->mutex);
    return Clock::now() >= (box_->ending ? std::min(limit, box_->deadline) : limit);
  }

  // Waits until the socket takes bytes. False, with errno: it did not within kPatience.
  bool waitWritable() const {
    const Clock::time_point limit = Clock::now() + kPatience;
    do {
      pollfd p{socket_, POLLOUT, 0};
      if (poll(&p, 1, static_cast<int>(kPollInterval.count())) > 0) return true;
    } while (!outOfTime(limit));
    errno = ETIMEDOUT;
    return false;
  }

  bool connect() {
    reason_.clear();
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    const int failure = getaddrinfo(host_.c_str(), port_.c_str(), &hints, &found);
    if (failure != 0) {
      reason_ = gai_strerror(failure);
      return false;
    }
    for (const addrinfo* a = found; a && socket_ < 0; a = a->ai_next) connectTo(*a);
    freeaddrinfo(found);
    lost_ = socket_ < 0;
    return !lost_;
  }

  void connectTo(const addrinfo& a) {
    socket_ = socket(a.ai_family, a.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a.ai_protocol);
    if (socket_ < 0) return;
    int error = ::connect(socket_, a.ai_addr, a.ai_addrlen) == 0 ? 0 : errno;
    if (error == EINPROGRESS) {
      socklen_t size = sizeof error;
      if (!waitWritable())
        error = errno;
      else
        getsockopt(socket_, SOL_SOCKET, SO_ERROR, &error, &size);
    }
    if (error == 0) return;
    disconnect();
    errno = error;
  }

  bool send(const std::string& bytes) const {
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t n = ::send(socket_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
      if (n >= 0)
        done += static_cast<size_t>(n);
      else if (errno != EINTR && ((errno != EAGAIN && errno != EWOULDBLOCK) || !waitWritable()))
        return false;
    }
    return true;
  }

  bool send(const std::string& name, const Mailbox::Item& item) {
    const TevImage& image = *item.image;
    Sent& sent = sent_[name];
    const std::vector<PixelWindow> tiles = tilesOf(image.front().plane.width, image.front().plane.height);
    const std::string layout = layoutOf(image);
    if (sent.layout != layout) {
      if (!send(tevCreatePacket(name, image))) return false;
      sent.layout = layout;
      sent.tiles.assign(tiles.size(), 0);
    }
    for (size_t i = 0; i < tiles.size(); ++i) {
      const std::string packet = tevUpdatePacket(name, image, tiles[i]);
      const uint64_t hash = hashOf(packet);
      if (sent.tiles[i] == hash) continue;
      if (!send(packet)) return false;
      sent.tiles[i] = hash;
    }
    sent.version = item.version;
    return true;
  }

  const std::shared_ptr<Mailbox> box_;
  const std::string host_, port_;
  int socket_ = -1;
  bool lost_ = false;  // the last attempt failed
  Clock::time_point retryAt_;
  std::string reason_;  // of a failure that has no errno
  std::map<std::string, Sent> sent_;
};

TevClient::TevClient(const TevAddress& address) : mailbox_(std::make_shared<Mailbox>()) {
  thread_ = std::thread([box = mailbox_, to = address] { Sender(box, to.host, to.port).run(); });
}

TevClient::~TevClient() {
  bool ended = false;
  {
    std::unique_lock lock(mailbox_->mutex);
    mailbox_->ending = true;
    mailbox_->deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kGrace));
    mailbox_->changed.notify_all();
    ended = mailbox_->changed.wait_until(lock, mailbox_->deadline + 4 * kPollInterval, [&] { return mailbox_->ended; });
  }
  // What may take longer is the look-up of a host's name.
  if (ended)
    thread_.join();
  else
    thread_.detach();
}

void TevClient::show(const std::string& name, TevImage image) {
  auto shared = std::make_shared<const TevImage>(std::move(image));
  const std::lock_guard lock(mailbox_->mutex);
  Mailbox::Item& item = mailbox_->images[name];
  item.image = std::move(shared);
  ++item.version;
  mailbox_->changed.notify_all();
}

std::string TevClient::takeWarning() {
  const std::lock_guard lock(mailbox_->mutex);
  return std::exchange(mailbox_->warning, {});
}

void showInTev(TevClient& tev, const std::string& title, const ImageViews& views) {
  const auto show = [&](const char* view, const Rgb<float>* image, const Plane<float>* error) {
    if (!image) return;
    TevImage planes{{"R", (*image)[0]}, {"G", (*image)[1]}, {"B", (*image)[2]}};
    if (error) planes.push_back({"Error.Y", *error});
    tev.show(fmt::format("{}: {}", title, view), std::move(planes));
  };
  show("noisy", views.noisy, views.noisyError);
  show("combined", views.combined, views.combinedError);
}

}  // namespace braid
