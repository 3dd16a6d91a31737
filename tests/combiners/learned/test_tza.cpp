// SPDX-License-Identifier: Apache-2.0
// Files of weights are read as they are written, and refused in one line wherever they are wrong.
#include <doctest/doctest.h>

#include <filesystem>
#include <limits>

#include "combiners/learned/tza.h"
#include "renderer/core/error.h"
#include "tests/support/gltf_fixture.h"
#include "tests/combiners/learned/plain_network.h"

namespace braid::test_tza {

using namespace test;

namespace {

WeightTensors small() { return {{"a.weight", randomWeights(2, 3, 3, 1)}, {"b.bias", {{3}, {1, -2, 0.5f}}}}; }

std::string errorOf(const std::vector<uint8_t>& file) {
  try {
    parseTza(file, "f.tza");
  } catch (const Error& e) {
    CHECK(e.code() == ExitCode::BadInput);
    const std::string text = e.what();
    CHECK(text.starts_with("f.tza: "));
    CHECK(text.find('\n') == std::string::npos);
    return text;
  }
  return "read";
}

// The file with bytes from `at` on replaced; behind the end counts from the table.
template <class T>
std::vector<uint8_t> with(std::vector<uint8_t> file, size_t at, T value) {
  std::memcpy(file.data() + at, &value, sizeof value);
  return file;
}

bool mentions(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("Weights are read as they were written, floats of both sizes") {
  const Folder folder;
  const std::string path = (folder.path / "w.tza").string();
  writeTza(path, small());
  const WeightTensors read = readTza(path);
  REQUIRE(read.size() == 2);
  CHECK(read.at("a.weight").sizes == std::vector<int>{2, 3, 3, 3});
  CHECK(read.at("a.weight").values == small().at("a.weight").values);
  CHECK(read.at("b.bias").values == std::vector<float>{1, -2, 0.5f});

  // Halves: 1 and -2 as 0x3C00 and 0xC000.
  std::vector<uint8_t> file = tzaOf({{"h", {{1}, {0}}}});
  file = with<uint16_t>(file, 12, 0xC000);
  file[12 + 4 + 4 + 2 + 1 + 1 + 4 + 1] = 'h';
  CHECK(parseTza(file, "f.tza").at("h").values == std::vector<float>{-2});
}

TEST_CASE("A file of weights that is wrong is refused with its name, the place and what to do") {
  const std::vector<uint8_t> file = tzaOf(small());
  CHECK(errorOf(file) == "read");
  uint64_t begin = 0;
  std::memcpy(&begin, file.data() + 4, sizeof begin);
  const size_t name = begin + 4, sizes = name + 2 + 8, layout = sizes + 1 + 16, type = layout + 4, offset = type + 1;
  CHECK(mentions(errorOf({}), "cut off at byte 0"));
  CHECK(mentions(errorOf(with<uint16_t>(file, 0, 7)), "no TZA file"));
  CHECK(mentions(errorOf(with<uint8_t>(file, 2, 3)), "version 3.0"));
  CHECK(mentions(errorOf(with<uint64_t>(file, 4, ~uint64_t(0))), "its table begins at byte"));
  CHECK(mentions(errorOf(with<uint64_t>(file, 4, file.size())), "cut off"));
  CHECK(mentions(errorOf(with<uint32_t>(file, begin, 3)), "cut off"));
  CHECK(mentions(errorOf(with<uint32_t>(file, begin, ~0u)), "tensors, 4096 at most"));
  CHECK(mentions(errorOf(with<uint16_t>(file, name, 0xFFFF)), "cut off"));
  CHECK(mentions(errorOf(with<uint8_t>(file, sizes, 0)), "a.weight: 0 dimensions"));
  CHECK(mentions(errorOf(with<uint8_t>(file, sizes, 5)), "a.weight: 5 dimensions"));
  CHECK(mentions(errorOf(with<uint32_t>(file, sizes + 1, 0)), "a.weight: a dimension of 0"));
  CHECK(mentions(errorOf(with<uint32_t>(file, sizes + 1, ~0u)), "a.weight: a dimension of 4294967295"));
  CHECK(mentions(errorOf(with<uint32_t>(file, sizes + 1, 65536)), "more values than the file has bytes"));
  CHECK(mentions(errorOf(with<uint8_t>(file, layout, 'q')), "a.weight: its dimensions are 'qihw'"));
  CHECK(mentions(errorOf(with<uint8_t>(file, type, 'd')), "a.weight: values of type 'd'"));
  CHECK(mentions(errorOf(with<uint64_t>(file, offset, file.size() - 8)), "are not all in the file"));
  CHECK(mentions(errorOf(with<uint64_t>(file, offset, ~uint64_t(0))), "are not all in the file"));
  CHECK(mentions(errorOf(with(file, 12, std::numeric_limits<float>::infinity())), "a.weight: a value that is not"));
  std::vector<uint8_t> twice = file;  // b.bias becomes a.weight's name, one byte longer than it has room for
  twice[name + 2] = '\n';
  CHECK(mentions(errorOf(with<uint8_t>(twice, type, 'd')), "?.weight: values"));
  for (size_t length = 0; length < file.size(); ++length)
    CHECK(errorOf({file.begin(), file.begin() + static_cast<std::ptrdiff_t>(length)}) != "read");
  CHECK_THROWS_WITH_AS(readTza("no/such.tza"), doctest::Contains("no/such.tza: "), Error);
}

TEST_CASE("Tensors that share their values take no more memory than the file") {
  WeightTensors many;
  for (int k = 0; k < 64; ++k) many["t" + std::to_string(100 + k)] = {{1}, {1}};
  many["z"] = {{4096}, std::vector<float>(4096, 1.0f)};
  std::vector<uint8_t> file = tzaOf(many);
  CHECK(parseTza(file, "f.tza").size() == 65);
  uint64_t at = 0;
  std::memcpy(&at, file.data() + 4, sizeof at);
  at += 4;
  for (int k = 0; k < 64; ++k, at += 2 + 4 + 1 + 4 + 1 + 1 + 8) {
    file = with<uint32_t>(file, at + 7, 4096);
    file = with<uint64_t>(file, at + 13, 268);
  }
  CHECK(mentions(errorOf(file), "more values than the file has bytes"));
}

}  // namespace braid::test_tza
