// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/state_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/hash.h"
#include "renderer/film/files/state_line.h"
#include "renderer/film/planes.h"

namespace braid {

namespace {

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
      for (const HistoryPlane& p : historyPlanes())
        if (layout.estimates[i].images[k] || &p == historyPlanes().data()) colour(e.name + '.' + p.name + passes, 4);
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

}  // namespace braid
