// SPDX-License-Identifier: Apache-2.0
// `braid preview` by HTTP: what it answers, to whom, and how it is stopped.
#include <cmath>
#include <sstream>

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "renderer/film/files/exr.h"
#include "tests/support/running_braid.h"
#include "tests/tools/preview/half_floats.h"

namespace braid::test_preview {

namespace fs = braid::test::fs;
using namespace test::half_floats;
using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::kCornellFile;
using test::readText;
using test::Run;
using test::waitUntil;

namespace {

std::vector<std::string> previewWords(const std::vector<std::string>& more) {
  std::vector<std::string> words{"--http", "0", "--size", "48x32", "--threads", "1", "--aovs", "all"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// `braid preview` of a small Cornell box at a free port.
class Preview : public test::Process {
 public:
  explicit Preview(const Folder& folder, const std::vector<std::string>& more = {})
      : Process(previewWords(more), "preview", folder.path / "url") {
    const fs::path printed = folder.path / "url";
    REQUIRE(waitUntil([&] { return contains(readText(printed), "\n"); }));
    const std::string url = readText(printed), head = "http://127.0.0.1:";
    REQUIRE(url.substr(0, head.size()) == head);
    port_ = std::stoi(url.substr(head.size()));
  }

  int port() const { return port_; }

 private:
  int port_ = 0;
};

int connectTo(int port) {
  sockaddr_in a{};
  a.sin_family = AF_INET;
  a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  a.sin_port = htons(static_cast<uint16_t>(port));
  const int s = socket(AF_INET, SOCK_STREAM, 0);
  const timeval patience{20, 0};
  setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  REQUIRE(connect(s, reinterpret_cast<sockaddr*>(&a), sizeof a) == 0);
  return s;
}

struct Answer {
  int status = 0;
  std::string head, body;
  // Of a header, as text.
  std::string header(const std::string& name) const {
    const size_t at = head.find("\r\n" + name + ": ");
    if (at == std::string::npos) return {};
    const size_t begin = at + name.size() + 4;
    return head.substr(begin, head.find("\r\n", begin) - begin);
  }
  int number(const std::string& name) const { return std::stoi(header("X-Braid-" + name)); }
  Json json() const { return Json::parse(body); }
};

Answer ask(int port, const std::string& method, const std::string& target, const std::string& headers = "",
           const std::string& host = "127.0.0.1") {
  const int s = connectTo(port);
  const std::string request =
      method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n" + headers + "\r\n";
  REQUIRE(send(s, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size()));
  std::string text;
  char buffer[65536];
  for (ssize_t n; (n = recv(s, buffer, sizeof buffer, 0)) > 0;) text.append(buffer, static_cast<size_t>(n));
  close(s);
  Answer a;
  const size_t end = text.find("\r\n\r\n");
  REQUIRE(end != std::string::npos);
  a.head = text.substr(0, end + 2);
  a.body = text.substr(end + 4);
  a.status = std::stoi(a.head.substr(9, 3));
  return a;
}

Json stateOf(const Preview& p) { return ask(p.port(), "GET", "/state.json").json(); }

// Local addresses, in hexadecimal as the system lists them, that listen at the port.
std::vector<std::string> listeners(int port) {
  std::vector<std::string> found;
  char wanted[8];
  std::snprintf(wanted, sizeof wanted, "%04X", static_cast<unsigned>(port));
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::istringstream lines(readText(table));
    std::string line, index, local, remote, state;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
      std::istringstream(line) >> index >> local >> remote >> state;
      const size_t colon = local.find(':');
      if (state == "0A" && local.substr(colon + 1) == wanted) found.push_back(local.substr(0, colon));
    }
  }
  return found;
}

// What a preview of 48x32 pixels tells while it renders to the file.
void checkState(const Json& s, const std::string& file) {
  CHECK(s["schema"] == 1);
  CHECK(s["phase"] == "rendering");
  CHECK(s["stopped"] == false);
  CHECK(s["scene"] == "cornell.glb");
  CHECK(s["width"] == 48);
  CHECK(s["height"] == 32);
  CHECK(s["sppPlanned"] == 0);
  CHECK(s["secondsLeft"].is_null());
  CHECK(s["reason"].is_null());
  CHECK(s["seconds"].get<double>() > 0);
  CHECK(s["rate"]["spp"].get<double>() > 0);
  CHECK(s["rate"]["paths"].get<double>() == doctest::Approx(48 * 32 * s["rate"]["spp"].get<double>()));
  CHECK(s["combiner"] == "auto");
  CHECK(contains(s["plan"].get<std::string>(), "+ pt"));
  CHECK(s["outputs"] == Json::array({file}));
  CHECK(s["saved"] == Json::array());
  CHECK(s["warnings"] == Json::array());
  for (const char* view : {"noisy", "combined"}) {
    const Json& points = s["history"][view];
    REQUIRE(!points.empty());
    CHECK(points.back().size() == 3);
    CHECK(points.back()[2] == s["estimatedError"][view]);
    CHECK(s["estimatedError"][view].get<double>() > 0);
  }
}

void checkImages(const Preview& preview) {
  for (const auto& [view, channels] :
       {std::pair("noisy", 3), {"combined", 3}, {"error", 1}, {"noisy-error", 1}, {"combined-error", 1}}) {
    INFO(view);
    const Answer image = ask(preview.port(), "GET", std::string("/image?view=") + view);
    REQUIRE(image.status == 200);
    CHECK(image.number("Width") == 48);
    CHECK(image.number("Height") == 32);
    CHECK(image.number("Channels") == channels);
    CHECK(image.number("Spp") >= 1);
    REQUIRE(image.body.size() == static_cast<size_t>(48 * 32 * channels * 2));
    float largest = 0;
    for (size_t i = 0; i < image.body.size() / 2; ++i) largest = std::max(largest, halfAt(image.body, i));
    CHECK(largest > 0);
    CHECK(std::isfinite(largest));
  }
}

void checkRequests(const Preview& preview, const Json& s) {
  // An answer to ?after comes when there is something newer.
  const Answer newer = ask(preview.port(), "GET", "/state.json?after=" + stateOf(preview)["version"].dump());
  CHECK(newer.json()["version"] > s["version"]);
  CHECK(ask(preview.port(), "GET", "/state.json?after=x").status == 400);
  CHECK(ask(preview.port(), "GET", "/image?view=none").status == 400);
  CHECK(ask(preview.port(), "GET", "/image").status == 400);
  CHECK(ask(preview.port(), "GET", "/nothing").status == 404);

  // Neither a site that resolves to this machine nor another page reads or stops anything.
  CHECK(ask(preview.port(), "GET", "/state.json", "", "elsewhere.example").status == 403);
  CHECK(ask(preview.port(), "GET", "/state.json", "", "localhost:1234").status == 200);
  CHECK(ask(preview.port(), "POST", "/stop", "Origin: http://elsewhere.example\r\n").status == 403);
  CHECK(ask(preview.port(), "GET", "/stop").status == 405);
}

}  // namespace

TEST_CASE("A running preview answers with page, state and images, and a stop saves") {
  const Folder folder;
  const std::string file = folder.path / "out.exr";
  Preview preview(folder, {"-o", file});
  const Answer page = ask(preview.port(), "GET", "/");
  CHECK(page.status == 200);
  CHECK(contains(page.header("Content-Type"), "text/html"));
  CHECK((page.body == readText(BRAID_SOURCE_DIR "/tools/preview/page.html")));
  CHECK_FALSE(contains(page.body, "http://"));  // nothing from elsewhere
  CHECK_FALSE(contains(page.body, "https://"));

  Json s;
  CHECK(waitUntil([&] {
    s = stateOf(preview);
    return s["estimatedError"]["combined"].is_number() && s["estimatedError"]["noisy"].is_number() && s["spp"] >= 4;
  }));
  checkState(s, file);
  checkImages(preview);
  checkRequests(preview, s);
  CHECK(stateOf(preview)["phase"] == "rendering");
  CHECK_FALSE(fs::exists(file));

  CHECK(ask(preview.port(), "POST", "/stop", "Origin: http://127.0.0.1\r\n").status == 200);
  CHECK(waitUntil([&] { return (s = stateOf(preview))["phase"] == "ended"; }));  // shown to whoever watches
  CHECK(s["reason"] == "the page");
  CHECK(s["saved"] == Json::array({file}));
  CHECK(s["images"]["combined"]["spp"] == s["spp"]);
  CHECK(preview.wait() == 0);
  const ImageFile saved = readImage(file);
  CHECK(saved.width == 48);
  CHECK(hasLayer(saved, "combined.auto"));
}

TEST_CASE("A preview listens on 127.0.0.1 only, and a taken port is one line and exit code 3") {
  const Folder folder;
  Preview preview(folder, {"--combine", "none"});
  CHECK(listeners(preview.port()) == std::vector<std::string>{"0100007F"});
  // Also when whoever has the port is a preview, whose sockets could be shared.
  const Run run = braidRun(folder, "preview '" + kCornellFile + "' --http " + std::to_string(preview.port()));
  CHECK(run.code == 3);
  CHECK(contains(run.err, "the port is taken"));
  CHECK(run.err.find('\n') == run.err.size() - 1);
  CHECK(run.out.empty());
  CHECK(braidRun(folder, "preview '" + kCornellFile + "' --http 70000").code == 1);
}

TEST_CASE("A preview ends by its limits and by signals, and saves then") {
  const Folder folder;
  const std::string common = "preview '" + kCornellFile + "' --http 0 --size 24x16 ";
  Run run = braidRun(folder, common + "--spp 4 -o o.exr --png o.png");
  CHECK(run.code == 0);
  CHECK(contains(run.err, "4 spp in "));
  CHECK(contains(run.err, "stopped by samples"));
  const ImageFile saved = readImage(folder.path / "o.exr");
  CHECK(hasLayer(saved, "Error"));
  CHECK(hasLayer(saved, "Albedo"));
  CHECK_FALSE(hasLayer(saved, "pt.mean"));
  CHECK(fs::exists(folder.path / "o.png"));
  CHECK(braidRun(folder, common + "--time 0.2 -q").code == 0);
  Preview preview(folder, {"-o", folder.path / "signal.exr"});
  CHECK(waitUntil([&] { return stateOf(preview)["spp"] >= 2; }));
  preview.signal(SIGINT);
  CHECK(preview.wait() == 130);
  CHECK(readImage(folder.path / "signal.exr").width == 48);

  run = braidRun(folder, "preview missing.glb --http 0");
  CHECK(run.code == 2);
  CHECK(braidRun(folder, common + "-o nowhere/o.exr").code == 3);
  run = braidRun(folder, common + "--combine js --integrator crn --spp 2");
  CHECK(run.code == 1);
  CHECK(contains(run.err, "js cannot run"));
  CHECK(contains(braidRun(folder, "preview --help").out, "braid preview scene.glb --tev"));
}

}  // namespace braid::test_preview
