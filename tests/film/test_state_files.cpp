// SPDX-License-Identifier: Apache-2.0
// Files of states give back every word and number; no broken file is taken for a state.
#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/state_file.h"
#include "tests/film/state_renders.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"

namespace braid::test_state_files {

namespace fs = std::filesystem;
using namespace test::state_renders;
using test::contains;
using test::Folder;
using test::readText;

namespace {

std::string refusal(const std::string& path) {
  try {
    readStateFile(path);
  } catch (const Error& e) {
    CHECK(e.code() == ExitCode::BadInput);
    CHECK(std::string(e.what()).rfind(path + ":", 0) == 0);
    CHECK(!contains(e.what(), "\n"));
    return e.what();
  }
  return "";
}

// Pixels of the images whose files are tampered with.
constexpr size_t kTinyPixels = 4 * 2;

// The bytes of a state with another header: sizes and checksum are made to fit again.
std::string withHeader(const std::string& bytes, const std::string& from, const std::string& to) {
  unsigned long long headerBytes = 0, planeBytes = 0;
  std::sscanf(bytes.c_str(), "braid-state 3 %llu %llu", &headerBytes, &planeBytes);
  const size_t begin = bytes.find('\n') + 1;
  std::string header = bytes.substr(begin, headerBytes);
  const size_t at = header.find(from);
  REQUIRE_MESSAGE(at != std::string::npos, from);
  header.replace(at, from.size(), to);
  const std::string first = "braid-state 3 " + std::to_string(header.size()) + ' ' + std::to_string(planeBytes) + '\n';
  const std::string planes = bytes.substr(begin + headerBytes, planeBytes);
  ContentHash hash;  // by the steps of the writer: one for each plane
  hash.add(first);
  hash.add(header);
  const std::string table = bytes.substr(begin, headerBytes);
  size_t offset = 0;
  for (size_t line = table.find("\nplane "); line != std::string::npos; line = table.find("\nplane ", line + 1)) {
    const size_t value = table.compare(table.find('\n', line + 1) - 2, 2, "64") == 0 ? 8 : 4;
    hash.add(planes.data() + offset, kTinyPixels * value);
    offset += kTinyPixels * value;
  }
  REQUIRE(offset == planes.size());
  return first + header + planes + hexString(hash.value()) + '\n';
}

}  // namespace

TEST_CASE("A file gives back every word and number") {
  const Folder folder;
  FilmState state = stateOf(everythingKept("sppm", 3));
  state.identity.version = "0.1.0";
  state.identity.build = "a compiler, with spaces";
  state.identity.isa = "";
  state.identity.options.push_back({"--env", "a file %20 with\nall sorts \x7f of \xc3\xa9"});
  state.seconds = 0.1 + 0.2;
  state.estimates[0].seconds = 1e-300;
  state.attributes = {{"text", Attribute::Kind::String, "two\nlines", 0, 0, {}},
                      {"negative", Attribute::Kind::Int, "", -5, 0, {}},
                      {"third", Attribute::Kind::Float, "", 0, 1.0 / 3, {}},
                      {"matrix", Attribute::Kind::Matrix, "", 0, 0, std::vector<float>(16, 0.1f)},
                      {"white", Attribute::Kind::Chromaticities, "", 0, 0, std::vector<float>(8, -1e-30f)}};
  const std::string file = folder.path / "s.state";
  writeStateFile(file, state);
  const FilmState read = readStateFile(file);
  checkSame(state, read);
  CHECK(read.identity.version == state.identity.version);
  CHECK(read.identity.build == state.identity.build);
  CHECK(read.identity.isa.empty());
  CHECK(read.identity.options == state.identity.options);
  CHECK(read.identity.sceneHash == state.identity.sceneHash);
  CHECK(read.seconds == state.seconds);
  CHECK(read.estimates[0].seconds == 1e-300);
  CHECK(read.estimates[0].unbiased == state.estimates[0].unbiased);
  REQUIRE(read.attributes.size() == 5);
  CHECK(read.attributes[0].text == "two\nlines");
  CHECK(read.attributes[1].integer == -5);
  CHECK(read.attributes[2].number == 1.0 / 3);
  CHECK(read.attributes[3].values == state.attributes[3].values);
  CHECK(read.attributes[4].values == state.attributes[4].values);
  CHECK(readStateHeader(file).estimates[0].passes == state.estimates[0].passes);
}

TEST_CASE("Cut, damaged and foreign files are refused, never believed") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  Settings small = everythingKept("sppm", 2);
  small.width = 4;
  small.height = 2;
  writeStateFile(file, stateOf(small));
  const std::string good = readText(file);
  CHECK(refusal(file).empty());
  const std::string broken = folder.path / "broken.state";
  const auto refusalOf = [&](const std::string& bytes) {
    folder.write("broken.state", bytes);
    return refusal(broken);
  };
  for (size_t size = 0; size < good.size(); size += size < 3000 ? 37 : 211) {
    INFO(size);
    CHECK(!refusalOf(good.substr(0, size)).empty());
  }
  for (size_t at = 0; at < good.size(); at += at < 3000 ? 5 : 97) {
    INFO(at);
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << at % 8));
    CHECK(!refusalOf(bytes).empty());
  }
  CHECK(contains(refusalOf(good + "x"), "cut short or damaged"));
  CHECK(contains(refusalOf(good.substr(0, good.size() - 1)), "cut short or damaged"));
  std::string planes = good;
  planes[good.size() - 400] = static_cast<char>(planes[good.size() - 400] ^ 1);
  CHECK(contains(refusalOf(planes), "is damaged: its checksum"));
  CHECK(contains(refusalOf(""), "is no state of braid"));
  CHECK(contains(refusalOf(std::string(100000, '\0')), "is no state of braid"));
  CHECK(contains(refusalOf("\x89PNG\r\n\x1a\n"), "is no state of braid"));
  CHECK(contains(refusalOf("braid-state 1 10 10\n"), "has state format 1"));
  CHECK(contains(refusalOf("braid-state 3 18446744073709551615 18446744073709551615\n"), "damaged"));
  CHECK(contains(refusalOf("braid-state 3 -1 5\n"), "damaged"));
  CHECK(contains(refusal(folder.path / "none.state"), "does not exist"));
  CHECK(contains(refusal(folder.path), "is not a file"));
  CHECK(contains(refusal("/dev/zero"), "is not a file"));
}

TEST_CASE("Headers that lie are refused before anything is allocated for them") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  Settings small = everythingKept("sppm", 2);
  small.width = 4;
  small.height = 2;
  writeStateFile(file, stateOf(small));
  const std::string good = readText(file);
  const auto refusalWith = [&](const std::string& from, const std::string& to) {
    folder.write("lie.state", withHeader(good, from, to));
    return refusal(folder.path / "lie.state");
  };
  CHECK(contains(refusalWith("\nplane ", "\nplacement\nplane "), "placement of samples after an estimate"));
  CHECK(refusalWith("sppm", "sppm").empty());  // the helper itself makes valid files
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 65536 4096 0 0 65536 4096"), "size of the image"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 65536 65536 0 0 65536 65536"), "268 million"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 4 2 0 0 4 3"), "header line 5"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 4 2 3 0 3 2"), "not a number from 4 to 4"));
  CHECK(contains(refusalWith("buckets 4", "buckets 3"), "three buckets"));
  CHECK(contains(refusalWith("buckets 4", "buckets 2"), "not one per bucket"));
  CHECK(contains(refusalWith("buckets 4", "buckets 99999999999999999999"), "not a number"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:3"), "passes and counts disagree"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:1 1:2"), "not in order"));
  CHECK(contains(refusalWith("passes 0:2", "passes 2:0"), "are none"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:999999999999999999"), "not a number of at most"));
  CHECK(contains(refusalWith("passes 0:2", "passes"), "passes and counts disagree"));
  CHECK(contains(refusalWith("counts 1 1 0 0", "counts 1 1 0"), "not one per bucket"));
  CHECK(contains(refusalWith("plane coverage float64", "plane coverage float32"), "not expected"));
  CHECK(contains(refusalWith("plane coverage float64\n", ""), "planes are missing"));
  CHECK(contains(refusalWith("plane sppm.sum0.R float64", "plane sppm.sum9.R float64"), "not expected"));
  CHECK(contains(refusalWith("seconds ", "seconds nan "), "negative or not finite"));
  CHECK(contains(refusalWith("seed 0", "seed 0 0"), "more than expected"));
  CHECK(contains(refusalWith("seed 0", "sead 0"), "unknown word"));
  CHECK(contains(refusalWith("seed 0", "seed"), "ends too early"));
  CHECK(contains(refusalWith("seed 0", "passes 0:1"), "before any estimate"));
  CHECK(contains(refusalWith("option --size", "option --s%ze"), "broken escape"));
}

TEST_CASE("A failed write leaves the earlier file and no other") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  const FilmState state = stateOf(everythingKept("pt", 1));
  writeStateFile(file, state);
  {
    // Begun, never finished.
    const auto unfinished = beginStateFile(file, stateOf(everythingKept("pt", 2)));
    CHECK(readStateFile(file).rounds() == 1);
  }
  CHECK(readStateFile(file).rounds() == 1);
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 1);
  CHECK_THROWS_WITH_AS(writeStateFile(folder.path / "no" / "s.state", state), doctest::Contains("create the folder"),
                       Error);
  CHECK_THROWS_AS(writeStateFile(folder.path, state), Error);
}

}  // namespace braid::test_state_files
