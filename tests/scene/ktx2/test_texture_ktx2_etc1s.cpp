// SPDX-License-Identifier: Apache-2.0
// BasisLZ and ETC1S: codebooks, slices and colours, against pixels worked out by hand and files written at random.
#include <array>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/scene/data/ktx2/etc1s.h"
#include "renderer/scene/data/ktx2/ktx2.h"
#include "tests/support/textures/basis_lz_writer.h"

namespace braid::test_texture_ktx2_etc1s {

using namespace braid::ktx2;
using namespace braid::test;

namespace {

struct Written {
  std::vector<WrittenEndpoint> endpoints;
  std::vector<WrittenSelector> selectors;
  std::vector<SliceWriter::Block> colour, alpha;  // alpha: none, or as many
  size_t wide, high;
  bool grey = false, plainSelectors = false;
  size_t history = 8;
};

Ktx2Writer written(const Written& w, std::mt19937& random) {
  const SliceWriter slices(w.endpoints.size(), w.selectors.size(), w.history, random);
  const ByteVector colour = slices.slice(w.colour, w.wide, w.high);
  const ByteVector alpha = w.alpha.empty() ? ByteVector() : slices.slice(w.alpha, w.wide, w.high);
  Ktx2Writer out;
  out.width = static_cast<uint32_t>(4 * w.wide);
  out.height = static_cast<uint32_t>(4 * w.high);
  out.model = 163;
  out.scheme = 1;
  if (!w.alpha.empty()) out.channels = {0, 15};
  out.levels[0] = colour;
  append(out.levels[0], alpha);
  out.globalData =
      globalData({writeEndpoints(w.endpoints, w.grey), writeSelectors(w.selectors, w.plainSelectors), slices.tables()},
                 w.endpoints.size(), w.selectors.size(), colour.size(), alpha.size());
  return out;
}

// A picture of two colours in five textures, with long runs where `calm`.
Written randomPicture(std::mt19937& random, size_t wide, size_t high, bool withAlpha, bool calm) {
  Written w;
  w.wide = wide;
  w.high = high;
  w.history = random() % 3 == 0 ? 0 : 1 + random() % 60;
  w.grey = random() % 4 == 0;
  w.plainSelectors = random() % 2 == 0;
  const auto any = [&](size_t count) { return static_cast<int>(random() % count); };
  for (size_t i = 0, count = 1 + random() % 40; i < count; ++i) {
    w.endpoints.push_back({any(32), any(32), any(32), any(8)});
    if (w.grey) w.endpoints.back().green = w.endpoints.back().blue = w.endpoints.back().red;
  }
  w.selectors.resize(1 + random() % 90);
  for (WrittenSelector& s : w.selectors)
    for (int& step : s) step = any(4);
  const auto blocks = [&] {
    std::vector<SliceWriter::Block> list(wide * high);
    SliceWriter::Block last{0, 0};
    for (SliceWriter::Block& block : list) {
      if (!calm || random() % 100 == 0) last.endpoint = random() % w.endpoints.size();
      if (!calm || random() % 150 == 0) last.selector = random() % w.selectors.size();
      block = last;
    }
    return list;
  };
  w.colour = blocks();
  if (withAlpha) w.alpha = blocks();
  return w;
}

// A channel by the description: five bits repeated to eight, plus or minus a modifier, limited.
int channel(int base, int modifiers, int step) {
  constexpr int kTable[8][2] = {{2, 8}, {5, 17}, {9, 29}, {13, 42}, {18, 60}, {24, 80}, {33, 106}, {47, 183}};
  const int size = kTable[modifiers][step == 0 || step == 3];
  return std::clamp((base << 3 | base >> 2) + (step < 2 ? -size : size), 0, 255);
}

std::vector<uint8_t> expectedPixels(const Written& w) {
  std::vector<uint8_t> out;
  for (size_t y = 0; y < 4 * w.high; ++y)
    for (size_t x = 0; x < 4 * w.wide; ++x) {
      const size_t block = y / 4 * w.wide + x / 4, texel = y % 4 * 4 + x % 4;
      const WrittenEndpoint& e = w.endpoints[w.colour[block].endpoint];
      const int step = w.selectors[w.colour[block].selector][texel];
      for (const int base : {e.red, e.green, e.blue})
        out.push_back(static_cast<uint8_t>(channel(base, e.modifiers, step)));
      if (w.alpha.empty()) continue;
      const WrittenEndpoint& a = w.endpoints[w.alpha[block].endpoint];
      out.push_back(static_cast<uint8_t>(channel(a.green, a.modifiers, w.selectors[w.alpha[block].selector][texel])));
    }
  return out;
}

}  // namespace

TEST_CASE("ETC1S: the four colours of an endpoint") {
  // 5 bits 21 is 10101b, repeated 10101101b = 173; 3 is 00011000b = 24; 31 is 255. Codeword 3 has 13 and 42.
  const auto colours = etc1sColours({21, 3, 31, 3});
  CHECK(colours[0] == Texel{131, 0, 213, 255});
  CHECK(colours[1] == Texel{160, 11, 242, 255});
  CHECK(colours[2] == Texel{186, 37, 255, 255});
  CHECK(colours[3] == Texel{215, 66, 255, 255});
  // The ends of the table: codewords 0 and 7 around 16, which is 132.
  CHECK(etc1sColours({16, 16, 16, 0})[0] == Texel{124, 124, 124, 255});
  CHECK(etc1sColours({16, 16, 16, 0})[2] == Texel{134, 134, 134, 255});
  CHECK(etc1sColours({16, 16, 16, 7})[1] == Texel{85, 85, 85, 255});
  CHECK(etc1sColours({16, 16, 16, 7})[3] == Texel{255, 255, 255, 255});
}

TEST_CASE("ETC1S: a file of two blocks, pixels by hand") {
  std::mt19937 random(1);
  Written w;
  w.endpoints = {{21, 3, 31, 3}, {16, 16, 16, 0}};
  w.selectors = {{0, 1, 2, 3, 3, 3, 3, 3, 0, 0, 0, 0, 2, 2, 2, 2}, {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0}};
  w.wide = 2;
  w.high = 1;
  w.colour = {{0, 0}, {1, 1}};
  const Picture picture = decode(written(w, random).file());
  REQUIRE(picture.channels == 3);
  REQUIRE(picture.bytes.size() == 8 * 4 * 3);
  const auto texel = [&](size_t x, size_t y) {
    const uint8_t* p = &picture.bytes[(y * 8 + x) * 3];
    return std::array<int, 3>{p[0], p[1], p[2]};
  };
  CHECK(texel(0, 0) == std::array<int, 3>{131, 0, 213});
  CHECK(texel(1, 0) == std::array<int, 3>{160, 11, 242});
  CHECK(texel(2, 0) == std::array<int, 3>{186, 37, 255});
  CHECK(texel(3, 0) == std::array<int, 3>{215, 66, 255});
  CHECK(texel(0, 1) == std::array<int, 3>{215, 66, 255});
  CHECK(texel(3, 2) == std::array<int, 3>{131, 0, 213});
  CHECK(texel(0, 3) == std::array<int, 3>{186, 37, 255});
  CHECK(texel(4, 0) == std::array<int, 3>{130, 130, 130});
  CHECK(texel(7, 3) == std::array<int, 3>{124, 124, 124});
}

TEST_CASE("ETC1S: files of random blocks give the pixels that were written") {
  for (uint32_t seed = 0; seed < 120; ++seed) {
    std::mt19937 random(seed);
    const bool calm = seed % 3 == 0;
    const size_t most = calm ? 60 : 12;
    const Written w = randomPicture(random, 1 + random() % most, 1 + random() % most, seed % 2 == 0, calm);
    const Picture picture = decode(written(w, random).file());
    CHECK(picture.channels == (w.alpha.empty() ? 3 : 4));
    CHECK_MESSAGE(picture.bytes == expectedPixels(w), "seed ", seed);
  }
}

TEST_CASE("ETC1S: sides that are no multiples of four are cut") {
  std::mt19937 random(5);
  const Written w = randomPicture(random, 3, 2, false, false);
  Ktx2Writer file = written(w, random);
  file.width = 9;
  file.height = 6;
  const Picture picture = decode(file.file());
  const std::vector<uint8_t> whole = expectedPixels(w);
  REQUIRE(picture.bytes.size() == 9 * 6 * 3);
  for (size_t y = 0; y < 6; ++y)
    for (size_t i = 0; i < 9 * 3; ++i) CHECK(picture.bytes[y * 27 + i] == whole[y * 36 + i]);
}

TEST_CASE("ETC1S: channels of one, two and four meanings") {
  std::mt19937 random(6);
  const Written w = randomPicture(random, 4, 4, true, false);
  Ktx2Writer file = written(w, random);
  const std::vector<uint8_t> rgba = expectedPixels(w);
  const auto channelsOf = [&](const Picture& p, size_t texel) {
    const auto count = static_cast<size_t>(p.channels);
    return std::vector<uint8_t>(p.bytes.begin() + static_cast<ptrdiff_t>(texel * count),
                                p.bytes.begin() + static_cast<ptrdiff_t>((texel + 1) * count));
  };
  for (const size_t texel : {0, 37, 255}) {
    const uint8_t *p = &rgba[texel * 4], red = p[0], alpha = p[3];
    file.channels = {0};  // RGB: the second slice is none of it
    CHECK(channelsOf(decode(file.file()), texel) == std::vector<uint8_t>{red, p[1], p[2]});
    file.channels = {3, 15};  // red everywhere, and alpha
    CHECK(channelsOf(decode(file.file()), texel) == std::vector<uint8_t>{red, alpha});
    file.channels = {3};
    CHECK(channelsOf(decode(file.file()), texel) == std::vector<uint8_t>{red});
    file.channels = {3, 4};  // red, and green in the second slice: two channels, as normal maps have them
    CHECK(channelsOf(decode(file.file()), texel) == std::vector<uint8_t>{red, alpha, 0});
    CHECK(decode(file.file()).isRedGreen);
  }
}

TEST_CASE("ETC1S: Huffman codes of any lengths come back from their tables") {
  for (uint32_t seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const size_t symbols = 2 + random() % 3000;
    const test::HuffmanWriter writer =
        seed % 2 == 0 ? test::HuffmanWriter::uneven(symbols, random) : test::HuffmanWriter::flat(symbols);
    test::BitWriter out;
    writer.putTable(out);
    std::vector<uint32_t> sent;
    for (int i = 0; i < 500; ++i) {
      sent.push_back(static_cast<uint32_t>(random() % symbols));
      writer.put(out, sent.back());
    }
    BitReader in(out.bytes());
    const HuffmanCode code = readHuffmanCode(in);
    bool same = true;
    for (const uint32_t symbol : sent) same = same && code.decode(in) == symbol;
    CHECK_MESSAGE(same, "seed ", seed);
  }
  // Runs of zeros of every length that has another symbol for it.
  for (size_t zeros : {1, 2, 3, 10, 11, 138, 139, 300}) {
    std::vector<uint8_t> lengths(zeros + 2, 0);
    lengths.front() = lengths.back() = 1;
    test::BitWriter out;
    test::HuffmanWriter(lengths).putTable(out);
    out.put(1, 1);
    BitReader in(out.bytes());
    CHECK(readHuffmanCode(in).decode(in) == zeros + 1);
  }
}

TEST_CASE("ETC1S: what is broken is refused, wherever it is cut and whichever byte is wrong") {
  std::mt19937 random(7);
  const Written w = randomPicture(random, 5, 4, true, false);
  const Ktx2Writer whole = written(w, random);
  for (size_t bytes = 0; bytes < whole.globalData.size(); ++bytes) {
    Ktx2Writer cut = whole;
    cut.globalData.resize(bytes);
    CHECK_THROWS_AS(decode(cut.file()), Error);
  }
  for (size_t bytes = 0; bytes < whole.levels[0].size(); ++bytes) {
    Ktx2Writer cut = whole;
    cut.levels[0].resize(bytes);
    CHECK_THROWS_AS(decode(cut.file()), Error);
  }
  // A picture or an error, and nothing read outside of the file, which sanitizers would see.
  const ByteVector file = whole.file();
  int errors = 0;
  for (size_t at = 12; at < file.size(); ++at)
    for (const uint8_t flip : {uint8_t(0x01), uint8_t(0x80), uint8_t(0xFF)}) {
      ByteVector wrong = file;
      wrong[at] ^= flip;
      try {
        const Picture picture = decode(wrong);
        CHECK_FALSE(picture.bytes.empty());
      } catch (const Error& error) {
        CHECK(error.code() == ExitCode::BadInput);
        ++errors;
      }
    }
  CHECK(errors > 100);
}

TEST_CASE("ETC1S: frames that refer to others, empty codebooks, neighbours outside the picture") {
  std::mt19937 random(8);
  Written w = randomPicture(random, 3, 3, false, false);
  const Ktx2Writer whole = written(w, random);
  const auto message = [](const Ktx2Writer& file) {
    try {
      decode(file.file());
      return std::string();
    } catch (const Error& error) {
      return std::string(error.what());
    }
  };
  CHECK(message(whole).empty());
  Ktx2Writer frame = whole;
  frame.globalData[20] = 2;
  CHECK(message(frame).find("refers to an earlier one") != std::string::npos);
  for (const size_t count : {0, 2}) {
    Ktx2Writer empty = whole;
    empty.globalData[count] = empty.globalData[count + 1] = 0;
    CHECK(message(empty).find("a codebook is empty") != std::string::npos);
  }
  // One block that is to be like its left neighbour: with all repeats, no bit of a slice is needed but the first.
  const SliceWriter slices(1, 1, 0, random);
  test::BitWriter slice;
  const test::HuffmanWriter prediction = test::HuffmanWriter::flat(257);
  prediction.put(slice, 0);
  test::BitWriter tables;
  prediction.putTable(tables);
  for (int i = 0; i < 3; ++i) test::HuffmanWriter::flat(2).putTable(tables);
  tables.put(0, 13);
  Ktx2Writer neighbour = whole;
  neighbour.width = neighbour.height = 4;
  neighbour.levels[0] = slice.bytes();
  neighbour.globalData =
      globalData({writeEndpoints({{1, 2, 3, 4}}, false), writeSelectors({WrittenSelector{}}, true), tables.bytes()}, 1,
                 1, neighbour.levels[0].size(), 0);
  CHECK(message(neighbour).find("neighbour outside the picture") != std::string::npos);
}

}  // namespace braid::test_texture_ktx2_etc1s
