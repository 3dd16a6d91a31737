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
  std::string line = fmt::format("attribute {} {}", static_cast<int>(a.kind), escapedWord(a.name));
  switch (a.kind) {
    case Attribute::Kind::String:
      return line + ' ' + escapedWord(a.text);
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

std::string estimateLines(const EstimateState& e) {
  const Accumulator& sums = e.sums;
  std::string text =
      fmt::format("estimate {} {:d} {} {:d} {} {} {} {} {:d} {:d}\ncounts", escapedWord(e.name), e.unbiased,
                  static_cast<int>(e.correlation), e.lowDiscrepancy, e.passesPerRound, e.seconds, sums.rejected(),
                  sums.clampedSplats(), sums.keepsBias(), e.parts.has_value());
  for (int k = 0; k < sums.bucketCount(); ++k) text += fmt::format(" {}", sums.passesInBucket(k));
  text += "\npasses";
  for (const PassInterval& i : e.passes) text += fmt::format(" {}:{}", i.begin, i.end);
  text += '\n';
  for (const Checkpoint& c : e.history)
    text += fmt::format("checkpoint {} {}{}\n", c.passes, c.seconds, c.mean.empty() ? "" : " image");
  return text;
}

}  // namespace

std::vector<PlaneEntry> planeTable(FilmState& state, const HistoryImages& images) {
  std::vector<PlaneEntry> table;
  const auto add = [&](const RawSums& sums) {
    for (const RawSum& s : sums) table.push_back({s.name, s.plane, nullptr, s.tile});
  };
  for (size_t i = 0; i < state.estimates.size(); ++i) {
    EstimateState& e = state.estimates[i];
    add(e.rawSums());
    for (size_t k = 0; k < e.history.size(); ++k)
      for (const HistoryPlane& p : historyPlanes()) {
        if (!images[i][k] && &p != historyPlanes().data()) continue;
        const std::string name = fmt::format("{}.{}{}", e.name, p.name, e.history[k].passes);
        for (size_t c = 0; c < 3; ++c) table.push_back({name + kChannelSuffixes[c], nullptr, &p.of(e.history[k])[c]});
      }
  }
  add(state.sharedSums());
  if (state.placement) {
    RawSums map;
    state.placement->listMap(map);
    add(map);
  }
  return table;
}

std::vector<PlaneEntry> planeTable(const FilmState& state) {
  HistoryImages images;
  for (const EstimateState& e : state.estimates) {
    std::vector<bool>& of = images.emplace_back();
    for (const Checkpoint& c : e.history) of.push_back(!c.mean.empty());
  }
  return planeTable(const_cast<FilmState&>(state), images);  // reads only
}

std::string stateHeader(const FilmState& s) {
  std::string text =
      fmt::format("braid {} {} {}\nscene {}\nseed {}\npixels {} {} {} {} {} {}\nbuckets {}\nseconds {}\n",
                  escapedWord(s.identity.version), escapedWord(s.identity.build), escapedWord(s.identity.isa),
                  hexString(s.identity.sceneHash), s.seed, s.fullWidth, s.fullHeight, s.window.x0, s.window.y0,
                  s.window.x1, s.window.y1, s.buckets, s.seconds);
  for (const StateOption& o : s.identity.options)
    text += fmt::format("option {} {}\n", escapedWord(o.name), escapedWord(o.value));
  for (const Attribute& a : s.attributes) text += attributeLine(a) + '\n';
  if (s.placement) text += "placement\n";
  for (const EstimateState& e : s.estimates) text += estimateLines(e);
  if (s.features) text += fmt::format("features {} {}\n", s.features->passesInHalf(0), s.features->passesInHalf(1));
  if (s.coverage) text += fmt::format("coverage {}\n", s.coverage->passes());
  for (const PlaneEntry& p : planeTable(s))
    text += fmt::format("plane {} {}\n", escapedWord(p.name), p.sum ? "float64" : "float32");
  return text;
}

}  // namespace braid
