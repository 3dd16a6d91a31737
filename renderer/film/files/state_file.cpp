// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/state_file.h"

#include <bit>
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
constexpr int kFormat = 3;
constexpr uint64_t kMaxHeader = 16 << 20;
constexpr size_t kFirstLine = 64;      // at most
constexpr size_t kChecksumBytes = 17;  // 16 digits and a newline

// Calls visit(values) for every plane, in the order of planeTable(). Planes are those of a state with its sums.
template <class Visit>
void forEachPlane(const FilmState& state, const Visit& visit) {
  const auto colour = [&](const auto& planes) {
    for (size_t c = 0; c < 3; ++c) visit(planes[c].data);
  };
  for (const EstimateState& e : state.estimates) {
    for (const Rgb<double>& sum : e.sums.sums()) colour(sum);
    colour(e.sums.sumOfSquares());
    if (e.sums.keepsBias()) {
      for (int half = 0; half < 2; ++half) colour(e.sums.biasSum(half));
      colour(e.sums.biasSumOfSquares());
    }
    if (e.parts) {
      for (const Rgb<double>& sum : e.parts->direct().sums()) colour(sum);
      colour(e.parts->direct().sumOfSquares());
      colour(e.parts->indirectSumOfSquares());
    }
    for (const Checkpoint& c : e.history)
      for (const Rgb<float>* image : {&c.variance, &c.mean, &c.half[0], &c.half[1]})
        if (!image->empty()) colour(*image);
  }
  if (state.features) {
    for (int half = 0; half < 2; ++half)
      for (const Plane<double>& p : state.features->sums(half)) visit(p.data);
    for (const Plane<double>& p : state.features->sumsOfSquares()) visit(p.data);
  }
  if (state.coverage) visit(state.coverage->sums().data);
}

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

// Reads the first line and the header; afterwards the size of the file is known to be what the plane table says.
StateLayout readHeader(Reader& in, const std::string& path, FilmState& state) {
  unsigned long long headerBytes = 0, planeBytes = 0;
  int format = 0, used = 0;
  const std::string line = in.firstLine();
  const int found = std::sscanf(line.c_str(), "braid-state %d %llu %llu%n", &format, &headerBytes, &planeBytes, &used);
  if (line.compare(0, sizeof kMagic - 1, kMagic) != 0)
    in.fail("is no state of braid: give a file that --checkpoint wrote");
  if (found >= 1 && format != kFormat)
    in.fail(fmt::format("has state format {}, but this braid reads format {}: use the braid that wrote it", format,
                        kFormat));
  if (found != 3 || static_cast<size_t>(used) != line.size() || headerBytes > kMaxHeader || planeBytes > in.size())
    in.fail("the first line is damaged or the file cut short: use another copy");
  const uint64_t expected = in.position() + headerBytes + planeBytes + kChecksumBytes;
  if (in.size() != expected)
    in.fail(
        fmt::format("has {} bytes instead of {}: it was cut short or damaged: use another copy", in.size(), expected));
  std::string header(headerBytes, '\0');
  in.read(header.data(), header.size());
  StateLayout layout;
  parseStateHeader(path, header, state, layout);
  uint64_t bytesOfPixel = 0;
  for (const PlaneEntry& p : planeTable(state, layout)) bytesOfPixel += p.bytesPerValue;
  const auto pixels = static_cast<uint64_t>(state.window.width()) * static_cast<uint64_t>(state.window.height());
  if (bytesOfPixel * pixels != planeBytes) in.fail("the planes do not have the size of the image: use another copy");
  return layout;
}

template <class T>
Plane<T> readPlane(Reader& in, const FilmState& state) {
  Plane<T> plane(state.window.width(), state.window.height());
  in.read(plane.data.data(), plane.size() * sizeof(T));
  return plane;
}

template <class T>
Rgb<T> readColour(Reader& in, const FilmState& state) {
  Rgb<T> planes;
  for (size_t c = 0; c < 3; ++c) planes[c] = readPlane<T>(in, state);
  return planes;
}

Accumulator readSums(Reader& in, const FilmState& state, const EstimateLayout& layout) {
  std::vector<Rgb<double>> sums;
  for (int k = 0; k < state.buckets; ++k) sums.push_back(readColour<double>(in, state));
  Rgb<double> squares = readColour<double>(in, state);
  return Accumulator::fromSums(std::move(sums), std::move(squares), layout.counts, layout.rejected,
                               layout.clampedSplats);
}

void readEstimate(Reader& in, const FilmState& state, const EstimateLayout& layout, EstimateState& e) {
  e.sums = readSums(in, state, layout);
  if (layout.bias) {
    Rgb<double> ofA = readColour<double>(in, state), ofB = readColour<double>(in, state);
    e.sums.setBiasSums(std::move(ofA), std::move(ofB), readColour<double>(in, state));
  }
  if (layout.parts) {
    Accumulator direct = readSums(in, state, layout);
    e.parts = DirectLightAccumulator::fromSums(std::move(direct), readColour<double>(in, state));
  }
  for (size_t k = 0; k < e.history.size(); ++k) {
    Checkpoint& c = e.history[k];
    c.variance = readColour<float>(in, state);
    if (!layout.images[k]) continue;
    for (Rgb<float>* image : {&c.mean, &c.half[0], &c.half[1]}) *image = readColour<float>(in, state);
  }
}

FeatureAccumulator readFeatures(Reader& in, const FilmState& state, const StateLayout& layout) {
  std::vector<Plane<double>> parts[3];
  for (auto& part : parts)
    for (int c = 0; c < FeatureSample::kComponents; ++c) part.push_back(readPlane<double>(in, state));
  return FeatureAccumulator::fromSums(std::move(parts[0]), std::move(parts[1]), std::move(parts[2]),
                                      layout.featurePasses[0], layout.featurePasses[1]);
}

}  // namespace

std::unique_ptr<OutputFile> beginStateFile(const std::string& path, const FilmState& state) {
  const std::string header = stateHeader(state);
  BRAID_ASSERT(header.size() <= kMaxHeader);
  uint64_t planeBytes = 0;
  forEachPlane(state, [&](const auto& values) { planeBytes += values.size() * sizeof(values[0]); });

  auto file = std::make_unique<OutputFile>(path, ".state");
  ContentHash hash;
  const auto write = [&](const void* data, size_t bytes) {
    hash.add(data, bytes);
    if (file->write(data, bytes) != bytes) file->fail("");
  };
  const std::string first = fmt::format("{} {} {} {}\n", kMagic, kFormat, header.size(), planeBytes);
  write(first.data(), first.size());
  write(header.data(), header.size());
  forEachPlane(state, [&](const auto& values) { write(values.data(), values.size() * sizeof(values[0])); });
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
  const StateLayout layout = readHeader(in, path, state);
  for (size_t i = 0; i < state.estimates.size(); ++i) readEstimate(in, state, layout.estimates[i], state.estimates[i]);
  if (layout.features) state.features = readFeatures(in, state, layout);
  if (layout.coverage)
    state.coverage = CoverageAccumulator::fromSums(readPlane<double>(in, state), layout.coveragePasses);
  const std::string computed = in.checksum();
  char stored[kChecksumBytes] = {};
  in.read(stored, sizeof stored);
  if (computed + '\n' != std::string(stored, sizeof stored))
    in.fail("is damaged: its checksum is not that of its content: use another copy");
  return state;
}

}  // namespace braid
