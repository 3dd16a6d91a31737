// SPDX-License-Identifier: Apache-2.0
// What goes to the viewer tev: read back by a parser written from the description of the protocol alone, and viewers
// that are not there, hang or come and go.
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <mutex>

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include "renderer/film/files/exr.h"
#include "tests/support/running_braid.h"
#include "tools/publish/tev_client.h"

namespace braid::test_tev {

using test::braidRun;
using test::contains;
using test::Folder;
using test::kCornellFile;
using test::readText;
using test::Run;
using test::sleepFor;
using test::waitUntil;

namespace {

// Reads packets: u32 length, u8 type, payload.
class Reader {
 public:
  explicit Reader(std::string bytes) : bytes_(std::move(bytes)) {}
  bool done() const { return at_ == bytes_.size(); }
  template <class T>
  T number() {
    T value;
    REQUIRE(at_ + sizeof value <= bytes_.size());
    std::memcpy(&value, &bytes_[at_], sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const size_t end = bytes_.find('\0', at_);
    REQUIRE(end != std::string::npos);
    const std::string result = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return result;
  }
  size_t at() const { return at_; }
  size_t left() const { return bytes_.size() - at_; }

 private:
  std::string bytes_;
  size_t at_ = 0;
};

struct Shown {
  int width = 0, height = 0;
  std::map<std::string, std::vector<float>> channels;
  std::vector<std::string> names;
};

// The viewer's state after a stream of packets.
struct Viewed {
  std::map<std::string, Shown> images;
  int creates = 0, updates = 0;
  size_t bytes = 0;

  // Whole packets only; what is left of the last one stays for later.
  void read(const std::string& stream) {
    Reader r(stream);
    while (r.left() >= 4) {
      uint32_t size = 0;
      std::memcpy(&size, &stream[r.at()], 4);
      REQUIRE(size >= 5);
      if (r.left() < size) break;
      const size_t begin = r.at();
      packet(r);
      CHECK(r.at() - begin == size);
    }
    bytes = r.at();
  }

 private:
  void packet(Reader& r) {
    r.number<uint32_t>();
    const int type = r.number<uint8_t>();
    CHECK(r.number<uint8_t>() <= 1);
    const std::string name = r.text();
    CHECK((type == 4 || type == 5));
    type == 4 ? create(r, images[name]) : update(r, images.at(name));
  }
  void create(Reader& r, Shown& image) {
    ++creates;
    image = {};
    image.width = r.number<int32_t>();
    image.height = r.number<int32_t>();
    const int count = r.number<int32_t>();
    for (int c = 0; c < count; ++c) {
      image.names.push_back(r.text());
      image.channels[image.names.back()].assign(static_cast<size_t>(image.width * image.height), 0.0f);
    }
  }
  void update(Reader& r, Shown& image) {
    ++updates;
    const int count = r.number<int32_t>();
    std::vector<std::string> names;
    for (int c = 0; c < count; ++c) names.push_back(r.text());
    const int x0 = r.number<int32_t>(), y0 = r.number<int32_t>(), w = r.number<int32_t>(), h = r.number<int32_t>();
    REQUIRE((x0 >= 0 && y0 >= 0 && w > 0 && h > 0 && x0 + w <= image.width && y0 + h <= image.height));
    for (const std::string& name : names)
      for (int y = y0; y < y0 + h; ++y)
        for (int x = x0; x < x0 + w; ++x)
          image.channels.at(name)[static_cast<size_t>(y * image.width + x)] = r.number<float>();
  }
};

// A listening socket in the place of tev. It accepts and reads only when a test asks for it.
class Viewer {
 public:
  explicit Viewer(int port = 0) {
    listener_ = socket(AF_INET, SOCK_STREAM, 0);
    const int yes = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    a.sin_port = htons(static_cast<uint16_t>(port));
    REQUIRE(bind(listener_, reinterpret_cast<sockaddr*>(&a), sizeof a) == 0);
    REQUIRE(listen(listener_, 1) == 0);
    socklen_t size = sizeof a;
    getsockname(listener_, reinterpret_cast<sockaddr*>(&a), &size);
    port_ = ntohs(a.sin_port);
  }
  ~Viewer() {
    if (connection_ >= 0) close(connection_);
    close(listener_);
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  int port() const { return port_; }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  bool connected() const { return connection_ >= 0; }
  bool ended() const { return ended_; }

  // Takes what has arrived, waiting for at most so long.
  void take(double seconds = 0.01) {
    pollfd p{connected() ? connection_ : listener_, POLLIN, 0};
    if (ended_ || poll(&p, 1, static_cast<int>(seconds * 1000)) <= 0) return;
    if (!connected()) {
      connection_ = accept(listener_, nullptr, nullptr);
      return;
    }
    std::array<char, 65536> buffer{};
    const ssize_t n = recv(connection_, buffer.data(), buffer.size(), 0);
    if (n > 0) bytes_.append(buffer.data(), static_cast<size_t>(n));
    ended_ = n <= 0;
  }
  Viewed viewed() const {
    Viewed v;
    v.read(bytes_);
    return v;
  }
  size_t received() const { return bytes_.size(); }

 private:
  int listener_ = -1, connection_ = -1, port_ = 0;
  bool ended_ = false;
  std::string bytes_;
};

Plane<float> pattern(int width, int height, float first) {
  Plane<float> p(width, height);
  for (size_t i = 0; i < p.size(); ++i) p[i] = first + 0.37f * static_cast<float>(i);
  return p;
}

TevImage pictureOf(int width, int height, float first) {
  return {{"R", pattern(width, height, first)},
          {"G", pattern(width, height, first + 1)},
          {"B", pattern(width, height, -first)},
          {"Error.Y", pattern(width, height, 1e-20f)}};
}

bool shows(const Viewed& v, const std::string& name, const TevImage& image) {
  const auto found = v.images.find(name);
  if (found == v.images.end() || found->second.names.size() != image.size()) return false;
  for (const TevChannel& c : image) {
    const std::vector<float>& there = found->second.channels.at(c.name);
    if (there.size() != c.plane.size() || std::memcmp(there.data(), c.plane.data.data(), there.size() * 4) != 0)
      return false;
  }
  return true;
}

double seconds(const std::function<void()>& task) {
  const auto start = std::chrono::steady_clock::now();
  task();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The port of a listener that is gone.
int freePort() { return Viewer().port(); }

}  // namespace

TEST_CASE("Images arrive in tev bit by bit, and only tiles that have changed are sent again") {
  Viewer viewer;
  TevImage image = pictureOf(300, 270, 0.5f);
  image[0].plane[7] = std::numeric_limits<float>::quiet_NaN();
  image[1].plane[8] = std::numeric_limits<float>::infinity();
  TevClient client(viewer.address());
  client.show("a scene: noisy", image);
  CHECK(waitUntil([&] { return viewer.take(), shows(viewer.viewed(), "a scene: noisy", image); }));
  Viewed v = viewer.viewed();
  CHECK(v.images.at("a scene: noisy").names == std::vector<std::string>{"R", "G", "B", "Error.Y"});
  CHECK(v.creates == 1);
  CHECK(v.updates == 4);  // tiles of 256 pixels
  image[2].plane.at(299, 3) = 42;
  client.show("a scene: noisy", image);
  CHECK(waitUntil([&] { return viewer.take(), shows(viewer.viewed(), "a scene: noisy", image); }));
  CHECK(viewer.viewed().updates == 5);
  CHECK(viewer.viewed().creates == 1);
  // Another size or other channels make it anew; other images stay.
  TevImage smaller = pictureOf(1, 1, 3);
  smaller.pop_back();
  client.show("a scene: combined", pictureOf(17, 5, 1));
  client.show("a scene: noisy", smaller);
  CHECK(waitUntil([&] { return viewer.take(), shows(viewer.viewed(), "a scene: noisy", smaller); }));
  CHECK(shows(viewer.viewed(), "a scene: combined", pictureOf(17, 5, 1)));
  CHECK(client.takeWarning().empty());
}

TEST_CASE("What was shown last still arrives when the client ends") {
  Viewer viewer;
  const TevImage image = pictureOf(64, 64, 2);
  const auto show = [&] {
    TevClient client(viewer.address());
    client.show("last", image);
  };
  CHECK(seconds(show) < TevClient::kGrace);
  for (int i = 0; i < 1000 && !viewer.ended(); ++i) viewer.take();
  CHECK(shows(viewer.viewed(), "last", image));
}

TEST_CASE("An absent viewer costs no time and is told of once") {
  const double took = seconds([] {
    TevClient client("127.0.0.1:" + std::to_string(freePort()));
    std::string warning;
    for (int i = 0; i < 50; ++i) client.show("image", pictureOf(64, 64, static_cast<float>(i)));
    CHECK(waitUntil([&] { return !(warning = client.takeWarning()).empty(); }));
    CHECK(contains(warning, "Connection refused"));
    CHECK(warning.find('\n') == std::string::npos);
    client.show("image", pictureOf(64, 64, 1));
    sleepFor(1.2);  // one more attempt
    CHECK(client.takeWarning().empty());
  });
  CHECK(took < 2.0);
}

TEST_CASE("A viewer that comes later, or comes back, gets the newest images") {
  const int port = freePort();
  TevClient client("localhost:" + std::to_string(port));
  const TevImage old = pictureOf(40, 30, 1), image = pictureOf(40, 30, 2);
  client.show("image", old);
  CHECK(waitUntil([&] { return !client.takeWarning().empty(); }));
  client.show("image", image);
  for (int visit = 0; visit < 2; ++visit) {
    Viewer viewer(port);
    CHECK(waitUntil([&] { return viewer.take(), shows(viewer.viewed(), "image", image); }));
    CHECK(viewer.viewed().creates == 1);
  }
  CHECK(client.takeWarning().empty());
}

TEST_CASE("A viewer that hangs holds nobody up") {
  Viewer viewer;  // takes no byte
  auto client = std::make_unique<TevClient>(viewer.address());
  double longest = 0;
  for (int i = 0; i < 8; ++i) {
    TevImage image = pictureOf(1000, 700, static_cast<float>(i));
    longest = std::max(longest, seconds([&] { client->show("image", std::move(image)); }));
  }
  CHECK(longest < 0.2);
  CHECK(seconds([&] { client.reset(); }) < TevClient::kGrace + 1);
}

TEST_CASE("An address that is none is refused") {
  for (const char* address : {"", ":1", "host:", "host:0", "host:70000", "host:12x", "host:-3"}) {
    INFO(address);
    CHECK_THROWS_AS(TevClient{address}, const Error&);
  }
  for (const char* address : {"127.0.0.1", "127.0.0.1:9", "[::1]:9", "[::1]"}) {
    INFO(address);
    CHECK_NOTHROW(TevClient{address});
  }
  const Folder folder;
  const Run run = braidRun(folder, "render '" + kCornellFile + "' -o o.exr --tev here:there");
  CHECK(run.code == 1);
  CHECK(contains(run.err, "expected HOST:PORT"));
}

TEST_CASE("render --tev shows what it saves, and no viewer changes a pixel") {
  const Folder folder;
  const std::string common =
      "render '" + kCornellFile +
      "' --size 64x48 --spp 200 --reproducible --float --combine js --biased box --integrator pt --aovs all";
  CHECK(braidRun(folder, common + " -q -o alone.exr").code == 0);
  const Run run = braidRun(folder, common + " -o absent.exr --tev 127.0.0.1:" + std::to_string(freePort()));
  CHECK(run.code == 0);
  CHECK((readText(folder.path / "alone.exr") == readText(folder.path / "absent.exr")));
  const std::string file = folder.path / "watched.exr";
  Viewer viewer;
  test::Process process({"--size", "64x48", "--spp", "200", "--reproducible", "--float", "--combine", "js", "--biased",
                         "box", "-o", file, "--tev", viewer.address()});
  CHECK(waitUntil([&] { return viewer.take(0.1), viewer.ended(); }));
  CHECK(process.wait() == 0);
  CHECK((readText(folder.path / "alone.exr") == readText(file)));
  const Viewed v = viewer.viewed();
  CHECK(v.bytes == viewer.received());
  const ImageFile saved = readImage(file);
  for (const auto& [view, layer] : {std::pair("noisy", "pt.mean."), {"combined", "combined.js."}})
    for (const char* channel : {"R", "G", "B"}) {
      const Plane<float>& plane = saved.planes.at(std::string(layer) + channel);
      CHECK(std::ranges::equal(v.images.at(std::string("cornell.glb: ") + view).channels.at(channel), plane.data));
    }
  CHECK(
      std::ranges::equal(v.images.at("cornell.glb: combined").channels.at("Error.Y"), saved.planes.at("Error.Y").data));
}

TEST_CASE("A viewer that vanishes in the middle of a render ends nothing") {
  const Folder folder;
  auto viewer = std::make_unique<Viewer>();
  test::Process process({"--size", "64x48", "--time", "2", "--save-every", "0.1", "-o", folder.path / "o.exr", "--tev",
                         viewer->address()});
  CHECK(waitUntil([&] { return viewer->take(), viewer->received() > 20000; }));
  viewer.reset();
  CHECK(process.wait() == 0);
  CHECK(readImage(folder.path / "o.exr").width == 64);
}

}  // namespace braid::test_tev
