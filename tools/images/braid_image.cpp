// SPDX-License-Identifier: Apache-2.0
#include "tools/images/braid_image.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <set>

#include "renderer/film/make_attribute.h"
#include "renderer/film/planes.h"
#include "tools/images/estimates_file.h"
#include "tools/images/foreign_image.h"

namespace braid {

namespace {

const char* toString(Correlation c) {
  return c == Correlation::Independent ? "independent"
         : c == Correlation::Gradients ? "gradients"
                                       : "common random numbers";
}

// Integers beyond 32 bits are kept as text.
int64_t integerOr(const ImageFile& file, const std::string& name, int64_t fallback) {
  const Attribute* a = findAttribute(file, name);
  if (!a) return fallback;
  return a->kind == Attribute::Kind::String ? std::atoll(a->text.c_str()) : a->integer;
}

Rgb<float> layerOrNone(const ImageFile& file, const std::string& layer) {
  return hasLayer(file, layer) ? file.rgb(layer) : Rgb<float>();
}

// The passes N of the layers <layer>.varianceN, in rising order.
std::set<uint64_t> checkpointPasses(const ImageFile& file, const std::string& layer) {
  const std::string prefix = layer + ".variance", suffix = ".R";
  std::set<uint64_t> passes;
  for (const auto& [channel, plane] : file.planes) {
    if (!channel.starts_with(prefix) || !channel.ends_with(suffix)) continue;
    const char *begin = channel.data() + prefix.size(), *end = channel.data() + channel.size() - suffix.size();
    uint64_t n = 0;
    if (begin < end && std::from_chars(begin, end, n).ptr == end && n > 0) passes.insert(n);
  }
  return passes;
}

// The variances after 1, 2, 4, … passes, from layers <name>.variance<passes>, and the images where there are some.
std::vector<Checkpoint> readHistory(const ImageFile& file, const std::string& layer, double secondsPerPass) {
  std::vector<Checkpoint> history;
  for (const uint64_t passes : checkpointPasses(file, layer)) {
    Checkpoint c{passes, secondsPerPass * static_cast<double>(passes), {}};
    for (const HistoryPlane& p : historyPlanes())
      p.of(c) = layerOrNone(file, layer + '.' + p.name + std::to_string(passes));
    if (c.variance.empty()) continue;
    history.push_back(std::move(c));
  }
  return history;
}

bool isComplete(const DirectLight& p) {
  return !p.mean.empty() && !p.half[0].empty() && !p.half[1].empty() && !p.variance.empty();
}

Estimate readEstimate(const ImageFile& file, const std::string& layer, const std::string& name) {
  Estimate e;
  e.name = name;
  for (const EstimatePlane& p : estimatePlanes()) p.of(e) = layerOrNone(file, layer + '.' + p.name);
  e.mean = file.rgb(layer + ".mean");
  if (!isComplete(e.direct) || e.indirectVariance.empty()) {
    e.direct = {};
    e.indirectVariance = {};
  }
  for (size_t q = 0; q < 4; ++q)
    if (const std::string quarter = layer + '.' + quarterName(q); hasLayer(file, quarter))
      e.quarter.push_back(file.rgb(quarter));
  const std::string prefix = "braid/" + name + "/";
  const auto samples = file.planes.find(layer.substr(0, layer.size() - name.size()) + "SampleCount.Y");
  if (samples != file.planes.end()) e.samples = samples->second;
  e.unbiased = integerOr(file, prefix + "unbiased", 1) != 0;
  e.passes = static_cast<uint64_t>(std::max<int64_t>(0, integerOr(file, prefix + "passes", 0)));
  if (const Attribute* seconds = findAttribute(file, prefix + "seconds")) e.seconds = seconds->number;
  if (const Attribute* correlation = findAttribute(file, prefix + "correlation"))
    for (const Correlation c : {Correlation::CommonRandomNumbers, Correlation::Gradients})
      if (correlation->text == toString(c)) e.correlation = c;
  return e;
}

Features readFeatures(const ImageFile& file, const std::string& prefix) {
  Features features;
  for (size_t f = 0; f < kFeaturePlanes.size(); ++f)
    for (size_t part = 0; part < kFeatureParts.size(); ++part) {
      Rgb<float> planes = layerOrNone(file, prefix + kFeaturePlanes[f].layer + kFeatureParts[part]);
      for (size_t c = 0; c < kFeaturePlanes[f].components.size(); ++c)
        featurePlane(features, f, part, c) = std::move(planes[c]);
    }
  return features;
}

}  // namespace

const Attribute* findAttribute(const ImageFile& file, const std::string& name) {
  for (const Attribute& a : file.attributes)
    if (a.name == name) return &a;
  return nullptr;
}

Estimates emptyLike(const ImageFile& file) {
  Estimates all;
  all.width = file.width;
  all.height = file.height;
  all.window = file.window;
  all.fullWidth = file.fullWidth;
  all.fullHeight = file.fullHeight;
  return all;
}

// "<prefix>pt" for every layer "<prefix>pt.mean".
std::vector<std::string> estimateNames(const ImageFile& file) {
  std::vector<std::string> names;
  const std::string ending = ".mean.R";
  for (const std::string& channel : file.channelNames)
    if (channel.size() > ending.size() && channel.ends_with(ending))
      names.push_back(channel.substr(0, channel.size() - ending.size()));
  return names;
}

Estimates readBraidImage(const ImageFile& file, const std::vector<std::string>& layers) {
  Estimates all = emptyLike(file);
  all.seed = static_cast<uint64_t>(integerOr(file, "braid/seed", 0));
  std::string prefix;
  for (const std::string& layer : layers) {
    const size_t dot = layer.rfind('.');
    if (dot != std::string::npos) prefix = layer.substr(0, dot + 1);
    const Estimate e = readEstimate(file, layer, dot == std::string::npos ? layer : layer.substr(dot + 1));
    const double secondsPerPass = e.passes > 0 ? e.seconds / static_cast<double>(e.passes) : 0.0;
    std::vector<Checkpoint> history = readHistory(file, layer, secondsPerPass);
    if (!history.empty()) all.history[e.name] = std::move(history);
    all.estimates.push_back(e);
  }
  Features f = readFeatures(file, prefix);
  if (completeFeatures(f, file.width, file.height)) all.features = std::move(f);
  return all;
}

std::vector<Attribute> estimateAttributes(const Estimates& all, bool timing) {
  std::vector<Attribute> list{textAttribute("braid/seed", std::to_string(all.seed))};
  for (const Estimate& e : all.estimates) {
    const std::string prefix = "braid/" + e.name + "/";
    list.push_back(wholeAttribute(prefix + "unbiased", e.unbiased ? 1 : 0));
    list.push_back(textAttribute(prefix + "correlation", toString(e.correlation)));
    list.push_back(wholeAttribute(prefix + "passes", static_cast<int64_t>(e.passes)));
    if (timing) list.push_back(numberAttribute(prefix + "seconds", e.seconds));
  }
  return list;
}

}  // namespace braid
