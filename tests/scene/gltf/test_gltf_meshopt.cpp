// SPDX-License-Identifier: Apache-2.0
// Version 1 of meshopt's codec of attributes and the filter COLOR, by streams written here after appendices A and B of
// KHR_meshopt_compression.
#include <algorithm>
#include <cstring>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/scene/gltf/document/meshopt_vertices.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_gltf_meshopt {

using namespace braid::test;
using gltf::decodeMeshoptVertices;
using Bytes = std::vector<uint8_t>;

namespace {

uint32_t wordOf(const Bytes& data, size_t at) {
  uint32_t word;
  std::memcpy(&word, &data[at], 4);
  return word;
}

uint32_t zigzag(uint32_t difference, int width) {
  const uint32_t mask = width == 16 ? 0xffff : 0xff, sign = width == 16 ? 0x8000 : 0x80;
  difference &= mask;
  return ((difference & sign) != 0 ? ~(difference << 1) : difference << 1) & mask;
}

// The delta of a channel from one element to the next.
uint32_t deltaOf(uint32_t before, uint32_t after, uint8_t mode) {
  if ((mode & 15) == 2) {
    const uint32_t x = before ^ after;
    const int r = mode >> 4;
    return r == 0 ? x : x << r | x >> (32 - r);
  }
  const int width = (mode & 15) == 1 ? 16 : 8;
  uint32_t delta = 0;
  for (int shift = 0; shift < 32; shift += width) delta |= zigzag((after >> shift) - (before >> shift), width) << shift;
  return delta;
}

// `size` deltas from 16 on with `bits` each.
void putGroup(Bytes& out, const uint8_t* deltas, int bits) {
  if (bits == 0) return;
  if (bits == 8) {
    out.insert(out.end(), deltas, deltas + 16);
    return;
  }
  const size_t start = out.size(), perByte = 8 / static_cast<size_t>(bits);
  const int sentinel = (1 << bits) - 1;
  out.resize(start + 16 / perByte);
  for (size_t i = 0; i < 16; ++i) {
    const size_t place = i % perByte;
    const size_t shift = bits == 1 ? place : (perByte - 1 - place) * static_cast<size_t>(bits);
    const int value = std::min<int>(deltas[i], sentinel);
    out[start + i / perByte] = static_cast<uint8_t>(out[start + i / perByte] | value << shift);
    if (value == sentinel) out.push_back(deltas[i]);
  }
}

// Control modes go round with the bytes, and bit lengths with the groups, as far as the deltas allow.
Bytes encoded(const Bytes& data, size_t stride, const Bytes& modes, size_t turn = 0) {
  const size_t count = data.size() / stride, channels = stride / 4;
  const size_t most = std::min<size_t>((8192 / stride) & ~size_t{15}, 256);
  Bytes out{0xa1}, baseline(stride, 77);
  Bytes before = baseline;
  for (size_t first = 0; first < count; first += most) {
    const size_t elements = std::min(most, count - first), groups = (elements + 15) / 16, control = out.size();
    out.resize(control + channels);
    for (size_t c = 0; c < channels; ++c) {
      std::vector<Bytes> deltas(4, Bytes(256, 0));
      uint32_t value = wordOf(before, 4 * c);
      for (size_t e = 0; e < elements; ++e) {
        const uint32_t after = wordOf(data, (first + e) * stride + 4 * c);
        const uint32_t delta = deltaOf(value, after, modes[c]);
        for (size_t k = 0; k < 4; ++k) deltas[k][e] = static_cast<uint8_t>(delta >> (8 * k));
        value = after;
      }
      std::memcpy(&before[4 * c], &value, 4);
      for (size_t k = 0; k < 4; ++k) {
        const bool zero = std::all_of(deltas[k].begin(), deltas[k].end(), [](uint8_t d) { return d == 0; });
        size_t way = (4 * c + k + turn) % 4;
        if (way == 2 && !zero) way = 3;
        out[control + c] = static_cast<uint8_t>(out[control + c] | way << (2 * k));
        if (way == 2) continue;
        if (way == 3) {
          out.insert(out.end(), deltas[k].begin(), deltas[k].begin() + static_cast<ptrdiff_t>(elements));
          continue;
        }
        const size_t header = out.size();
        out.resize(header + (groups + 3) / 4);
        for (size_t g = 0; g < groups; ++g) {
          const uint8_t* group = &deltas[k][16 * g];
          size_t length = (g + turn) % 4;
          const bool empty = std::all_of(group, group + 16, [](uint8_t d) { return d == 0; });
          if (way == 0 && length == 0 && !empty) length = 1;
          out[header + g / 4] = static_cast<uint8_t>(out[header + g / 4] | length << (2 * (g % 4)));
          constexpr int kBits[2][4] = {{0, 1, 2, 4}, {1, 2, 4, 8}};
          putGroup(out, group, kBits[way][length]);
        }
      }
    }
  }
  if (stride + channels < 24) out.resize(out.size() + 24 - stride - channels);
  out.insert(out.end(), baseline.begin(), baseline.end());
  out.insert(out.end(), modes.begin(), modes.end());
  return out;
}

Bytes decoded(const Bytes& stream, size_t count, size_t stride) {
  Bytes out(count * stride);
  return decodeMeshoptVertices(stream, count, stride, out.data()) ? out : Bytes();
}

// An accessor whose elements are packed.
int packedAccessor(GltfFile& file, const Bytes& stream, size_t count, size_t stride, Json accessor,
                   const char* filter = "NONE") {
  const Json place = file.root["bufferViews"][static_cast<size_t>(file.view(stream))];
  accessor["count"] = count;
  accessor["bufferView"] = file.append("bufferViews", {{"buffer", 1},
                                                       {"byteLength", count * stride},
                                                       {"extensions",
                                                        {{"KHR_meshopt_compression",
                                                          {{"buffer", 0},
                                                           {"byteOffset", place["byteOffset"]},
                                                           {"byteLength", stream.size()},
                                                           {"byteStride", stride},
                                                           {"count", count},
                                                           {"filter", filter},
                                                           {"mode", "ATTRIBUTES"}}}}}});
  file.root["buffers"] = {
      {{"byteLength", file.binary.size()}},
      {{"byteLength", count * stride}, {"extensions", {{"KHR_meshopt_compression", {{"fallback", true}}}}}}};
  file.root["extensionsUsed"] = file.root["extensionsRequired"] = {"KHR_meshopt_compression"};
  return file.append("accessors", accessor);
}

}  // namespace

TEST_CASE("meshopt: the example of the specification") {
  // Four bits a delta, two of them escaped; the other bytes of an element do not change.
  Bytes stream{0xa1, 0xA8, 0x03, 0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5};
  stream.resize(stream.size() + 24);
  const int deltas[16] = {-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0};
  const Bytes data = decoded(stream, 16, 4);
  REQUIRE(data.size() == 64);
  int value = 0;
  for (size_t i = 0; i < 16; ++i) {
    value += deltas[i];
    CHECK(data[4 * i] == static_cast<uint8_t>(value));
    CHECK(data[4 * i + 1] == 0);
  }
}

TEST_CASE("meshopt: streams of every control, length and channel mode come back as they were") {
  Rng rng(5);
  for (const size_t stride : {4u, 8u, 12u, 64u, 256u})
    for (const size_t count : {1u, 15u, 16u, 17u, 300u})
      for (size_t turn = 0; turn < 4; ++turn) {
        Bytes data(stride * count);
        for (size_t i = 0; i < data.size(); ++i)
          data[i] = static_cast<uint8_t>((i % 3 == 0 ? 200 : i / stride) + (rng.next() < 0.2f ? 255 : 0));
        Bytes modes;
        for (size_t c = 0; c < stride / 4; ++c)
          modes.push_back(static_cast<uint8_t>((c + turn) % 3 == 2 ? 2 | (c % 16) << 4 : (c + turn) % 3));
        CAPTURE(stride);
        CAPTURE(count);
        const Bytes stream = encoded(data, stride, modes, turn);
        CHECK(decoded(stream, count, stride) == data);
        // Cut or too long, it is refused.
        Bytes wrong = stream;
        wrong.insert(wrong.begin() + 1, 0);
        CHECK(decoded(wrong, count, stride) != data);
        for (const size_t size : {size_t{0}, size_t{1}, size_t{24}, stream.size() / 2, stream.size() - 1})
          CHECK(decoded(Bytes(stream.begin(), stream.begin() + static_cast<ptrdiff_t>(size)), count, stride) != data);
      }
  Bytes bad = encoded(Bytes(64, 3), 4, {3});
  CHECK(decoded(bad, 16, 4).empty());
  bad.back() = 0x10;
  CHECK(decoded(bad, 16, 4).empty());
}

TEST_CASE("meshopt: broken bytes never read beyond the stream") {
  Rng rng(6);
  const Bytes stream = encoded(Bytes(12 * 40, 9), 12, {0, 1, 2});
  for (int i = 0; i < 20000; ++i) {
    Bytes broken = stream;
    for (int k = 0; k < 4; ++k)
      broken[static_cast<size_t>(rng.next() * static_cast<float>(broken.size() - 1))] =
          static_cast<uint8_t>(256 * rng.next());
    broken[0] = 0xa1;
    decoded(broken, 40, 12);
  }
}

TEST_CASE("meshopt: colours of luma and chroma, of 8 and of fewer bits") {
  // RGBA (200, 100, 50, 255): co = (r - b) / 2 and so on, by the inverse of the filter.
  const auto colour = [](int r, int g, int b, int a, int bits) {
    const int y = (r + 2 * g + b) / 4, co = (r - b) / 2, cg = g - y;
    return Bytes{static_cast<uint8_t>(y), static_cast<uint8_t>(co), static_cast<uint8_t>(cg),
                 static_cast<uint8_t>(1 << (bits - 1) | a >> 1)};
  };
  Bytes eight = colour(200, 100, 52, 255, 8);
  gltf::decodeMeshoptColours(eight.data(), 1, 4);
  const int expected[4] = {200, 100, 52, 255};
  for (size_t k = 0; k < 4; ++k) CHECK(std::abs(eight[k] - expected[k]) <= 1);
  // Of 5 bits, 31 is white.
  Bytes five = colour(31, 31, 31, 31, 5);
  gltf::decodeMeshoptColours(five.data(), 1, 4);
  CHECK(five == Bytes{255, 255, 255, 255});
  // 16 bits: luma, and alpha 65535.
  const uint16_t grey[4] = {30000, 0, 0, 0xffff};
  Bytes wide(8);
  std::memcpy(wide.data(), grey, 8);
  gltf::decodeMeshoptColours(wide.data(), 1, 8);
  uint16_t out[4];
  std::memcpy(out, wide.data(), 8);
  CHECK(out[0] == 30000);
  CHECK(out[2] == 30000);
  CHECK(out[3] == 65535);
  Bytes nothing(8, 0);
  gltf::decodeMeshoptColours(nothing.data(), 2, 4);
  CHECK(nothing == Bytes(8, 0));
}

TEST_CASE("gltf: meshopt of version 1 gives the mesh that plain data gives") {
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  Bytes data(48);
  std::memcpy(data.data(), positions.data(), 48);
  GltfFile file = quadFile();
  const TriangleMesh plain = onlyMesh(file.load());
  file.primitive()["attributes"]["POSITION"] =
      packedAccessor(file, encoded(data, 12, {0, 1, 0x52}), 4, 12, {{"componentType", 5126}, {"type", "VEC3"}});
  const TriangleMesh packed = onlyMesh(file.load());
  CHECK(packed.positions == plain.positions);
}

TEST_CASE("gltf: colours under meshopt's filter COLOR are those of plain data") {
  GltfFile plain = quadFile();
  Bytes luma;
  std::vector<uint8_t> grey;
  for (const uint8_t y : std::initializer_list<uint8_t>{255, 128, 3, 0}) {
    luma.insert(luma.end(), {y, 0, 0, 255});
    grey.insert(grey.end(), {y, y, y, 255});
  }
  const Json bytes = {{"componentType", 5121}, {"normalized", true}, {"type", "VEC4"}};
  GltfFile file = plain;
  const int colours = plain.accessor<uint8_t>(grey, "VEC4");
  plain.root["accessors"][static_cast<size_t>(colours)]["normalized"] = true;
  plain.primitive()["attributes"]["COLOR_0"] = colours;
  file.primitive()["attributes"]["COLOR_0"] = packedAccessor(file, encoded(luma, 4, {0}), 4, 4, bytes, "COLOR");
  const SceneData scene = file.load();
  REQUIRE(onlyMesh(scene).colors.size() == 4);
  CHECK(onlyMesh(scene).colors == onlyMesh(plain.load()).colors);
  CHECK(scene.extensionsIgnored.empty());
  // Without the filter luma is red.
  file.root["bufferViews"].back()["extensions"]["KHR_meshopt_compression"]["filter"] = "NONE";
  CHECK(onlyMesh(file.load()).colors != onlyMesh(scene).colors);
}

}  // namespace braid::test_gltf_meshopt
