// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/compare.h"

#include <cmath>
#include <iostream>
#include <memory>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tools/metrics/identical.h"
#include "tools/metrics/metrics.h"
#include "tools/options/syntax/option_checks.h"

namespace braid {

namespace {

struct Measured {
  const Metric* metric;
  MetricResult result;
};

std::vector<const Metric*> chosenMetrics(const CompareOptions& options) {
  std::vector<const Metric*> chosen;
  std::string known;
  for (const Metric& m : metricRegistry()) {
    known += (known.empty() ? "" : ", ") + std::string(m.name);
    if (options.metrics.empty()) chosen.push_back(&m);
  }
  for (const std::string& name : options.metrics) {
    const Metric* m = findMetric(name);
    if (!m) throw Error(ExitCode::Usage, fmt::format("--metric: unknown metric '{}'; known are {}", name, known));
    chosen.push_back(m);
  }
  return chosen;
}

void checkOptions(const CompareOptions& options, const Metric& first) {
  if (!(options.trimPercent >= 0 && options.trimPercent < 100))
    throw Error(ExitCode::Usage,
                fmt::format("--trim: {} is not a percentage from 0 to below 100", options.trimPercent));
  if (options.max && first.largerIsBetter)
    throw Error(ExitCode::Usage, fmt::format("--max: {} is better when larger; use --min", first.name));
  if (options.min && !first.largerIsBetter)
    throw Error(ExitCode::Usage, fmt::format("--min: {} is better when smaller; use --max", first.name));
}

// An image and where it lies.
struct Placed {
  Rgb<float> image;
  PixelWindow window;
  int fullWidth = 0, fullHeight = 0;
};

std::string text(const PixelWindow& w) { return fmt::format("{},{},{},{}", w.x0, w.y0, w.x1, w.y1); }

// What the windows share of one frame. Formats without windows, and other frames, are compared as they are.
std::optional<PixelWindow> sharedWindow(const CompareOptions& options, const Placed& a, const Placed& b) {
  const bool sameFrame = a.fullWidth == b.fullWidth && a.fullHeight == b.fullHeight;
  const bool sameSize = a.image.width() == b.image.width() && a.image.height() == b.image.height();
  if (a.window == b.window || (!sameFrame && sameSize)) return {};
  if (!sameFrame)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {}x{} pixels, but {} has {}x{}; compare images of one size", options.image,
                            a.image.width(), a.image.height(), options.reference, b.image.width(), b.image.height()));
  const PixelWindow shared{std::max(a.window.x0, b.window.x0), std::max(a.window.y0, b.window.y0),
                           std::min(a.window.x1, b.window.x1), std::min(a.window.y1, b.window.y1)};
  if (shared.width() <= 0 || shared.height() <= 0)
    throw Error(
        ExitCode::BadInput,
        fmt::format("{}: its window {} and the window {} of {} share no pixel of the {}x{} frame", options.image,
                    text(a.window), text(b.window), options.reference, a.fullWidth, a.fullHeight));
  return shared;
}

void cut(Placed& placed, const PixelWindow& window) {
  Rgb<float> part(window.width(), window.height());
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < part.height(); ++y)
      for (int x = 0; x < part.width(); ++x)
        part[c].at(x, y) = placed.image[c].at(x + window.x0 - placed.window.x0, y + window.y0 - placed.window.y0);
  placed.image = std::move(part);
}

// "pt" means "pt.mean", the mean image of that estimate.
Rgb<float> loadLayer(const ImageFile& file, const std::string& layer) {
  const std::string mean = layer + ".mean";
  return file.rgb(!layer.empty() && !hasLayer(file, layer) && hasLayer(file, mean) ? mean : layer);
}

Placed load(const std::string& path, const std::string& layer) {
  const ImageFile file = readImage(path);
  return {loadLayer(file, layer), file.window, file.fullWidth, file.fullHeight};
}

void printText(const std::vector<Measured>& all, std::ostream& out) {
  for (const Measured& m : all) out << fmt::format("{} {:.6g}\n", m.metric->name, m.result.value);
}

// Infinite values are null in JSON; `invalidPixels` or equal images (PSNR) say why.
void printJson(const CompareOptions& options, const Rgb<float>& image, const std::optional<PixelWindow>& window,
               const std::vector<Measured>& all, bool passed, std::ostream& out) {
  nlohmann::ordered_json json;
  json["schema"] = 1;
  json["image"] = options.image;
  json["reference"] = options.reference;
  if (!options.layer.empty()) json["layer"] = options.layer;
  if (!options.referenceLayer.empty()) json["referenceLayer"] = options.referenceLayer;
  json["width"] = image.width();
  json["height"] = image.height();
  if (window) json["window"] = {window->x0, window->y0, window->x1, window->y1};
  json["trimPercent"] = options.trimPercent;
  json["excludedReferencePixels"] = all[0].result.excluded;
  json["invalidPixels"] = all[0].result.invalid;
  for (const Measured& m : all) {
    const double v = m.result.value;
    json["metrics"][m.metric->name] = std::isfinite(v) ? nlohmann::ordered_json(v) : nlohmann::ordered_json();
  }
  if (options.max) json["max"] = *options.max;
  if (options.min) json["min"] = *options.min;
  json["passed"] = passed;
  // File names need not be UTF-8.
  out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
}

int runIdentical(const CompareOptions& options, std::ostream& out, std::ostream& warnings) {
  const std::string difference = firstDifference(readImage(options.image), readImage(options.reference));
  if (difference.empty())
    out << "identical: every channel has the same bits\n";
  else
    warnings << fmt::format("{} and {} differ: {}\n", options.image, options.reference, difference);
  return static_cast<int>(difference.empty() ? ExitCode::Ok : ExitCode::TargetNotReached);
}

void warn(const CompareOptions& options, const Measured& m, const std::string& text, std::ostream& warnings) {
  const MetricResult& r = m.result;
  if (r.excluded > 0)
    warnings << fmt::format("warning: {}: {} pixels are not finite and are left out\n", options.reference, r.excluded);
  if (r.invalid > 0)
    warnings << fmt::format("warning: {}: {} pixels are not finite; the error is infinite\n", options.image, r.invalid);
  if (!text.empty()) warnings << text << "\n";
}

}  // namespace

int runCompare(const CompareOptions& options, std::ostream& out, std::ostream& warnings) {
  if (options.identical) return runIdentical(options, out, warnings);
  const std::vector<const Metric*> chosen = chosenMetrics(options);
  checkOptions(options, *chosen[0]);
  Placed placed = load(options.image, options.layer), by = load(options.reference, options.referenceLayer);
  const std::optional<PixelWindow> window = sharedWindow(options, placed, by);
  if (window) {
    cut(placed, *window);
    cut(by, *window);
    warnings << fmt::format("note: compared in the window {}, which both images hold\n", text(*window));
  }
  const Rgb<float>&image = placed.image, &reference = by.image;
  std::vector<Measured> all;
  for (const Metric* m : chosen) all.push_back({m, evaluate(*m, image, reference, options.trimPercent)});

  const double first = all[0].result.value;
  std::string failure;
  if (options.max && !(first <= *options.max))
    failure = fmt::format("{} {:.6g} is above --max {:.6g}", all[0].metric->name, first, *options.max);
  if (options.min && !(first >= *options.min))
    failure = fmt::format("{} {:.6g} is below --min {:.6g}", all[0].metric->name, first, *options.min);
  if (options.json)
    printJson(options, image, window, all, failure.empty(), out);
  else
    printText(all, out);
  warn(options, all[0], failure, warnings);
  return static_cast<int>(failure.empty() ? ExitCode::Ok : ExitCode::TargetNotReached);
}

void addCompare(CLI::App& app, std::function<int()>& action) {
  CLI::App* sub = app.add_subcommand("compare", "Error metrics of an image against a reference");
  const auto options = std::make_shared<CompareOptions>();
  sub->add_option("image", options->image, "The image to judge (EXR, HDR, PFM, PNG, …)")->required()->type_name("FILE");
  sub->add_option("reference", options->reference, "The image to judge it by, of the same frame")
      ->required()
      ->type_name("FILE");
  sub->add_option("--metric", options->metrics, "Metrics, separated by commas (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAMES");
  sub->add_flag("--json", options->json, "Print one JSON object");
  sub->add_flag("--identical", options->identical,
                "Exit with 6 unless every channel has the same bits, and say where they first differ");
  sub->add_option("--max", options->max, "Exit with 6 when the first metric is above this")
      ->check(number(-kLargeNumber, kLargeNumber));
  sub->add_option("--min", options->min,
                  "Exit with 6 when the first metric, one that is better when larger, is below this")
      ->check(number(-kLargeNumber, kLargeNumber));
  sub->add_option("--trim", options->trimPercent, "Leave out the worst this many percent of the pixels")
      ->check(number(0, 100, Ends::MostExcluded));
  sub->add_option("--layer", options->layer, "Layer of the image, such as pt or pt.halfA (default: R G B)")
      ->type_name("NAME");
  sub->add_option("--reference-layer", options->referenceLayer, "Layer of the reference (default: R G B)")
      ->type_name("NAME");
  std::string footer = "Metrics:\n";
  for (const Metric& m : metricRegistry()) footer += fmt::format("  {:<7} {}\n", m.name, m.description);
  footer +=
      "Examples:\n"
      "  braid compare out.exr reference.exr\n"
      "  braid compare out.exr reference.exr --metric relL2,FLIP --json\n"
      "  braid compare out.exr again.exr --identical\n"
      "  braid compare out.exr reference.exr --layer pt --metric relMSE --trim 0.1 --max 0.01";
  sub->footer(footer);
  sub->callback([options, &action] { action = [options] { return runCompare(*options, std::cout, std::cerr); }; });
}

}  // namespace braid
