// SPDX-License-Identifier: Apache-2.0
// The summary of a sweep as Markdown and JSON.
#include <cmath>

#include <fmt/format.h>

#include "tools/sweep/table/sweep_summary.h"

namespace braid {

namespace {

using Json = nlohmann::ordered_json;

Json toNumber(const std::optional<double>& v) { return v && std::isfinite(*v) ? Json(*v) : Json(); }

std::string describeScenes(int count, size_t all) {
  return static_cast<size_t>(count) == all ? "" : fmt::format(" ({} of {} scenes)", count, all);
}

Json curveJson(const Curve& curve) {
  Json list = Json::array();
  for (const LadderPoint& p : curve)
    list.push_back({{"mark", p.mark},
                    {"spp", p.spp},
                    {"seconds", p.seconds},
                    {"error", p.error},
                    {"low", p.low},
                    {"high", p.high}});
  return list;
}

const char* kindName(TimeToError::Kind kind) {
  return kind == TimeToError::Kind::Reached ? "reached"
         : kind == TimeToError::Kind::Never ? "notReached"
                                            : "beforeFirstRung";
}

// Commands may have pipes.
std::string cellText(std::string text) {
  for (size_t at = text.find('|'); at != std::string::npos; at = text.find('|', at + 2)) text.insert(at, "\\");
  return text;
}

}  // namespace

std::string shortNumber(double v) {
  if (std::isnan(v)) return "–";
  return v != 0 && std::fabs(v) < 1e-4 ? fmt::format("{:.2e}", v) : fmt::format("{:.3g}", v);
}

std::string shortNumber(const std::optional<double>& v) { return v ? shortNumber(*v) : "–"; }

std::string shortRatio(const TimeToError& time) {
  if (time.seconds <= 0) return "–";
  const char* relation = time.kind == TimeToError::Kind::Reached ? ""
                         : time.kind == TimeToError::Kind::Never ? "> "
                                                                 : "< ";
  return relation + shortNumber(time.seconds);
}

std::string toMarkdown(const SweepSummary& s) {
  std::string text = fmt::format(
      "Error is {}, mean over seeds. Equal time: the longest that every method of the scene was given, interpolated in "
      "log-log. Ratios are to {}; below 1 is better. The time ratio is the time to {}'s last error over {}'s time.\n\n",
      s.errorColumn, s.baseline, s.baseline, s.baseline);
  text +=
      fmt::format("| scene | method | equal time | error | error ratio | time ratio |\n|---|---|--:|--:|--:|--:|\n");
  for (const MethodSummary& m : s.cells)
    text += fmt::format("| {} | {} | {} s | {} | {} | {} |\n", m.scene, cellText(m.method), shortNumber(m.equalTime),
                        shortNumber(m.error), shortNumber(m.errorRatio), shortRatio(m.toBaseline));
  text += "\nGeometric means over scenes; score: mean of n (best of n) to 1 (worst) over scenes and rungs.\n\n";
  text += "| method | error ratio | time ratio | score |\n|---|--:|--:|--:|\n";
  for (const OverallSummary& o : s.overall)
    text += fmt::format("| {} | {}{} | {}{} | {:.2f} |\n", cellText(o.method), shortNumber(o.errorRatio),
                        describeScenes(o.errorScenes, s.scenes.size()), shortNumber(o.timeRatio),
                        describeScenes(o.timeScenes, s.scenes.size()), o.score);
  return text;
}

nlohmann::ordered_json toJson(const SweepSummary& s) {
  Json json;
  json["baseline"] = s.baseline;
  json["error"] = s.errorColumn;
  json["ladder"] = toString(s.timeLadder);
  json["cells"] = Json::array();
  for (const MethodSummary& m : s.cells) {
    Json gains = Json::array();
    for (const auto& g : m.gains) gains.push_back(toNumber(g));
    json["cells"].push_back({{"scene", m.scene},
                             {"method", m.method},
                             {"equalTime", m.equalTime},
                             {"error", toNumber(m.error)},
                             {"errorRatio", toNumber(m.errorRatio)},
                             {"gains", gains},
                             {"timeRatio", toNumber(m.toBaseline.seconds)},
                             {"timeRatioIs", kindName(m.toBaseline.kind)},
                             {"curve", curveJson(m.curve)}});
  }
  json["overall"] = Json::array();
  for (const OverallSummary& o : s.overall) {
    Json wins = Json::object();
    for (size_t i = 0; i < o.winRates.size(); ++i) wins[s.methods[i]] = toNumber(o.winRates[i]);
    json["overall"].push_back({{"method", o.method},
                               {"errorRatio", toNumber(o.errorRatio)},
                               {"errorScenes", o.errorScenes},
                               {"timeRatio", toNumber(o.timeRatio)},
                               {"timeScenes", o.timeScenes},
                               {"score", o.score},
                               {"winRates", wins},
                               {"betterPixels", toNumber(o.betterPixels)}});
  }
  return json;
}

}  // namespace braid
