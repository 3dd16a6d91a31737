// SPDX-License-Identifier: Apache-2.0
// What the rows of a sweep say: convergence curves, gains at equal time, time to equal error, win rates and ranks.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/sweep/table/sweep_table.h"

namespace braid {

// Means over the seeds of one rung; low and high are the extremes over the seeds.
struct LadderPoint {
  double mark = 0, spp = 0, seconds = 0, error = 0, low = 0, high = 0;
};
// In order of seconds.
using Curve = std::vector<LadderPoint>;

Curve curveOf(const SweepTable& table, const std::string& scene, const std::string& method, Ladder ladder,
              size_t column);

// The error after so many seconds, interpolated linearly in log-log, which is exact for power laws; none outside the
// curve.
std::optional<double> errorAtTime(const Curve& curve, double seconds);

// When a curve first reaches an error, interpolated in log-log.
struct TimeToError {
  enum class Kind { Reached, FromTheStart, Never } kind = Kind::Never;
  double seconds = 0;  // Reached: then; FromTheStart: at most; Never: not after so many
};
TimeToError timeToError(const Curve& curve, double error);

// One method on one scene. Ratios are to the baseline; a ratio below 1 is better.
struct MethodSummary {
  std::string scene, method;
  Curve curve;                       // over time
  double equalTime = 0;              // seconds: the longest that every method of the scene was given
  std::optional<double> error;       // at equalTime
  std::optional<double> errorRatio;  // error over the baseline's
  // The baseline's error over the method's at equalTime, a quarter and a sixteenth of it: larger is better.
  std::vector<std::optional<double>> gains;
  TimeToError toBaseline;  // time to the baseline's last error, over the baseline's time
  // Means over the seeds at the last rung, one per column of the table; NaN where there is none.
  std::vector<double> last;
};

struct OverallSummary {
  std::string method;
  std::optional<double> errorRatio, timeRatio;  // geometric means over scenes
  int errorScenes = 0, timeScenes = 0;          // how many scenes these are over
  std::vector<std::optional<double>> gains;     // geometric means
  double score = 0;                             // score-and-sort: mean of n (best) … 1 (worst)
  std::vector<double> winRates;                 // against each method, in order; NaN: no common case
  std::optional<double> betterPixels;           // mean over all rows
};

struct SweepSummary {
  std::string baseline, errorColumn;
  Ladder timeLadder = Ladder::Samples;  // where curves over time come from
  std::vector<std::string> scenes, methods;
  std::vector<MethodSummary> cells;  // scenes × methods
  std::vector<OverallSummary> overall;
  const MethodSummary* find(const std::string& scene, const std::string& method) const;
};

// The ladder to take: the wanted one if any row has it.
Ladder availableLadder(const SweepTable& table, Ladder wanted);

// The column that curves and ratios are about: relL2_unbiased where the first metric is relL2 and it is positive in
// every row, so that the noise of references does not level the curves off; else the first metric.
std::string errorColumnOf(const SweepTable& table);

// The baseline is pt, or the first method where pt is not among them.
SweepSummary summarise(const SweepTable& table, const std::vector<std::string>& scenes,
                       const std::vector<std::string>& methods);

// A table of scenes × methods and one of geometric means, as Markdown.
std::string toMarkdown(const SweepSummary& summary);
nlohmann::ordered_json toJson(const SweepSummary& summary);

// "1.23", "0.00123", "1.2e-07": three digits.
std::string shortNumber(double value);
std::string shortNumber(const std::optional<double>& value);  // none: an en dash
std::string shortRatio(const TimeToError& time);              // "0.25", "< 0.25" or "> 4"

}  // namespace braid
