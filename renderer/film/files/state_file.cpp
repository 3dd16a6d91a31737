// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/state_file.h"

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/state_text.h"

namespace braid {

namespace {

static_assert(std::endian::native == std::endian::little, "state files hold the planes as they lie in memory");

constexpr char kMagic[] = "braid-state";
constexpr uint64_t kMaxHeader = 16 << 20;
constexpr size_t kFirstLine = 64;      // at most
constexpr size_t kChecksumBytes = 17;  // 16 digits and a newline

// A file that is read from the front, with its size known and everything that was read in a checksum.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status)) fail("does not exist: check the name");
    if (!std::filesystem::is_regular_file(status)) fail("is not a file: check the name");
    size_ = std::filesystem::file_size(path, error);
    file_ = std::fopen(path.c_str(), "rb");
    if (error || !file_) fail(fmt::format("cannot be read: {}: check its permissions", std::strerror(errno)));
  }
  ~Reader() {
    if (file_) std::fclose(file_);
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  [[noreturn]] void fail(const std::string& what) const { throw Error(ExitCode::BadInput, path_ + ": " + what); }
  uint64_t size() const { return size_; }
  uint64_t position() const { return position_; }
  std::string checksum() const { return hexString(hash_.value()); }

  void read(void* to, size_t bytes) {
    const size_t got = std::fread(to, 1, bytes, file_);
    if (got != bytes)
      fail(fmt::format("cannot be read beyond byte {} of {}: use another copy", position_ + got, size_));
    position_ += bytes;
    hash_.add(to, bytes);
  }
  // Up to the newline, which is swallowed; empty if there is none within the limit.
  std::string firstLine() {
    std::string line;
    for (int c = std::fgetc(file_); c != EOF && line.size() < kFirstLine; c = std::fgetc(file_)) {
      line += static_cast<char>(c);
      if (c != '\n') continue;
      position_ = line.size();
      hash_.add(line);
      line.pop_back();
      return line;
    }
    return {};
  }

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
  uint64_t size_ = 0, position_ = 0;
  ContentHash hash_;
};

// Reads the first line and the header; afterwards the size of the file is known to be what the plane table says, which
// is returned.
std::vector<PlaneEntry> readHeader(Reader& in, const std::string& path, FilmState& state) {
  unsigned long long headerBytes = 0, planeBytes = 0;
  int format = 0, used = 0;
  const std::string line = in.firstLine();
  const int found = std::sscanf(line.c_str(), "braid-state %d %llu %llu%n", &format, &headerBytes, &planeBytes, &used);
  if (line.compare(0, sizeof kMagic - 1, kMagic) != 0)
    in.fail("is no state of braid: give a file that --checkpoint wrote");
  if (found >= 1 && format != kStateFormat)
    in.fail(fmt::format("has state format {}, but this braid reads format {}: use the braid that wrote it", format,
                        kStateFormat));
  if (found != 3 || static_cast<size_t>(used) != line.size() || headerBytes > kMaxHeader || planeBytes > in.size())
    in.fail("the first line is damaged or the file cut short: use another copy");
  const uint64_t expected = in.position() + headerBytes + planeBytes + kChecksumBytes;
  if (in.size() != expected)
    in.fail(
        fmt::format("has {} bytes instead of {}: it was cut short or damaged: use another copy", in.size(), expected));
  std::string header(headerBytes, '\0');
  in.read(header.data(), header.size());
  HistoryImages images;
  parseStateHeader(path, header, state, images);
  std::vector<PlaneEntry> table = planeTable(state, images);
  uint64_t bytes = 0;
  for (const PlaneEntry& p : table) bytes += p.bytes(state.window.width(), state.window.height());
  if (bytes != planeBytes) in.fail("the planes do not have the size of the image: use another copy");
  return table;
}

template <class T>
void readPlane(Reader& in, const FilmState& state, const PlaneEntry& entry, Plane<T>& plane) {
  plane = Plane<T>(entry.columns(state.window.width()), entry.columns(state.window.height()));
  in.read(plane.data.data(), plane.size() * sizeof(T));
}

// Whether numbers of samples, hits and weights are such as a render makes.
bool isPossible(FilmState& state) {
  SamplePlacement& placement = *state.placement;
  const auto mean = [&](const Plane<double>& plane) {
    double sum = 0;
    for (size_t t = 0; t < placement.tiles(); ++t) sum += placement.pixels(t) * plane[t];
    return sum / (static_cast<double>(placement.width) * placement.height);
  };
  RawSums list;
  placement.listSums(list);
  const size_t whole = list.size();
  placement.listMap(list);
  for (size_t p = 0; p < list.size(); ++p)
    for (const double v : list[p].plane->data)
      if (!(v >= 0 && v <= static_cast<double>(kMaxPass)) || (p < whole && v != std::floor(v))) return false;
  // A pass gives a pixel one sample on average, but for rounding.
  for (const Plane<double>& weight : placement.weight)
    if (mean(weight) > 2) return false;
  for (int k = 0; k < 4; ++k)
    if (mean(placement.count[static_cast<size_t>(k)]) >
        2 * static_cast<double>(state.estimates[0].sums.passesInBucket(k) + 1))
      return false;
  return true;
}

}  // namespace

std::unique_ptr<OutputFile> beginStateFile(const std::string& path, const FilmState& state) {
  const std::string header = stateHeader(state);
  BRAID_ASSERT(header.size() <= kMaxHeader);
  const std::vector<PlaneEntry> planes = planeTable(state);
  uint64_t planeBytes = 0;
  for (const PlaneEntry& p : planes) planeBytes += p.bytesPerValue() * (p.sum ? p.sum->size() : p.image->size());

  auto file = std::make_unique<OutputFile>(path, ".state");
  ContentHash hash;
  const auto write = [&](const void* data, size_t bytes) {
    hash.add(data, bytes);
    if (file->write(data, bytes) != bytes) file->fail("");
  };
  const std::string first = fmt::format("{} {} {} {}\n", kMagic, kStateFormat, header.size(), planeBytes);
  write(first.data(), first.size());
  write(header.data(), header.size());
  for (const PlaneEntry& p : planes)
    if (p.sum)
      write(p.sum->data.data(), p.sum->size() * sizeof(double));
    else
      write(p.image->data.data(), p.image->size() * sizeof(float));
  const std::string checksum = hexString(hash.value()) + '\n';
  write(checksum.data(), checksum.size());
  return file;
}

void writeStateFile(const std::string& path, const FilmState& state) { beginStateFile(path, state)->finish(); }

FilmState readStateHeader(const std::string& path) {
  Reader in(path);
  FilmState state;
  readHeader(in, path, state);
  return state;
}

FilmState readStateFile(const std::string& path) {
  Reader in(path);
  FilmState state;
  for (const PlaneEntry& p : readHeader(in, path, state))
    if (p.sum)
      readPlane(in, state, p, *p.sum);
    else
      readPlane(in, state, p, *p.image);
  const std::string computed = in.checksum();
  char stored[kChecksumBytes] = {};
  in.read(stored, sizeof stored);
  if (computed + '\n' != std::string(stored, sizeof stored))
    in.fail("is damaged: its checksum is not that of its content: use another copy");
  if (state.placement && !isPossible(state))
    in.fail("holds impossible numbers of samples: use another copy, or render again");
  return state;
}

}  // namespace braid
