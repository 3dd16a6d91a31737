// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/html.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "tools/sweep/report/page_text.h"
#include "tools/sweep/report/pictures.h"

namespace braid {

namespace {

std::string cell(const std::string& text, bool best = false) {
  return fmt::format("<td{}>{}</td>", best ? " class=best" : "", escaped(text));
}

std::string headerRow(const std::vector<std::string>& names) {
  std::string row = "<tr>";
  for (const std::string& n : names) row += "<th>" + escaped(n) + "</th>";
  return row + "</tr>\n";
}

// Overall: ratios, gains at three times (those that the ladder reaches down to), score, pixels better than the input.
std::string overallTable(const SweepSummary& s) {
  const std::array<const char*, 3> times{"gain at T", "gain at T/4", "gain at T/16"};
  const auto known = [&](size_t time) {
    return std::any_of(s.overall.begin(), s.overall.end(), [&](const auto& o) { return o.gains[time].has_value(); });
  };
  std::vector<std::string> names{"method", "error ratio", "time ratio"};
  for (size_t time = 0; time < times.size(); ++time)
    if (known(time)) names.push_back(times[time]);
  names.insert(names.end(), {"score", "better pixels"});
  std::string t = "<table>\n" + headerRow(names);
  for (const OverallSummary& o : s.overall) {
    const auto counted = [&](const std::optional<double>& v, int n) {
      const bool all = static_cast<size_t>(n) == s.scenes.size() || !v;
      return shortNumber(v) + (all ? "" : fmt::format(" ({} of {} scenes)", n, s.scenes.size()));
    };
    t +=
        "<tr>" + cell(o.method) + cell(counted(o.errorRatio, o.errorScenes)) + cell(counted(o.timeRatio, o.timeScenes));
    for (size_t time = 0; time < times.size(); ++time)
      if (known(time)) t += cell(shortNumber(o.gains[time]));
    t += cell(fmt::format("{:.2f}", o.score));
    t += cell(o.betterPixels ? fmt::format("{:.1f} %", 100 * *o.betterPixels) : "–") + "</tr>\n";
  }
  return t + "</table>\n";
}

std::string winTable(const SweepSummary& s) {
  if (s.methods.size() < 2) return {};
  std::vector<std::string> names{"wins of … against"};
  names.insert(names.end(), s.methods.begin(), s.methods.end());
  std::string t = "<div class=wide><table>\n" + headerRow(names);
  for (size_t i = 0; i < s.methods.size(); ++i) {
    t += "<tr>" + cell(s.methods[i]);
    for (size_t j = 0; j < s.methods.size(); ++j) {
      const double rate = s.overall[i].winRates[j];
      t += cell(i == j || std::isnan(rate) ? "–" : fmt::format("{:.0f} %", 100 * rate), i != j && rate > 0.5);
    }
    t += "</tr>\n";
  }
  return t + "</table></div>\n";
}

// Equal time first, then every column of the CSV at the last rung.
std::string sceneTable(const std::string& scene, const SweepTable& table, const SweepSummary& s) {
  std::vector<const MethodSummary*> rows;
  for (const std::string& method : s.methods)
    if (const MethodSummary* m = s.find(scene, method)) rows.push_back(m);
  if (rows.empty()) return {};
  std::vector<std::string> names{
      "method",      fmt::format("{} at {} s", s.errorColumn, shortNumber(rows[0]->equalTime)),
      "error ratio", "time ratio",
      "spp",         "seconds"};
  names.insert(names.end(), table.columns.begin(), table.columns.end());
  std::string t = "<div class=wide><table>\n" + headerRow(names);
  for (const MethodSummary* m : rows) {
    const bool best = m->error && std::none_of(rows.begin(), rows.end(), [&](const MethodSummary* o) {
                        return o->error && *o->error < *m->error;
                      });
    t += "<tr>" + cell(m->method) + cell(shortNumber(m->error), best) + cell(shortNumber(m->errorRatio)) +
         cell(shortRatio(m->toBaseline)) + cell(fmt::format("{:.0f}", m->curve.back().spp)) +
         cell(shortNumber(m->curve.back().seconds));
    for (double v : m->last) t += cell(shortNumber(v));
    t += "</tr>\n";
  }
  return t + "</table></div>\n";
}

constexpr int kOverviewWidth = 640, kSmallestCrop = 16, kLargestCrop = 96;
// The scale of false-colour errors: relL2 of single pixels.
constexpr double kLowestError = 1e-4, kHighestError = 1;

// Per-pixel relative squared error, the metric relL2 before it is averaged; 0 where the reference is not finite.
Plane<double> pixelErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  Plane<double> errors(image.width(), image.height());
  for (size_t i = 0; i < errors.size(); ++i) {
    const Vec3 r = reference.pixel(i), d = image.pixel(i) - r;
    if (!isFinite(r)) continue;
    const double level = static_cast<double>(average(r));
    errors[i] = isFinite(d) ? static_cast<double>(average(d * d)) / (level * level + 0.01) : kHighestError;
  }
  return errors;
}

std::string pictureTag(const Picture& p, const std::string& caption, const char* kind) {
  return fmt::format(
      "<figure class={}><img src=\"{}\" width={} height={} alt=\"{}\"><figcaption>{}</figcaption></figure>", kind,
      dataUri(p), p.width, p.height, escaped(caption), escaped(caption));
}

// Two pictures on top of each other; the script shows the one up to the slider and the other beyond.
std::string sliderTag(const std::vector<std::pair<std::string, std::string>>& pictures, int width, int height) {
  std::string options, images;
  for (const auto& [name, uri] : pictures) {
    options += "<option>" + escaped(name) + "</option>";
    images += fmt::format("<img hidden data-name=\"{}\" src=\"{}\" alt=\"\">", escaped(name), uri);
  }
  return fmt::format(
      "<div class=split data-w={} data-h={}><div class=controls><select>{}</select>"
      "<input type=range min=0 max=100 value=50 aria-label=\"split\"><select>{}</select></div>"
      "<div class=stage><img alt=\"\"><img alt=\"\"><i></i></div>{}</div>\n",
      width, height, options, options, images);
}

// Large enough to see single pixels.
Picture enlarged(const Picture& p, int factor) {
  Picture out{p.width * factor, p.height * factor, {}};
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x)
      for (int c = 0; c < 3; ++c)
        out.rgb.push_back(p.rgb[3 * static_cast<size_t>(y / factor * p.width + x / factor) + static_cast<size_t>(c)]);
  return out;
}

std::string pictures(const ReportScene& scene) {
  const float exposure = exposureOf(scene.reference);
  const Rgb<float> small = shrunk(scene.reference, kOverviewWidth);
  std::vector<std::pair<std::string, std::string>> slider;
  std::string errors, crops, errorCrops;
  PixelWindow window;
  int factor = 1;
  for (size_t i = 0; i < scene.images.size(); ++i) {
    const auto& [method, image] = scene.images[i];
    const Plane<double> e = pixelErrors(image, scene.reference);
    if (i == 0) {
      window = worstWindow(e, std::clamp(e.width / 4, kSmallestCrop, kLargestCrop));
      factor = std::max(1, 192 / std::max(window.width(), window.height()));
    }
    slider.emplace_back(method, dataUri(toneMapped(shrunk(image, kOverviewWidth), exposure)));
    errors += pictureTag(falseColour(shrunk(e, kOverviewWidth / 2), kLowestError, kHighestError), method, "map");
    crops += pictureTag(enlarged(toneMapped(cropped(image, window), exposure), factor), method, "crop");
    errorCrops += pictureTag(enlarged(falseColour(cropped(e, window), kLowestError, kHighestError), factor),
                             method + " error", "crop");
  }
  if (scene.images.empty()) return {};
  slider.emplace_back("reference", dataUri(toneMapped(small, exposure)));
  crops += pictureTag(enlarged(toneMapped(cropped(scene.reference, window), exposure), factor), "reference", "crop");
  const std::string scale = fmt::format("<p class=scale>{:g} <img src=\"{}\" alt=\"\"> {:g}</p>", kLowestError,
                                        dataUri(colourBar(200, 12)), kHighestError);
  return fmt::format(
      "<h3>Images at the last rung, first seed</h3>{}<h3>Crop at {},{}: where the first method errs most</h3>"
      "<div class=row>{}</div><div class=row>{}</div><h3>Relative squared error of pixels</h3>{}<div "
      "class=row>{}</div>\n",
      sliderTag(slider, small.width(), small.height()), window.x0, window.y0, crops, errorCrops, scale, errors);
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

std::string sceneSection(const ReportScene& scene, const SweepTable& table, const SweepSummary& summary) {
  std::string plots;
  for (const std::string& svg : scene.plots)
    plots += "<img class=plot alt=\"convergence\" src=\"data:image/svg+xml;base64," + base64(svg) + "\">";
  return fmt::format("<section><h2>{}</h2>\n{}<div class=row>{}</div>\n{}</section>\n", escaped(scene.name),
                     sceneTable(scene.name, table, summary), plots, pictures(scene));
}

std::string reportPage(const SweepSummary& summary, const std::vector<std::pair<std::string, std::string>>& available,
                       const std::vector<std::string>& sections) {
  std::string body;
  for (const auto& [name, value] : available)
    body += fmt::format("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value));
  body =
      "<h1>braid sweep</h1>\n<dl>" + body + "</dl>\n<h2>All scenes</h2>\n" +
      fmt::format(
          "<p>Error is {}, mean over seeds; T is the longest time that every method of a scene was given, and "
          "curves are interpolated in log-log. Ratios are to {} (below 1 is better), gains are its error over "
          "the method's (above 1 is better); both are geometric means over scenes. The time ratio is the time "
          "to {}'s last error over {}'s time. Score: in every case (scene, rung) the best of {} methods gets "
          "{}, the worst 1. Better pixels: share of pixels with a smaller squared error than the method's own "
          "unbiased input.</p>\n",
          escaped(summary.errorColumn), escaped(summary.baseline), escaped(summary.baseline), escaped(summary.baseline),
          summary.methods.size(), summary.methods.size()) +
      overallTable(summary) +
      fmt::format("<p>Win rates: cases (scene, rung of the {} ladder, seed) in which the row's error is smaller.</p>\n",
                  toString(summary.timeLadder)) +
      winTable(summary);
  for (const std::string& s : sections) body += s;
  return std::string(kPageHead) + body + kPageTail;
}

}  // namespace braid
