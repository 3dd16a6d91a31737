// SPDX-License-Identifier: Apache-2.0
// FilmState in a file: to go on after an interruption, and to bring the shares of several machines together.
//
//   braid-state 3 HEADERBYTES PLANEBYTES   one line
//   header          lines of words: identity, options, estimates with their passes, table of planes
//   planes          little-endian float64 or float32, row-major, in the order of that table
//   checksum        16 hexadecimal digits of all that comes before, and a newline
//
// The first line lets a reader see at once, from the size of the file, that it is whole; nothing is allocated before.
#pragma once

#include <memory>
#include <string>

#include "renderer/film/film_state.h"
#include "renderer/film/files/output_file.h"

namespace braid {

inline constexpr int kStateFormat = 3;

// Writes all bytes to a temporary file; finish() of the result (which waits for the disk and may be called by another
// thread) puts it in place of `path`. Throws Error(OutputFailed).
std::unique_ptr<OutputFile> beginStateFile(const std::string& path, const FilmState& state);

// Both at once.
void writeStateFile(const std::string& path, const FilmState& state);

// Throws Error(BadInput) with one line (file, place, mend) for a file that is missing, cut short, damaged or no state.
FilmState readStateFile(const std::string& path);

// The same without planes and checksum: sums are empty, the passes of buckets are those of the header. For comparing
// many files before any of them is loaded.
FilmState readStateHeader(const std::string& path);

}  // namespace braid
