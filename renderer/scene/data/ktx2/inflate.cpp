// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/container.h"

#include <algorithm>
#include <limits>
#include <memory>

#include <zlib.h>
#include <zstd.h>

namespace braid::ktx2 {

namespace {

void inflateZstandard(Bytes level, std::vector<uint8_t>& out) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  if (!context) throw std::bad_alloc();
  ZSTD_inBuffer from{level.data(), level.size(), 0};
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  while (to.pos < to.size) {
    const size_t in = from.pos, written = to.pos;
    const size_t state = ZSTD_decompressStream(context.get(), &to, &from);
    if (ZSTD_isError(state)) failBroken(std::string("libzstd: ") + ZSTD_getErrorName(state));
    if (from.pos == in && to.pos == written) failBroken("its compressed level is too short");
  }
}

void inflateZlib(Bytes level, std::vector<uint8_t>& out) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, decltype(&inflateEnd)> ending(&stream, inflateEnd);
  constexpr size_t kMostAtOnce = std::numeric_limits<uInt>::max();
  stream.next_in = const_cast<Bytef*>(level.data());
  size_t unread = level.size(), written = 0;
  while (written < out.size()) {
    const auto in = static_cast<uInt>(std::min(unread, kMostAtOnce));
    const auto space = static_cast<uInt>(std::min(out.size() - written, kMostAtOnce));
    stream.avail_in = in;
    stream.next_out = out.data() + written;
    stream.avail_out = space;
    const int state = ::inflate(&stream, Z_NO_FLUSH);
    unread -= in - stream.avail_in;
    written += space - stream.avail_out;
    if (written == out.size()) return;
    if (state == Z_STREAM_END || (in == stream.avail_in && space == stream.avail_out))
      failBroken("its compressed level is too short");
    if (state != Z_OK) failBroken("zlib cannot unpack it");
  }
}

}  // namespace

std::vector<uint8_t> inflate(Supercompression scheme, Bytes level, size_t bytes) {
  std::vector<uint8_t> out(bytes);
  if (scheme == Supercompression::Zstandard)
    inflateZstandard(level, out);
  else
    inflateZlib(level, out);
  return out;
}

}  // namespace braid::ktx2
