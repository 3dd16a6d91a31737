// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/state_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/core/plane.h"

namespace braid {

namespace {

constexpr int kMaxSide = 65536;
constexpr size_t kMaxEstimates = 256;

// A word without spaces; the empty one is "%".
std::string escaped(const std::string& text) {
  if (text.empty()) return "%";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte <= 0x20 || byte == '%' || byte == 0x7f)
      out += fmt::format("%{:02x}", byte);
    else
      out += c;
  }
  return out;
}

// The words of one line, taken one after the other; every failure names the line.
class Line {
 public:
  Line(const std::string& file, size_t number, const std::string& text) : file_(file), number_(number) {
    size_t begin = 0;
    while (begin <= text.size()) {
      const size_t end = std::min(text.find(' ', begin), text.size());
      words_.push_back(text.substr(begin, end - begin));
      begin = end + 1;
    }
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: header line {}: {}: use another copy, or render again", file_, number_, what));
  }
  bool done() const { return next_ == words_.size(); }
  size_t left() const { return words_.size() - next_; }
  void end() const {
    if (!done()) fail(fmt::format("'{}' is more than expected", words_[next_]));
  }
  const std::string& raw() {
    if (done()) fail("ends too early");
    return words_[next_++];
  }
  std::string text() {
    const std::string& word = raw();
    if (word == "%") return {};
    std::string out;
    for (size_t i = 0; i < word.size(); ++i) {
      if (word[i] != '%') {
        out += word[i];
        continue;
      }
      unsigned byte = 0;
      const char* at = word.data() + i + 1;
      if (i + 2 >= word.size() || std::from_chars(at, at + 2, byte, 16).ptr != at + 2)
        fail("a broken escape in '" + word + "'");
      out += static_cast<char>(byte);
      i += 2;
    }
    return out;
  }
  uint64_t count(uint64_t most, int base = 10) { return parsed(raw(), most, base); }
  int integer(int least, int most) {
    const std::string& word = raw();
    int value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || value < least || value > most)
      fail(fmt::format("'{}' is not a number from {} to {}", word, least, most));
    return value;
  }
  bool flag() { return integer(0, 1) == 1; }
  double number() {
    const std::string& word = raw();
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != 0) fail(fmt::format("'{}' is not a number", word));
    return value;
  }
  double seconds() {
    const double value = number();
    if (!(value >= 0) || !std::isfinite(value)) fail("seconds are negative or not finite");
    return value;
  }
  PassInterval interval() {
    const std::string& word = raw();
    const size_t colon = word.find(':');
    if (colon == std::string::npos) fail(fmt::format("'{}' is not BEGIN:END", word));
    const PassInterval i{parsed(word.substr(0, colon), kMaxPass, 10), parsed(word.substr(colon + 1), kMaxPass, 10)};
    if (i.begin >= i.end) fail(fmt::format("the passes {} are none", word));
    return i;
  }

 private:
  uint64_t parsed(const std::string& word, uint64_t most, int base) const {
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value, base);
    if (error != std::errc() || end != word.data() + word.size() || value > most)
      fail(fmt::format("'{}' is not a number of at most {}", word, most));
    return value;
  }

  const std::string& file_;
  size_t number_;
  std::vector<std::string> words_;
  size_t next_ = 0;
};

std::string attributeLine(const Attribute& a) {
  std::string line = fmt::format("attribute {} {}", static_cast<int>(a.kind), escaped(a.name));
  switch (a.kind) {
    case Attribute::Kind::String:
      return line + ' ' + escaped(a.text);
    case Attribute::Kind::Int:
      return line + fmt::format(" {}", static_cast<uint64_t>(a.integer));
    case Attribute::Kind::Float:
      return line + fmt::format(" {}", a.number);
    case Attribute::Kind::Matrix:
    case Attribute::Kind::Chromaticities:
      break;
  }
  return fmt::format("{} {}", line, fmt::join(a.values, " "));
}

Attribute parseAttribute(Line& line) {
  Attribute a;
  a.kind = static_cast<Attribute::Kind>(line.integer(0, static_cast<int>(Attribute::Kind::Chromaticities)));
  a.name = line.text();
  if (a.kind == Attribute::Kind::String) a.text = line.text();
  if (a.kind == Attribute::Kind::Int) a.integer = static_cast<int64_t>(line.count(~uint64_t(0)));
  if (a.kind == Attribute::Kind::Float) a.number = line.number();
  const size_t values = a.kind == Attribute::Kind::Matrix ? 16 : a.kind == Attribute::Kind::Chromaticities ? 8 : 0;
  for (size_t i = 0; i < values; ++i) a.values.push_back(static_cast<float>(line.number()));
  return a;
}

std::string estimateLines(const EstimateState& e, const EstimateLayout& layout) {
  std::string text =
      fmt::format("estimate {} {:d} {} {:d} {} {} {} {} {:d} {:d}\ncounts {}\npasses", escaped(e.name), e.unbiased,
                  static_cast<int>(e.correlation), e.lowDiscrepancy, e.passesPerRound, e.seconds, layout.rejected,
                  layout.clampedSplats, layout.bias, layout.parts, fmt::join(layout.counts, " "));
  for (const PassInterval& i : e.passes) text += fmt::format(" {}:{}", i.begin, i.end);
  text += '\n';
  for (const Checkpoint& c : e.history)
    text += fmt::format("checkpoint {} {}{}\n", c.passes, c.seconds, c.mean.empty() ? "" : " image");
  return text;
}

void parseEstimate(Line& line, FilmState& state, StateLayout& layout) {
  if (state.estimates.size() == kMaxEstimates) line.fail("too many estimates");
  EstimateState e;
  EstimateLayout l;
  e.name = line.text();
  e.unbiased = line.flag();
  e.correlation = static_cast<Correlation>(line.integer(0, static_cast<int>(Correlation::Gradients)));
  e.lowDiscrepancy = line.flag();
  e.passesPerRound = line.integer(1, 65536);
  e.seconds = line.seconds();
  l.rejected = line.count(~uint64_t(0));
  l.clampedSplats = line.count(~uint64_t(0));
  l.bias = line.flag();
  l.parts = line.flag();
  for (const EstimateState& other : state.estimates)
    if (other.name == e.name) line.fail("the estimate " + e.name + " appears twice");
  state.estimates.push_back(std::move(e));
  layout.estimates.push_back(std::move(l));
}

// How many of the passes fall into bucket k of K.
uint64_t passesOfBucket(const std::vector<PassInterval>& passes, uint64_t k, uint64_t buckets) {
  uint64_t n = 0;
  const auto below = [&](uint64_t end) { return (end + buckets - 1 - k) / buckets; };
  for (const PassInterval& i : passes) n += below(i.end) - below(i.begin);
  return n;
}

void parsePasses(Line& line, EstimateState& e, const EstimateLayout& l) {
  while (!line.done()) {
    const PassInterval i = line.interval();
    if (!e.passes.empty() && i.begin <= e.passes.back().end) line.fail("the intervals of passes are not in order");
    e.passes.push_back(i);
  }
  for (size_t k = 0; k < l.counts.size(); ++k)
    if (l.counts[k] != passesOfBucket(e.passes, k, l.counts.size())) line.fail("passes and counts disagree");
}

void parseWindow(Line& line, FilmState& state) {
  state.fullWidth = line.integer(1, kMaxSide);
  state.fullHeight = line.integer(1, kMaxSide);
  PixelWindow& w = state.window;
  w.x0 = line.integer(0, state.fullWidth - 1);
  w.y0 = line.integer(0, state.fullHeight - 1);
  w.x1 = line.integer(w.x0 + 1, state.fullWidth);
  w.y1 = line.integer(w.y0 + 1, state.fullHeight);
  if (static_cast<int64_t>(w.width()) * w.height() > kMaxPixels) line.fail("more than 268 million pixels");
}

void parseLine(Line& line, FilmState& state, StateLayout& layout, size_t& planes, std::vector<PlaneEntry>& table) {
  const std::string key = line.raw();
  const auto latest = [&]() -> EstimateState& {
    if (state.estimates.empty()) line.fail("'" + key + "' before any estimate");
    return state.estimates.back();
  };
  if (key == "braid") {
    state.identity.version = line.text();
    state.identity.build = line.text();
    state.identity.isa = line.text();
  } else if (key == "scene") {
    state.identity.sceneHash = line.count(~uint64_t(0), 16);
  } else if (key == "seed") {
    state.seed = line.count(~uint64_t(0));
  } else if (key == "pixels") {
    parseWindow(line, state);
  } else if (key == "buckets") {
    state.buckets = line.integer(2, 4);
    if (state.buckets == 3) line.fail("three buckets");
  } else if (key == "seconds") {
    state.seconds = line.seconds();
  } else if (key == "option") {
    StateOption& option = state.identity.options.emplace_back();
    option.name = line.text();
    option.value = line.text();
  } else if (key == "attribute") {
    state.attributes.push_back(parseAttribute(line));
  } else if (key == "estimate") {
    parseEstimate(line, state, layout);
  } else if (key == "counts") {
    latest();
    layout.estimates.back().counts.clear();
    while (!line.done()) layout.estimates.back().counts.push_back(line.count(kMaxPass));
    if (layout.estimates.back().counts.size() != static_cast<size_t>(state.buckets)) line.fail("not one per bucket");
  } else if (key == "passes") {
    EstimateState& e = latest();
    if (layout.estimates.back().counts.empty() || !e.passes.empty()) line.fail("passes without counts");
    parsePasses(line, e, layout.estimates.back());
  } else if (key == "checkpoint") {
    Checkpoint& c = latest().history.emplace_back();
    c.passes = line.count(kMaxPass);
    c.seconds = line.seconds();
    layout.estimates.back().images.push_back(!line.done());
    if (!line.done() && line.raw() != "image") line.fail("a checkpoint with more than its image");
  } else if (key == "features") {
    layout.features = true;
    for (uint64_t& n : layout.featurePasses) n = line.count(kMaxPass);
  } else if (key == "coverage") {
    layout.coverage = true;
    layout.coveragePasses = line.count(kMaxPass);
  } else if (key == "plane") {
    if (planes == 0) table = planeTable(state, layout);
    const std::string name = line.text(), type = line.raw();
    if (planes >= table.size() || name != table[planes].name ||
        type != (table[planes].bytesPerValue == 8 ? "float64" : "float32"))
      line.fail("the plane '" + name + "' is not expected here");
    ++planes;
  } else {
    line.fail("unknown word '" + key + "'");
  }
  line.end();
}

}  // namespace

StateLayout layoutOf(const FilmState& state) {
  StateLayout layout;
  for (const EstimateState& e : state.estimates) {
    EstimateLayout l;
    for (int k = 0; k < e.sums.bucketCount(); ++k) l.counts.push_back(e.sums.passesInBucket(k));
    l.rejected = e.sums.rejected();
    l.clampedSplats = e.sums.clampedSplats();
    l.bias = e.sums.keepsBias();
    l.parts = e.parts.has_value();
    for (const Checkpoint& c : e.history) l.images.push_back(!c.mean.empty());
    layout.estimates.push_back(std::move(l));
  }
  layout.features = state.features.has_value();
  layout.coverage = state.coverage.has_value();
  if (state.features) layout.featurePasses = {state.features->passesInHalf(0), state.features->passesInHalf(1)};
  if (state.coverage) layout.coveragePasses = state.coverage->passes();
  return layout;
}

std::vector<PlaneEntry> planeTable(const FilmState& state, const StateLayout& layout) {
  std::vector<PlaneEntry> table;
  const auto colour = [&](const std::string& layer, size_t bytes) {
    for (const char* c : {"R", "G", "B"}) table.push_back({layer + '.' + c, bytes});
  };
  for (size_t i = 0; i < state.estimates.size(); ++i) {
    const EstimateState& e = state.estimates[i];
    for (int k = 0; k < state.buckets; ++k) colour(fmt::format("{}.sum{}", e.name, k), 8);
    colour(e.name + ".squares", 8);
    if (layout.estimates[i].bias) {
      for (const char* half : {"A", "B"}) colour(e.name + ".bias" + half, 8);
      colour(e.name + ".biasSquares", 8);
    }
    if (layout.estimates[i].parts) {
      for (int k = 0; k < state.buckets; ++k) colour(fmt::format("{}.direct{}", e.name, k), 8);
      colour(e.name + ".directSquares", 8);
      colour(e.name + ".indirectSquares", 8);
    }
    for (size_t k = 0; k < e.history.size(); ++k) {
      const std::string passes = std::to_string(e.history[k].passes);
      colour(e.name + ".variance" + passes, 4);
      if (layout.estimates[i].images[k])
        for (const char* part : {".mean", ".halfA", ".halfB"}) colour(e.name + part + passes, 4);
    }
  }
  if (layout.features)
    for (const char* part : {"sumA", "sumB", "squares"})
      for (int c = 0; c < FeatureSample::kComponents; ++c) table.push_back({fmt::format("features.{}{}", part, c), 8});
  if (layout.coverage) table.push_back({"coverage", 8});
  return table;
}

std::string stateHeader(const FilmState& s) {
  const StateLayout layout = layoutOf(s);
  std::string text = fmt::format(
      "braid {} {} {}\nscene {}\nseed {}\npixels {} {} {} {} {} {}\nbuckets {}\nseconds {}\n",
      escaped(s.identity.version), escaped(s.identity.build), escaped(s.identity.isa), hexString(s.identity.sceneHash),
      s.seed, s.fullWidth, s.fullHeight, s.window.x0, s.window.y0, s.window.x1, s.window.y1, s.buckets, s.seconds);
  for (const StateOption& o : s.identity.options)
    text += fmt::format("option {} {}\n", escaped(o.name), escaped(o.value));
  for (const Attribute& a : s.attributes) text += attributeLine(a) + '\n';
  for (size_t i = 0; i < s.estimates.size(); ++i) text += estimateLines(s.estimates[i], layout.estimates[i]);
  if (layout.features) text += fmt::format("features {} {}\n", layout.featurePasses[0], layout.featurePasses[1]);
  if (layout.coverage) text += fmt::format("coverage {}\n", layout.coveragePasses);
  for (const PlaneEntry& p : planeTable(s, layout))
    text += fmt::format("plane {} {}\n", escaped(p.name), p.bytesPerValue == 8 ? "float64" : "float32");
  return text;
}

void parseStateHeader(const std::string& file, const std::string& text, FilmState& state, StateLayout& layout) {
  size_t number = 1, planes = 0, begin = 0;
  std::vector<PlaneEntry> table;
  while (begin < text.size()) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    Line line(file, ++number, text.substr(begin, end - begin));
    parseLine(line, state, layout, planes, table);
    begin = end + 1;
  }
  const Line last(file, number, "");
  if (state.window.width() <= 0) last.fail("no pixels");
  if (state.estimates.empty()) last.fail("no estimate");
  for (const EstimateLayout& l : layout.estimates)
    if (l.counts.size() != static_cast<size_t>(state.buckets)) last.fail("an estimate without its counts");
  if (planes == 0 || planes != planeTable(state, layout).size()) last.fail("planes are missing in the table");
}

}  // namespace braid
