// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/etc1s.h"

namespace braid::ktx2 {

namespace {

// The smaller and the larger modifier of every table codeword; both also occur with a minus.
constexpr std::array<std::array<int, 2>, 8> kModifiers = {
    {{2, 8}, {5, 17}, {9, 29}, {13, 42}, {18, 60}, {24, 80}, {33, 106}, {47, 183}}};

int expanded(uint8_t fiveBits) { return fiveBits << 3 | fiveBits >> 2; }

uint8_t limited(int value) { return static_cast<uint8_t>(std::clamp(value, 0, 255)); }

// What a slice says of every block, and the colours of the codebook.
class SliceTexels {
 public:
  SliceTexels(const BasisLz& basis, const std::vector<std::array<Texel, 4>>& colours, std::vector<BlockIndices> blocks)
      : basis_(basis), colours_(colours), blocks_(std::move(blocks)) {}

  Block block(size_t index) const {
    const BlockIndices& indices = blocks_[index];
    const std::array<Texel, 4>& colours = colours_[indices.endpoint];
    const Selector& selector = basis_.selectors()[indices.selector];
    Block block;
    for (size_t i = 0; i < block.size(); ++i) block[i] = colours[selector[i / kBlock] >> (i % kBlock * 2) & 3];
    return block;
  }

 private:
  const BasisLz& basis_;
  const std::vector<std::array<Texel, 4>>& colours_;
  std::vector<BlockIndices> blocks_;
};

}  // namespace

std::array<Texel, 4> etc1sColours(const Endpoint& endpoint) {
  const auto [small, large] = kModifiers[endpoint.modifiers];
  const int red = expanded(endpoint.red), green = expanded(endpoint.green), blue = expanded(endpoint.blue);
  std::array<Texel, 4> colours;
  const std::array<int, 4> steps = {-large, -small, small, large};
  for (size_t i = 0; i < steps.size(); ++i)
    colours[i] = {limited(red + steps[i]), limited(green + steps[i]), limited(blue + steps[i]), 255};
  return colours;
}

ByteTexels decodeEtc1s(const BasisLz& basis, Bytes level, size_t width, size_t height) {
  std::vector<std::array<Texel, 4>> colours;
  for (const Endpoint& endpoint : basis.endpoints()) colours.push_back(etc1sColours(endpoint));
  const auto read = [&](Slice slice) {
    const Bytes data = part(level, slice.offset, slice.bytes, "a slice");
    return SliceTexels(basis, colours, basis.decode(data, blocksAlong(width), blocksAlong(height)));
  };
  const SliceTexels colour = read(basis.colour());
  ByteTexels picture(width, height);
  if (basis.alpha().bytes == 0) {
    fillWithBlocks(picture, [&](size_t index) { return colour.block(index); });
    return picture;
  }
  const SliceTexels alpha = read(basis.alpha());
  fillWithBlocks(picture, [&](size_t index) {
    Block block = colour.block(index);
    const Block second = alpha.block(index);
    for (size_t i = 0; i < block.size(); ++i) block[i][3] = second[i][1];
    return block;
  });
  return picture;
}

}  // namespace braid::ktx2
