// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/tev_packets.h"

#include <bit>
#include <cstdint>
#include <cstring>

namespace braid {

namespace {

class Packet {
 public:
  explicit Packet(uint8_t type) : bytes_(4, '\0') { bytes_ += static_cast<char>(type); }
  void addFlag(bool value) { bytes_ += static_cast<char>(value); }
  void addText(const std::string& text) { bytes_.append(text.c_str(), std::strlen(text.c_str()) + 1); }
  void addInt(int32_t value) { addRaw(&value, sizeof value); }
  void addFloats(const float* values, size_t count) { addRaw(values, count * sizeof(float)); }
  void reserve(size_t bytes) { bytes_.reserve(bytes_.size() + bytes); }
  std::string finished() {
    const auto size = static_cast<uint32_t>(bytes_.size());
    std::memcpy(bytes_.data(), &size, sizeof size);
    return std::move(bytes_);
  }

 private:
  void addRaw(const void* data, size_t bytes) {
    static_assert(std::endian::native == std::endian::little, "the protocol is little-endian");
    bytes_.append(static_cast<const char*>(data), bytes);
  }
  std::string bytes_;
};

void addChannelNames(Packet& packet, const TevImage& image) {
  packet.addInt(static_cast<int32_t>(image.size()));
  for (const TevChannel& c : image) packet.addText(c.name);
}

}  // namespace

std::string tevCreatePacket(const std::string& name, const TevImage& image) {
  Packet packet(4);
  packet.addFlag(false);  // leave the viewer's focus where it is
  packet.addText(name);
  packet.addInt(image.front().plane.width);
  packet.addInt(image.front().plane.height);
  addChannelNames(packet, image);
  return packet.finished();
}

std::string tevUpdatePacket(const std::string& name, const TevImage& image, const PixelWindow& tile) {
  Packet packet(5);
  packet.addFlag(false);
  packet.addText(name);
  addChannelNames(packet, image);
  for (const int value : {tile.x0, tile.y0, tile.width(), tile.height()}) packet.addInt(value);
  const auto width = static_cast<size_t>(tile.width()), height = static_cast<size_t>(tile.height());
  packet.reserve(image.size() * width * height * sizeof(float));
  for (const TevChannel& c : image)
    for (int y = tile.y0; y < tile.y1; ++y) packet.addFloats(&c.plane.at(tile.x0, y), width);
  return packet.finished();
}

}  // namespace braid
