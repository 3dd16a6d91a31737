// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/container.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace braid::ktx2 {

namespace {

constexpr std::array<uint8_t, 12> kIdentifier = {0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'};

// Offsets in the file.
enum : size_t {
  kFormat = 12,
  kWidth = 20,
  kHeight = 24,
  kDepth = 28,
  kLayers = 32,
  kFaces = 36,
  kLevels = 40,
  kScheme = 44,
  kDescriptor = 48,
  kKeyValues = 56,
  kGlobalData = 64,
  kLevelIndex = 80
};

constexpr uint64_t kMostLevels = 32;

void readShape(Bytes file, Container& out) {
  out.width = word(file, kWidth);
  out.height = std::max(1u, word(file, kHeight));  // 0: one row
  const uint32_t depth = word(file, kDepth), layers = std::max(1u, word(file, kLayers));
  const uint32_t faces = word(file, kFaces), levels = std::max(1u, word(file, kLevels));
  if (out.width == 0) failBroken("its width is 0");
  if (depth > 1) failUnsupported("of a volume");
  if (faces != 1 && faces != 6) failBroken("it has " + std::to_string(faces) + " faces");
  if (levels > kMostLevels) failBroken("it has " + std::to_string(levels) + " levels");
  out.isSeveral = layers > 1 || faces > 1;
  out.imageCount = uint64_t(levels) * layers * faces;  // 5, 32 and 3 bits at most
  const uint32_t scheme = word(file, kScheme);
  if (scheme > 3) failUnsupported("of supercompression scheme " + std::to_string(scheme));
  out.scheme = static_cast<Supercompression>(scheme);
}

// The basic descriptor block, which stands first (Khronos Data Format 1.4, "Khronos Basic Data Format Descriptor").
void readDescriptor(Bytes data, Container& out) {
  constexpr size_t kTotal = 4, kBlockHeader = 24, kSample = 16, kSampleChannel = 3;
  constexpr uint8_t kTransferSrgb = 2, kFlagPremultiplied = 1, kChannelBits = 0x0F;
  const auto blockBytes = static_cast<size_t>(littleEndian(data, kTotal + 6, 2));
  const Bytes block = part(data, kTotal, std::max(blockBytes, kBlockHeader), "its data format");
  out.model = static_cast<ColourModel>(block[8]);
  out.srgb = block[10] == kTransferSrgb;
  out.premultiplied = (block[11] & kFlagPremultiplied) != 0;
  for (size_t at = kBlockHeader; at + kSample <= block.size(); at += kSample)
    out.channels.push_back(block[at + kSampleChannel] & kChannelBits);
}

std::string_view text(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

void readKeyValue(std::string_view key, std::string_view value, Container& out) {
  const auto isOneOf = [](char c, std::string_view set) { return set.find(c) != set.npos; };
  if (key == "KTXorientation" && value.size() >= 1 && isOneOf(value[0], "rl")) {
    out.flipsX = value[0] == 'l';
    out.flipsY = value.size() >= 2 && value[1] == 'u';
  }
  if (key == "KTXswizzle" && value.size() >= 4) {
    const std::string_view swizzle = value.substr(0, 4);
    if (std::all_of(swizzle.begin(), swizzle.end(), [&](char c) { return isOneOf(c, "rgba01"); }))
      out.swizzle = swizzle == "rgba" ? "" : swizzle;
  }
  if (key == "KTXanimData") out.isSeveral = true;
}

// Entries of a length, a key that a zero ends, and a value, each padded to four bytes.
void readKeyValues(Bytes data, Container& out) {
  while (data.size() >= 4) {
    const uint32_t length = word(data, 0);
    data = data.subspan(4);
    if (length > data.size()) return;
    const std::string_view entry = text(data.first(length));
    const size_t end = entry.find('\0');
    if (end != entry.npos) readKeyValue(entry.substr(0, end), entry.substr(end + 1), out);
    data = data.subspan(std::min<size_t>(data.size(), (size_t(length) + 3) / 4 * 4));
  }
}

}  // namespace

bool isKtx2(Bytes data) {
  return data.size() >= kIdentifier.size() && std::equal(kIdentifier.begin(), kIdentifier.end(), data.begin());
}

Container readContainer(Bytes file) {
  if (!isKtx2(file)) failBroken("it begins with other bytes");
  Container out;
  out.vkFormat = word(file, kFormat);
  readShape(file, out);
  const Bytes descriptor = part(file, word(file, kDescriptor), word(file, kDescriptor + 4), "its data format");
  readDescriptor(descriptor, out);
  readKeyValues(part(file, word(file, kKeyValues), word(file, kKeyValues + 4), "its key/value data"), out);
  out.globalData =
      part(file, longWord(file, kGlobalData), longWord(file, kGlobalData + 8), "its supercompression data");
  out.level = part(file, longWord(file, kLevelIndex), longWord(file, kLevelIndex + 8), "its largest level");
  return out;
}

}  // namespace braid::ktx2
