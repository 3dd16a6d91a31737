// SPDX-License-Identifier: Apache-2.0
// Files of networks of one layer, as combiners/learned/network_file.h describes them.
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace braid::test {

// A 16-bit float; values that are none exactly are cut.
inline uint16_t halfOf(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  const auto exponent = static_cast<int>((bits >> 23) & 255) - 127 + 15;
  const uint32_t sign = (bits >> 16) & 0x8000u;
  if (exponent <= 0) return static_cast<uint16_t>(sign);
  return static_cast<uint16_t>(sign | static_cast<uint32_t>(exponent) << 10 | ((bits >> 13) & 0x3FFu));
}

// One convolution of 1x1 pixels: its weight from each input to each output, and its biases.
inline void writePixelNetwork(const std::string& path, int inputs, const std::vector<float>& bias,
                              const std::function<float(int output, int input)>& weight) {
  const std::string text = R"({"inputs":)" + std::to_string(inputs) +
                           R"(,"layers":[{"name":"a","kind":"convolution","inputs":["input"],"outputs":)" +
                           std::to_string(bias.size()) + R"(,"kernel":1,"relu":false}],"constants":{},"training":{}})";
  std::vector<uint16_t> values;
  for (size_t o = 0; o < bias.size(); ++o)
    for (int i = 0; i < inputs; ++i) values.push_back(halfOf(weight(static_cast<int>(o), i)));
  for (const float b : bias) values.push_back(halfOf(b));
  const uint32_t numbers[2] = {1, static_cast<uint32_t>(text.size())};
  std::ofstream file(path, std::ios::binary);
  file.write("BRAIDNET", 8);
  file.write(reinterpret_cast<const char*>(numbers), sizeof numbers);
  file << text;
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(2 * values.size()));
}

}  // namespace braid::test
