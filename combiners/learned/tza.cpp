// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/tza.h"

#include <cstring>

#include <fmt/format.h>

#include "combiners/learned/weights_file.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr uint16_t kMagic = 0x41D7;
constexpr uint64_t kLargestFile = uint64_t(1) << 28;
constexpr uint32_t kMostTensors = 4096;
constexpr uint64_t kLargestSize = 1 << 16;

class Parser {
 public:
  Parser(std::span<const uint8_t> file, const std::string& path) : file_(file), path_(path) {}

  WeightTensors parse();

 private:
  struct Entry {
    std::string name;
    WeightTensor tensor;
    uint64_t count = 1;  // of values
    char type = 0;
    uint64_t begin = 0;  // of the values
  };

  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {}: take the file from where it is published again", path_, reason));
  }
  std::span<const uint8_t> take(uint64_t bytes) {
    if (bytes > file_.size() - at_) fail(fmt::format("cut off at byte {}", at_));
    at_ += bytes;
    return file_.subspan(at_ - bytes, bytes);
  }
  template <class T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string text(size_t length) {
    const auto bytes = take(length);
    return {bytes.begin(), bytes.end()};
  }

  Entry entry();
  void readValues(Entry& entry) const;

  std::span<const uint8_t> file_;
  const std::string& path_;
  uint64_t at_ = 0;  // never beyond the end
};

Parser::Entry Parser::entry() {
  Entry e;
  e.name = text(number<uint16_t>());
  const auto sizes = number<uint8_t>();
  if (sizes < 1 || sizes > 4) fail(fmt::format("{}: {} dimensions instead of 1 to 4", e.name, sizes));
  for (int k = 0; k < sizes; ++k) {
    const auto size = number<uint32_t>();
    if (size < 1 || size > kLargestSize) fail(fmt::format("{}: a dimension of {}", e.name, size));
    e.count *= size;
    if (e.count > kLargestFile) fail(fmt::format("{}: more values than a file can hold", e.name));
    e.tensor.sizes.push_back(static_cast<int>(size));
  }
  const std::string layout = text(sizes);
  if (layout != (sizes == 1 ? "x" : sizes == 4 ? "oihw" : layout))
    fail(fmt::format("{}: its dimensions are '{}', not 'oihw' or 'x'", e.name, layout));
  e.type = static_cast<char>(number<uint8_t>());
  if (e.type != 'f' && e.type != 'h')
    fail(fmt::format("{}: values of type '{}', not 'f' or 'h' (32-bit or 16-bit floats)", e.name, e.type));
  e.begin = number<uint64_t>();
  return e;
}

void Parser::readValues(Entry& e) const {
  const uint64_t bytes = e.count * (e.type == 'f' ? sizeof(float) : sizeof(uint16_t));
  if (e.begin > file_.size() || bytes > file_.size() - e.begin)
    fail(fmt::format("{}: its {} bytes from byte {} on are not all in the file", e.name, bytes, e.begin));
  const std::span<const uint8_t> from = file_.subspan(e.begin, bytes);
  if (e.type == 'f') {
    e.tensor.values.resize(e.count);
    std::memcpy(e.tensor.values.data(), from.data(), bytes);
  } else {
    e.tensor.values = fromHalves(from);
  }
  if (!areFinite(e.tensor.values)) fail(fmt::format("{}: a value that is not finite", e.name));
}

WeightTensors Parser::parse() {
  if (number<uint16_t>() != kMagic) fail("no TZA file, in which Open Image Denoise publishes weights");
  const auto major = number<uint8_t>(), minor = number<uint8_t>();
  if (major != 2) fail(fmt::format("TZA version {}.{}, but only 2 is known", major, minor));
  const auto table = number<uint64_t>();
  if (table > file_.size()) fail(fmt::format("its table begins at byte {}, after the end", table));
  at_ = table;
  const auto count = number<uint32_t>();
  if (count > kMostTensors) fail(fmt::format("{} tensors, {} at most", count, kMostTensors));
  WeightTensors tensors;
  uint64_t values = 0;
  for (uint32_t k = 0; k < count; ++k) {
    Entry e = entry();
    values += e.count;  // tensors that share their values would take more memory than the file
    if (values > file_.size()) fail(fmt::format("{}: more values than the file has bytes", e.name));
    readValues(e);
    if (!tensors.emplace(e.name, std::move(e.tensor)).second)
      fail(fmt::format("{}: a second one of this name", e.name));
  }
  return tensors;
}

}  // namespace

WeightTensors parseTza(std::span<const uint8_t> file, const std::string& path) { return Parser(file, path).parse(); }

WeightTensors readTza(const std::string& path) { return parseTza(readWeightsFile(path, kLargestFile), path); }

}  // namespace braid
