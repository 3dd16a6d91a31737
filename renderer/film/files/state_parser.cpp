// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "renderer/core/plane.h"
#include "renderer/film/files/state_line.h"
#include "renderer/film/files/state_text.h"

namespace braid {

namespace {

constexpr int kMaxSide = 65536;
constexpr size_t kMaxEstimates = 256;

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

void parseEstimate(Line& line, FilmState& state, HistoryImages& images) {
  if (state.estimates.size() == kMaxEstimates) line.fail("too many estimates");
  EstimateState e;
  e.name = line.text();
  e.unbiased = line.flag();
  e.correlation = static_cast<Correlation>(line.integer(0, static_cast<int>(Correlation::Gradients)));
  e.lowDiscrepancy = line.flag();
  e.passesPerRound = line.integer(1, 65536);
  e.seconds = line.seconds();
  const uint64_t rejected = line.count(~uint64_t(0)), clampedSplats = line.count(~uint64_t(0));
  const KeptSquares squares = state.placement ? KeptSquares::Halves : KeptSquares::Together;
  e.sums = Accumulator(0, 0, state.buckets, line.flag(), squares);
  e.sums.setCounts(std::vector<uint64_t>(static_cast<size_t>(state.buckets), 0), rejected, clampedSplats);
  if (line.flag()) e.parts.emplace(0, 0, state.buckets, squares);
  for (const EstimateState& other : state.estimates)
    if (other.name == e.name) line.fail("the estimate " + e.name + " appears twice");
  state.estimates.push_back(std::move(e));
  images.emplace_back();
}

// How many of the passes fall into bucket k of K.
uint64_t passesOfBucket(const std::vector<PassInterval>& passes, uint64_t k, uint64_t buckets) {
  uint64_t n = 0;
  const auto below = [&](uint64_t end) { return (end + buckets - 1 - k) / buckets; };
  for (const PassInterval& i : passes) n += below(i.end) - below(i.begin);
  return n;
}

void parsePasses(Line& line, EstimateState& e) {
  while (!line.done()) {
    const PassInterval i = line.interval();
    if (!e.passes.empty() && i.begin <= e.passes.back().end) line.fail("the intervals of passes are not in order");
    e.passes.push_back(i);
  }
  const int buckets = e.sums.bucketCount();
  for (int k = 0; k < buckets; ++k)
    if (e.sums.passesInBucket(k) != passesOfBucket(e.passes, static_cast<uint64_t>(k), static_cast<uint64_t>(buckets)))
      line.fail("passes and counts disagree");
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

// What a line changes: the state, what its planes will be, and how many of them have been named.
struct Parsed {
  FilmState& state;
  HistoryImages& images;
  std::vector<bool>& counted;  // estimates whose counts are known
  size_t& planes;
  std::vector<PlaneEntry>& table;

  EstimateState& latest(Line& line) {
    if (state.estimates.empty()) line.fail("this word before any estimate");
    return state.estimates.back();
  }
};

void parseIdentity(Line& line, Parsed& p) {
  p.state.identity.version = line.text();
  p.state.identity.build = line.text();
  p.state.identity.isa = line.text();
}

void parseBuckets(Line& line, Parsed& p) {
  p.state.buckets = line.integer(2, 4);
  if (p.state.buckets == 3) line.fail("three buckets");
}

void parseOption(Line& line, Parsed& p) {
  StateOption& option = p.state.identity.options.emplace_back();
  option.name = line.text();
  option.value = line.text();
}

void parseCounts(Line& line, Parsed& p) {
  EstimateState& e = p.latest(line);
  std::vector<uint64_t> counts;
  while (!line.done()) counts.push_back(line.count(kMaxPass));
  if (counts.size() != static_cast<size_t>(e.sums.bucketCount())) line.fail("not one per bucket");
  if (e.parts) e.parts->setCounts(counts);
  e.sums.setCounts(std::move(counts), e.sums.rejected(), e.sums.clampedSplats());
  p.counted.resize(p.state.estimates.size());
  p.counted.back() = true;
}

void parseEstimatePasses(Line& line, Parsed& p) {
  EstimateState& e = p.latest(line);
  if (p.counted.size() != p.state.estimates.size() || !e.passes.empty()) line.fail("passes without counts");
  parsePasses(line, e);
}

void parseCheckpoint(Line& line, Parsed& p) {
  Checkpoint& c = p.latest(line).history.emplace_back();
  c.passes = line.count(kMaxPass);
  c.seconds = line.seconds();
  p.images.back().push_back(!line.done());
  if (!line.done() && line.raw() != "image") line.fail("a checkpoint with more than its image");
}

void parseFeatures(Line& line, Parsed& p) {
  const uint64_t ofA = line.count(kMaxPass), ofB = line.count(kMaxPass);
  p.state.features.emplace(0, 0).setCounts(ofA, ofB);
}

void parseCoverage(Line& line, Parsed& p) { p.state.coverage.emplace(0, 0).setCount(line.count(kMaxPass)); }

void parsePlane(Line& line, Parsed& p) {
  if (p.planes == 0) p.table = planeTable(p.state, p.images);
  const std::string name = line.text(), type = line.raw();
  if (p.planes >= p.table.size() || name != p.table[p.planes].name ||
      type != (p.table[p.planes].sum ? "float64" : "float32"))
    line.fail("the plane '" + name + "' is not expected here");
  ++p.planes;
}

// What the first word of a line says that the rest is.
struct Word {
  const char* word;
  void (*parse)(Line&, Parsed&);
};

constexpr std::array kWords = {
    Word{"braid", parseIdentity},
    Word{"scene", [](Line& line, Parsed& p) { p.state.identity.sceneHash = line.count(~uint64_t(0), 16); }},
    Word{"seed", [](Line& line, Parsed& p) { p.state.seed = line.count(~uint64_t(0)); }},
    Word{"pixels", [](Line& line, Parsed& p) { parseWindow(line, p.state); }},
    Word{"buckets", parseBuckets},
    Word{"seconds", [](Line& line, Parsed& p) { p.state.seconds = line.seconds(); }},
    Word{"option", parseOption},
    Word{"attribute", [](Line& line, Parsed& p) { p.state.attributes.push_back(parseAttribute(line)); }},
    Word{"estimate", [](Line& line, Parsed& p) { parseEstimate(line, p.state, p.images); }},
    Word{"counts", parseCounts},
    Word{"passes", parseEstimatePasses},
    Word{"checkpoint", parseCheckpoint},
    Word{"features", parseFeatures},
    Word{"coverage", parseCoverage},
    Word{"placement",
         [](Line& line, Parsed& p) {
           if (p.state.placement || !p.state.estimates.empty()) line.fail("placement of samples after an estimate");
           p.state.placement.emplace();
         }},
    Word{"plane", parsePlane},
};

void parseLine(Line& line, Parsed parsed) {
  const std::string key = line.raw();
  const auto word = std::find_if(kWords.begin(), kWords.end(), [&](const Word& w) { return key == w.word; });
  if (word == kWords.end()) line.fail("unknown word '" + key + "'");
  word->parse(line, parsed);
  line.end();
}

}  // namespace

void parseStateHeader(const std::string& file, const std::string& text, FilmState& state, HistoryImages& images) {
  size_t number = 1, planes = 0, begin = 0;
  std::vector<bool> counted;
  std::vector<PlaneEntry> table;
  while (begin < text.size()) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    Line line(file, ++number, text.substr(begin, end - begin));
    parseLine(line, {state, images, counted, planes, table});
    begin = end + 1;
  }
  const Line last(file, number, "");
  if (state.placement) {
    if (state.estimates.size() != 1 || state.buckets != 4 || state.coverage || state.estimates[0].sums.keepsBias())
      last.fail("placement of samples with other parts than it has");
    state.placement->width = state.window.width();
    state.placement->height = state.window.height();
  }
  if (state.window.width() <= 0) last.fail("no pixels");
  if (state.estimates.empty()) last.fail("no estimate");
  counted.resize(state.estimates.size());
  for (size_t i = 0; i < counted.size(); ++i)
    if (!counted[i] || state.estimates[i].sums.bucketCount() != state.buckets)
      last.fail("an estimate without its counts");
  if (planes == 0 || planes != planeTable(state, images).size()) last.fail("planes are missing in the table");
}

}  // namespace braid
