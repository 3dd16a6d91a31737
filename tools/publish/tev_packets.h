// SPDX-License-Identifier: Apache-2.0
// Packets of the image viewer tev, which shows images that programs send it over TCP. A packet is its length in bytes
// (u32, itself included), its type (u8) and its payload; numbers are little-endian, strings end with a zero byte.
#pragma once

#include <string>
#include <vector>

#include "renderer/core/plane.h"
#include "renderer/film/film.h"

namespace braid {

struct TevChannel {
  std::string name;  // as in EXR files: "R", or "Error.Y" for channel Y of layer Error
  Plane<float> plane;
};

// One image of the viewer: at least one channel, all of one size.
using TevImage = std::vector<TevChannel>;

// Type 4, CreateImage: makes or replaces the image `name`, with the size and the channel names of `image`, in black.
std::string tevCreatePacket(const std::string& name, const TevImage& image);

// Type 5, UpdateImage of several channels: the pixels of a tile of the image, channel after channel.
std::string tevUpdatePacket(const std::string& name, const TevImage& image, const PixelWindow& tile);

}  // namespace braid
