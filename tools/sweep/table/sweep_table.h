// SPDX-License-Identifier: Apache-2.0
// The rows of a sweep and the CSV file that keeps them: one row a cell (scene, method, ladder, mark, seed).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace braid {

// A place on a ladder: so many rounds of samples, or so many seconds.
enum class Ladder { Samples, Time };
const char* toString(Ladder ladder);  // "spp" or "time"

struct SweepRow {
  std::string scene, method;
  Ladder ladder = Ladder::Samples;
  double mark = 0;  // rounds or seconds asked for
  uint64_t seed = 0;
  uint64_t spp = 0;                             // passes of the method's first input
  double render = 0, denoise = 0, combine = 0;  // seconds
  std::vector<double> values;                   // one per SweepTable::columns; NaN where it does not apply

  double seconds() const { return render + denoise + combine; }
};

bool sameCell(const SweepRow& a, const SweepRow& b);

struct SweepTable {
  std::vector<std::string> columns;  // names of the values, metrics first
  std::vector<SweepRow> rows;

  // Index into columns; throws Error(Internal) when there is none.
  size_t column(const std::string& name) const;
  bool has(const SweepRow& cell) const;
};

// The header line of the CSV, with its end of line.
std::string csvHeader(const SweepTable& table);
// One line. Numbers are written with the fewest digits that read back to the same value; NaN is empty.
std::string csvLine(const SweepRow& row);

// Reads a table. A last line without its end, which an interrupted run leaves, is dropped. Throws Error(BadInput)
// naming the line.
SweepTable readSweepTable(const std::string& path);
// Writes to a temporary file, then renames. Throws Error(OutputFailed).
void writeSweepTable(const std::string& path, const SweepTable& table);
// Adds a line to the file and flushes it. Throws Error(OutputFailed).
void appendSweepRow(const std::string& path, const SweepRow& row);

// Writes text to a temporary file, then renames. Throws Error(OutputFailed).
void writeText(const std::string& path, const std::string& text);

}  // namespace braid
