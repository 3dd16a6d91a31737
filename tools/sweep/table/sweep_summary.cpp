// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/table/sweep_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

namespace braid {

namespace {

// Linear in log-log between two points; linear where a logarithm does not exist.
double interpolate(double x, double x0, double y0, double x1, double y1) {
  if (x1 == x0) return y1;
  if (x0 > 0 && x1 > 0 && y0 > 0 && y1 > 0)
    return y0 * std::exp(std::log(x / x0) / std::log(x1 / x0) * std::log(y1 / y0));
  return y0 + (x - x0) / (x1 - x0) * (y1 - y0);
}

class GeometricMean {
 public:
  void add(const std::optional<double>& v) {
    if (!v || !(*v > 0) || !std::isfinite(*v)) return;
    sum_ += std::log(*v);
    ++count_;
  }
  int count() const { return count_; }
  std::optional<double> value() const {
    if (count_ == 0) return {};
    return std::exp(sum_ / count_);
  }

 private:
  double sum_ = 0;
  int count_ = 0;
};

std::optional<double> ratio(const std::optional<double>& a, const std::optional<double>& b) {
  if (!a || !b || !(*b > 0) || !std::isfinite(*a) || !std::isfinite(*b)) return {};
  return *a / *b;
}

std::vector<double> lastMeans(const SweepTable& table, const std::string& scene, const std::string& method,
                              Ladder ladder, double mark) {
  std::vector<double> sums(table.columns.size(), 0.0);
  double count = 0;
  for (const SweepRow& r : table.rows) {
    if (r.scene != scene || r.method != method || r.ladder != ladder || r.mark != mark) continue;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += r.values[i];
    ++count;
  }
  for (double& s : sums) s = count > 0 ? s / count : std::numeric_limits<double>::quiet_NaN();
  return sums;
}

void compareWithBaseline(const MethodSummary& baseline, MethodSummary& m) {
  m.errorRatio = ratio(m.error, baseline.error);
  for (double part : {1.0, 0.25, 0.0625})
    m.gains.push_back(ratio(errorAtTime(baseline.curve, part * m.equalTime), errorAtTime(m.curve, part * m.equalTime)));
  if (baseline.curve.empty()) return;
  const LadderPoint& end = baseline.curve.back();
  m.toBaseline = timeToError(m.curve, end.error);
  m.toBaseline.seconds /= end.seconds;
}

void summariseScene(const SweepTable& table, const std::string& scene, size_t column, SweepSummary& summary) {
  std::vector<MethodSummary> cells;
  double equalTime = std::numeric_limits<double>::infinity();
  for (const std::string& method : summary.methods) {
    MethodSummary m;
    m.scene = scene;
    m.method = method;
    m.curve = curveOf(table, scene, method, summary.timeLadder, column);
    if (!m.curve.empty()) {
      equalTime = std::min(equalTime, m.curve.back().seconds);
      m.last = lastMeans(table, scene, method, summary.timeLadder, m.curve.back().mark);
    }
    cells.push_back(std::move(m));
  }
  if (!std::isfinite(equalTime)) return;
  for (MethodSummary& m : cells) {
    m.equalTime = equalTime;
    m.error = errorAtTime(m.curve, equalTime);
  }
  const auto base =
      std::find_if(cells.begin(), cells.end(), [&](const MethodSummary& m) { return m.method == summary.baseline; });
  const MethodSummary baseline = *base;
  for (MethodSummary& m : cells) {
    compareWithBaseline(baseline, m);
    if (!m.curve.empty()) summary.cells.push_back(std::move(m));
  }
}

// Mean errors by case (scene, mark, and seed if `perSeed`): one value a method, NaN where there is none.
std::vector<std::vector<double>> casesOf(const SweepTable& table, const SweepSummary& summary, size_t column,
                                         bool perSeed) {
  struct Mean {
    double sum = 0, count = 0;
  };
  std::map<std::tuple<std::string, double, uint64_t>, std::vector<Mean>> cases;
  for (const SweepRow& r : table.rows) {
    const auto method = std::find(summary.methods.begin(), summary.methods.end(), r.method);
    const bool wanted = std::find(summary.scenes.begin(), summary.scenes.end(), r.scene) != summary.scenes.end();
    if (!wanted || method == summary.methods.end() || r.ladder != summary.timeLadder || std::isnan(r.values[column]))
      continue;
    std::vector<Mean>& means = cases[{r.scene, r.mark, perSeed ? r.seed : 0}];
    means.resize(summary.methods.size());
    Mean& m = means[static_cast<size_t>(method - summary.methods.begin())];
    m.sum += r.values[column];
    ++m.count;
  }
  std::vector<std::vector<double>> values;
  for (const auto& [key, means] : cases) {
    values.emplace_back();
    for (const Mean& m : means)
      values.back().push_back(m.count > 0 ? m.sum / m.count : std::numeric_limits<double>::quiet_NaN());
  }
  return values;
}

// Score and sort (tools/README.md, Score and sort): in every case the best of n methods scores n, the worst 1; equal
// errors share.
void rank(const std::vector<std::vector<double>>& cases, SweepSummary& summary) {
  for (const std::vector<double>& errors : cases)
    for (size_t i = 0; i < errors.size(); ++i)
      for (double other : errors) {
        const double mine = std::isnan(errors[i]) ? std::numeric_limits<double>::infinity() : errors[i];
        const double theirs = std::isnan(other) ? std::numeric_limits<double>::infinity() : other;
        summary.overall[i].score += (mine < theirs    ? 1.0
                                     : mine == theirs ? 0.5
                                                      : 0.0) /
                                    static_cast<double>(cases.size());
      }
  // Against itself a method counts 0.5: half a point more makes ranks out of it.
  for (OverallSummary& o : summary.overall) o.score += 0.5;
}

void countWins(const std::vector<std::vector<double>>& cases, SweepSummary& summary) {
  const size_t n = summary.methods.size();
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) {
      double wins = 0, count = 0;
      for (const std::vector<double>& errors : cases) {
        if (std::isnan(errors[i]) || std::isnan(errors[j])) continue;
        wins += errors[i] < errors[j] ? 1.0 : errors[i] == errors[j] ? 0.5 : 0.0;
        ++count;
      }
      summary.overall[i].winRates.push_back(count > 0 ? wins / count : std::numeric_limits<double>::quiet_NaN());
    }
  }
}

std::optional<double> meanBetterPixels(const SweepTable& table, const std::string& method) {
  const size_t column = table.column("better_pixels");
  double sum = 0, count = 0;
  for (const SweepRow& r : table.rows)
    if (r.method == method && !std::isnan(r.values[column])) {
      sum += r.values[column];
      ++count;
    }
  if (count == 0) return {};
  return sum / count;
}

OverallSummary overallOf(const SweepTable& table, const SweepSummary& summary, const std::string& method) {
  OverallSummary o;
  o.method = method;
  GeometricMean errors, times;
  std::vector<GeometricMean> gains(3);
  for (const MethodSummary& m : summary.cells) {
    if (m.method != method) continue;
    errors.add(m.errorRatio);
    if (m.toBaseline.kind == TimeToError::Kind::Reached) times.add(m.toBaseline.seconds);
    for (size_t i = 0; i < gains.size(); ++i) gains[i].add(m.gains[i]);
  }
  o.errorRatio = errors.value();
  o.errorScenes = errors.count();
  o.timeRatio = times.value();
  o.timeScenes = times.count();
  for (const GeometricMean& g : gains) o.gains.push_back(g.value());
  o.betterPixels = meanBetterPixels(table, method);
  return o;
}

}  // namespace

Curve curveOf(const SweepTable& table, const std::string& scene, const std::string& method, Ladder ladder,
              size_t column) {
  std::map<double, std::vector<const SweepRow*>> rungs;
  for (const SweepRow& r : table.rows)
    if (r.scene == scene && r.method == method && r.ladder == ladder && std::isfinite(r.values[column]))
      rungs[r.mark].push_back(&r);
  Curve curve;
  for (const auto& [mark, rows] : rungs) {
    const auto n = static_cast<double>(rows.size());
    LadderPoint p;
    p.mark = mark;
    p.low = p.high = rows[0]->values[column];
    for (const SweepRow* r : rows) {
      const double error = r->values[column];
      p.spp += static_cast<double>(r->spp) / n;
      p.seconds += r->seconds() / n;
      p.error += error / n;
      p.low = std::min(p.low, error);
      p.high = std::max(p.high, error);
    }
    curve.push_back(p);
  }
  std::stable_sort(curve.begin(), curve.end(),
                   [](const LadderPoint& a, const LadderPoint& b) { return a.seconds < b.seconds; });
  return curve;
}

std::optional<double> errorAtTime(const Curve& curve, double seconds) {
  if (curve.empty() || seconds < curve.front().seconds || seconds > curve.back().seconds) return {};
  for (size_t i = 1; i < curve.size(); ++i) {
    const LadderPoint &a = curve[i - 1], &b = curve[i];
    if (seconds <= b.seconds) return interpolate(seconds, a.seconds, a.error, b.seconds, b.error);
  }
  return curve.back().error;
}

TimeToError timeToError(const Curve& curve, double error) {
  using Kind = TimeToError::Kind;
  if (curve.empty()) return {Kind::Never, 0};
  if (curve.front().error < error) return {Kind::FromTheStart, curve.front().seconds};
  for (size_t i = 0; i < curve.size(); ++i) {
    if (curve[i].error > error) continue;
    if (i == 0 || curve[i].error == error) return {Kind::Reached, curve[i].seconds};
    const LadderPoint &a = curve[i - 1], &b = curve[i];
    return {Kind::Reached, interpolate(error, a.error, a.seconds, b.error, b.seconds)};
  }
  return {Kind::Never, curve.back().seconds};
}

const MethodSummary* SweepSummary::find(const std::string& scene, const std::string& method) const {
  for (const MethodSummary& m : cells)
    if (m.scene == scene && m.method == method) return &m;
  return nullptr;
}

Ladder availableLadder(const SweepTable& table, Ladder wanted) {
  const bool has =
      std::any_of(table.rows.begin(), table.rows.end(), [&](const SweepRow& r) { return r.ladder == wanted; });
  return has ? wanted : wanted == Ladder::Time ? Ladder::Samples : Ladder::Time;
}

std::string errorColumnOf(const SweepTable& table) {
  const std::string first = table.columns.front(), unbiased = "relL2_unbiased";
  if (first != "relL2") return first;
  const size_t column = table.column(unbiased);
  const bool positive = std::all_of(table.rows.begin(), table.rows.end(), [&](const SweepRow& r) {
    return r.values[column] > 0 || (std::isnan(r.values[column]) && std::isnan(r.values[0]));
  });
  return positive ? unbiased : first;
}

SweepSummary summarise(const SweepTable& table, const std::vector<std::string>& scenes,
                       const std::vector<std::string>& methods) {
  SweepSummary s;
  s.scenes = scenes;
  s.methods = methods;
  s.baseline = std::find(methods.begin(), methods.end(), "pt") != methods.end() ? "pt" : methods.front();
  s.errorColumn = errorColumnOf(table);
  s.timeLadder = availableLadder(table, Ladder::Time);
  const size_t column = table.column(s.errorColumn);
  for (const std::string& scene : scenes) summariseScene(table, scene, column, s);
  for (const std::string& method : methods) s.overall.push_back(overallOf(table, s, method));
  rank(casesOf(table, s, column, false), s);
  countWins(casesOf(table, s, column, true), s);
  return s;
}

}  // namespace braid
