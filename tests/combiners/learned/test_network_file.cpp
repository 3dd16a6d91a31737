// SPDX-License-Identifier: Apache-2.0
// Files of braid's own networks are read as they are written, and refused in one line wherever they are wrong.
#include <doctest/doctest.h>

#include <cstring>
#include <string>

#include "combiners/learned/network_file.h"
#include "renderer/core/error.h"

namespace braid::test_network_file {

namespace {

const std::string kDescription =
    R"({"inputs":1,"layers":[{"name":"a","kind":"convolution","inputs":["input"],"outputs":2,"kernel":1,"relu":true},)"
    R"({"name":"p","kind":"pool","inputs":["a"]},{"name":"u","kind":"upsample","inputs":["p"]},)"
    R"({"name":"c","kind":"concatenate","inputs":["u","input"]},)"
    R"({"name":"b","kind":"convolution","inputs":["c"],"outputs":1,"kernel":1,"relu":false}],)"
    R"("constants":{"k":[0.5,-2]},"training":{"steps":3}})";
// 2 weights and 2 biases of a, 3 weights and a bias of b.
constexpr size_t kValues = 8;
constexpr uint16_t kOne = 0x3C00, kInfinite = 0x7C00;

std::vector<uint8_t> fileOf(const std::string& description, size_t values = kValues, uint16_t last = kOne) {
  std::vector<uint8_t> file(16 + description.size() + 2 * values);
  std::memcpy(file.data(), "BRAIDNET", 8);
  const uint32_t numbers[2] = {1, static_cast<uint32_t>(description.size())};
  std::memcpy(file.data() + 8, numbers, sizeof numbers);
  std::memcpy(file.data() + 16, description.data(), description.size());
  for (size_t k = 0; k < values; ++k) {
    const uint16_t value = k + 1 == values ? last : kOne;
    std::memcpy(file.data() + 16 + description.size() + 2 * k, &value, sizeof value);
  }
  return file;
}

std::string errorOf(const std::vector<uint8_t>& file) {
  try {
    parseNetworkFile(file, "f.network");
  } catch (const Error& e) {
    CHECK(e.code() == ExitCode::BadInput);
    const std::string text = e.what();
    CHECK(text.starts_with("f.network: "));
    CHECK(text.find('\n') == std::string::npos);
    return text;
  }
  return "read";
}

bool mentions(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

std::string with(const std::string& from, const std::string& to) {
  std::string text = kDescription;
  const size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("A network is read as it was written") {
  const NetworkFile file = parseNetworkFile(fileOf(kDescription), "f.network");
  REQUIRE(file.network.layers.size() == 5);
  CHECK(file.network.inputs == 1);
  CHECK(file.network.layers[0].weights == std::vector<float>{1, 1});
  CHECK(file.network.layers[0].relu);
  CHECK(file.network.layers[4].weights == std::vector<float>{1, 1, 1});
  CHECK(!file.network.layers[4].relu);
  CHECK(file.constants.at("k") == std::vector<float>{0.5f, -2});
  CHECK(file.training == R"({"steps":3})");
}

TEST_CASE("A network that is none is refused with what is wrong") {
  CHECK(mentions(errorOf({}), "BRAIDNET"));
  CHECK(mentions(errorOf({'B', 'R'}), "BRAIDNET"));
  std::vector<uint8_t> file = fileOf(kDescription);
  file[8] = 2;
  CHECK(mentions(errorOf(file), "version 2"));
  CHECK(mentions(errorOf(fileOf("{")), "no JSON"));
  CHECK(mentions(errorOf(fileOf("[]")), "no JSON"));
  CHECK(mentions(errorOf(fileOf(R"({"inputs":1,"layers":[]})", 0)), "0 layers"));
  CHECK(mentions(errorOf(fileOf(with("\"pool\"", "\"sum\""))), "p: its kind"));
  CHECK(mentions(errorOf(fileOf(with("\"outputs\":2", "\"outputs\":0"))), "a: outputs"));
  CHECK(mentions(errorOf(fileOf(with("\"outputs\":2", "\"outputs\":2.5"))), "a: outputs"));
  CHECK(mentions(errorOf(fileOf(with("\"kernel\":1", "\"kernel\":2"))), "a"));
  CHECK(mentions(errorOf(fileOf(with("[\"p\"]", "[\"x\"]"))), "'x'"));
  CHECK(mentions(errorOf(fileOf(with("[\"p\"]", "[7]"))), "no name"));
  CHECK(mentions(errorOf(fileOf(with("0.5", "\"h\""))), "k: a constant"));
  CHECK(mentions(errorOf(fileOf(kDescription, kValues - 1)), "b: its values"));
  CHECK(mentions(errorOf(fileOf(kDescription, kValues + 1)), "2 bytes after"));
  CHECK(mentions(errorOf(fileOf(kDescription, kValues, kInfinite)), "not finite"));
}

TEST_CASE("No cut or changed byte of a network does more than be refused") {
  const std::vector<uint8_t> file = fileOf(kDescription);
  for (size_t bytes = 0; bytes < file.size(); ++bytes)
    CHECK(errorOf({file.begin(), file.begin() + static_cast<ptrdiff_t>(bytes)}) != "read");
  for (size_t at = 0; at < 16 + kDescription.size(); ++at) {
    std::vector<uint8_t> changed = file;
    changed[at] ^= 0x15;
    errorOf(changed);
  }
}

}  // namespace braid::test_network_file
