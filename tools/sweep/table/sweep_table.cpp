// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/table/sweep_table.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/output_file.h"

namespace braid {

namespace {

const std::vector<std::string> kKeyColumns = {
    "scene",   "method",         "ladder",          "mark",           "spp", "seed",
    "seconds", "render_seconds", "denoise_seconds", "combine_seconds"};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields(1);
  for (char c : line) {
    if (c == ',')
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return fields;
}

std::string numberText(double v) { return std::isnan(v) ? "" : fmt::format("{}", v); }

// Numbers of one line; an empty field is NaN.
class LineReader {
 public:
  LineReader(const std::string& path, size_t line) : path_(path), line_(line) {}

  double number(const std::string& field) const {
    if (field.empty()) return std::numeric_limits<double>::quiet_NaN();
    char* end = nullptr;
    const double value = std::strtod(field.c_str(), &end);
    if (*end) fail(fmt::format("'{}' is not a number", field));
    return value;
  }
  uint64_t count(const std::string& field) const {
    char* end = nullptr;
    const uint64_t value = std::strtoull(field.c_str(), &end, 10);
    if (field.empty() || *end) fail(fmt::format("'{}' is not a whole number", field));
    return value;
  }
  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: line {}: {}; mend it or delete the file to start over", path_, line_, reason));
  }

 private:
  const std::string& path_;
  size_t line_;
};

SweepRow parseRow(const std::vector<std::string>& f, const LineReader& reader) {
  SweepRow row;
  row.scene = f[0];
  row.method = f[1];
  if (f[2] != "spp" && f[2] != "time") reader.fail(fmt::format("unknown ladder '{}'", f[2]));
  row.ladder = f[2] == "spp" ? Ladder::Samples : Ladder::Time;
  row.mark = reader.number(f[3]);
  row.spp = reader.count(f[4]);
  row.seed = reader.count(f[5]);
  row.render = reader.number(f[7]);
  row.denoise = reader.number(f[8]);
  row.combine = reader.number(f[9]);
  for (size_t i = kKeyColumns.size(); i < f.size(); ++i) row.values.push_back(reader.number(f[i]));
  return row;
}

}  // namespace

const char* toString(Ladder ladder) { return ladder == Ladder::Samples ? "spp" : "time"; }

bool sameCell(const SweepRow& a, const SweepRow& b) {
  return a.scene == b.scene && a.method == b.method && a.ladder == b.ladder && a.mark == b.mark && a.seed == b.seed;
}

size_t SweepTable::column(const std::string& name) const {
  const auto found = std::find(columns.begin(), columns.end(), name);
  BRAID_ASSERT(found != columns.end());
  return static_cast<size_t>(found - columns.begin());
}

bool SweepTable::has(const SweepRow& cell) const {
  return std::any_of(rows.begin(), rows.end(), [&](const SweepRow& r) { return sameCell(r, cell); });
}

std::string csvHeader(const SweepTable& table) {
  std::string line;
  for (const std::vector<std::string>* names : {&kKeyColumns, &table.columns})
    for (const std::string& name : *names) line += (line.empty() ? "" : ",") + name;
  return line + "\n";
}

std::string csvLine(const SweepRow& row) {
  // Their sum is that of the times as they are written, so that a row that was read is written with the same bytes.
  SweepRow r = row;
  for (double* seconds : {&r.render, &r.denoise, &r.combine}) *seconds = std::stod(fmt::format("{:.6g}", *seconds));
  std::string line = fmt::format("{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g}", r.scene, r.method, toString(r.ladder),
                                 numberText(r.mark), r.spp, r.seed, r.seconds(), r.render, r.denoise, r.combine);
  for (double v : r.values) line += "," + numberText(v);
  return line + "\n";
}

SweepTable readSweepTable(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(ExitCode::BadInput, path + ": cannot be read: " + std::strerror(errno));
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  SweepTable table;
  size_t number = 0;
  for (size_t begin = 0, end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const LineReader reader(path, ++number);
    const std::vector<std::string> fields = split(text.substr(begin, end - begin));
    if (number == 1) {
      if (fields.size() < kKeyColumns.size() || !std::equal(kKeyColumns.begin(), kKeyColumns.end(), fields.begin()))
        reader.fail("it is not the header of a sweep");
      table.columns.assign(fields.begin() + static_cast<std::ptrdiff_t>(kKeyColumns.size()), fields.end());
      continue;
    }
    if (fields.size() != kKeyColumns.size() + table.columns.size())
      reader.fail(fmt::format("{} fields instead of {}", fields.size(), kKeyColumns.size() + table.columns.size()));
    table.rows.push_back(parseRow(fields, reader));
  }
  return table;
}

void writeText(const std::string& path, const std::string& text) {
  OutputFile file(path, ".txt");
  file.write(text.data(), text.size());
  file.finish();
}

void writeSweepTable(const std::string& path, const SweepTable& table) {
  std::string text = csvHeader(table);
  for (const SweepRow& row : table.rows) text += csvLine(row);
  writeText(path, text);
}

void appendSweepRow(const std::string& path, const SweepRow& row) {
  const std::string line = csvLine(row);
  errno = 0;
  std::FILE* file = std::fopen(path.c_str(), "ab");
  bool ok = file && std::fwrite(line.data(), 1, line.size(), file) == line.size();
  if (file) ok = std::fclose(file) == 0 && ok;
  if (!ok) throw Error(ExitCode::OutputFailed, path + ": cannot be written: " + std::strerror(errno));
}

}  // namespace braid
