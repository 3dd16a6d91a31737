// SPDX-License-Identifier: Apache-2.0
// Bytes of a file, of which nothing is read outside its bounds.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "renderer/core/error.h"

namespace braid::ktx2 {

using Bytes = std::span<const uint8_t>;

[[noreturn]] inline void failBroken(const std::string& what) {
  throw Error(ExitCode::BadInput, "is a broken KTX2 image (" + what + "); save it again");
}

[[noreturn]] inline void failUnsupported(const std::string& what) {
  throw Error(ExitCode::BadInput,
              "is a KTX2 image " + what + ", which is not supported; save it as UASTC, ETC1S or PNG");
}

// `bytes` at `offset`; `what` names them in the message when they do not lie in `data`.
inline Bytes part(Bytes data, uint64_t offset, uint64_t bytes, const char* what) {
  if (offset > data.size() || bytes > data.size() - offset) failBroken(std::string(what) + " lies outside the file");
  return data.subspan(static_cast<size_t>(offset), static_cast<size_t>(bytes));
}

// Little-endian, of `bytes` bytes; an offset beyond the data is refused.
inline uint64_t littleEndian(Bytes data, size_t offset, size_t bytes) {
  if (offset > data.size() || bytes > data.size() - offset) failBroken("its header is cut");
  uint64_t value = 0;
  for (size_t i = bytes; i-- > 0;) value = value << 8 | data[offset + i];
  return value;
}

inline uint32_t word(Bytes data, size_t offset) { return static_cast<uint32_t>(littleEndian(data, offset, 4)); }
inline uint64_t longWord(Bytes data, size_t offset) { return littleEndian(data, offset, 8); }

}  // namespace braid::ktx2
