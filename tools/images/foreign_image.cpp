// SPDX-License-Identifier: Apache-2.0
#include "tools/images/foreign_image.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

using Names = std::vector<std::string>;

// Names of passes and AOVs, in lower case, the best first.
const Names kAlbedo{"denoising albedo", "albedo", "albedos", "alb"};
const Names kNormal{"denoising normal", "ns", "sh_normal", "shading_normal", "n", "normal", "normals", "nn"};
const Names kDepth{"denoising depth", "depth", "dd"};

std::string lower(std::string s) {
  std::transform(s.begin(), s.end(), s.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return s;
}

std::string lastPart(const std::string& layer) { return layer.substr(layer.rfind('.') + 1); }

// Every layer of the file, in the order of its channels; the plain R G B is "".
Names layersOf(const ImageFile& file) {
  Names layers;
  for (const std::string& channel : file.channelNames) {
    const size_t dot = channel.rfind('.');
    const std::string layer = dot == std::string::npos ? "" : channel.substr(0, dot);
    if (std::find(layers.begin(), layers.end(), layer) == layers.end()) layers.push_back(layer);
  }
  return layers;
}

bool hasChannels(const ImageFile& file, const std::string& layer, const char* components) {
  const std::string dot = layer.empty() ? "" : layer + ".";
  for (const char* c = components; *c; ++c)
    if (!file.planes.count(dot + *c)) return false;
  return true;
}

// The layer with the first of the names that there is; null: none.
const std::string* findLayer(const ImageFile& file, const Names& layers, const Names& names, const char* components) {
  for (const std::string& name : names)
    for (const std::string& layer : layers)
      if (lower(lastPart(layer)) == name && hasChannels(file, layer, components)) return &layer;
  return nullptr;
}

bool isSecondMoment(const std::string& layer) { return layer.rfind("m2_", 0) == 0; }

std::string colourLayer(const ImageFile& file, const Names& layers, bool denoised) {
  const std::string* noisy = findLayer(file, layers, {"noisy image"}, "RGB");
  if (noisy && !denoised) return *noisy;
  if (hasLayer(file, "")) return "";
  if (const std::string* combined = findLayer(file, layers, {"combined"}, "RGB")) return *combined;
  for (const std::string& layer : layers) {
    const std::string name = lower(lastPart(layer));
    const bool feature = std::count(kAlbedo.begin(), kAlbedo.end(), name) > 0 || isSecondMoment(layer);
    if (!feature && hasChannels(file, layer, "RGB")) return layer;
  }
  file.rgb("");  // throws, naming the layers that there are
  return "";
}

// Names of Cycles' view layers, which have passes that are images: those with features first, Blender's compositor
// last.
Names viewLayersOf(const Names& layers) {
  Names views;
  for (const std::string& layer : layers) {
    const std::string name = lower(lastPart(layer));
    const size_t dot = layer.rfind('.');
    if (dot == std::string::npos || dot == 0 || (name != "combined" && name != "noisy image")) continue;
    if (const std::string view = layer.substr(0, dot); std::find(views.begin(), views.end(), view) == views.end())
      views.push_back(view);
  }
  const auto rank = [&](const std::string& view) {
    const bool features = std::any_of(layers.begin(), layers.end(), [&](const std::string& layer) {
      return lower(layer) == lower(view) + ".denoising albedo";
    });
    return features ? 0 : lower(view) == "composite" ? 2 : 1;
  };
  std::stable_sort(views.begin(), views.end(),
                   [&](const std::string& a, const std::string& b) { return rank(a) < rank(b); });
  return views;
}

std::string joined(const Names& names) {
  std::string text;
  for (const std::string& name : names) text += fmt::format("{}'{}'", text.empty() ? "" : ", ", name);
  return text;
}

// The layers of a view layer.
Names within(const Names& layers, const std::string& view) {
  Names list;
  for (const std::string& layer : layers)
    if (layer.rfind(view + ".", 0) == 0) list.push_back(layer);
  return list;
}

struct ChosenLayers {
  std::string colour;
  Names all;  // among which the features are
};

// Without a choice: the first view layer, or what colourLayer() finds.
ChosenLayers chooseLayers(const ImageFile& file, bool denoised, const std::string& wanted,
                          std::vector<std::string>& notes) {
  const Names all = layersOf(file), views = viewLayersOf(all);
  const bool noisy = findLayer(file, all, {"noisy image"}, "RGB") != nullptr;
  if (wanted.empty() && !views.empty() && (!hasLayer(file, "") || (noisy && !denoised))) {
    const ChosenLayers chosen = chooseLayers(file, denoised, views.front(), notes);
    Names others(views.begin() + 1, views.end());
    notes.push_back(fmt::format("{}: reads '{}'{}", file.path, chosen.colour,
                                others.empty() ? ""
                                               : fmt::format("; its other view layers are {}: choose one by {}:LAYER",
                                                             joined(others), file.path)));
    return chosen;
  }
  if (wanted.empty()) return {colourLayer(file, all, denoised), all};
  if (std::find(views.begin(), views.end(), wanted) != views.end()) {
    const Names own = within(all, wanted);
    const std::string* before = findLayer(file, own, {"noisy image"}, "RGB");
    const std::string* after = findLayer(file, own, {"combined"}, "RGB");
    const std::string* colour = (denoised && after) || !before ? after : before;
    if (colour) return {*colour, own};
  }
  if (hasChannels(file, wanted, "RGB")) {
    const size_t dot = wanted.rfind('.');
    const Names own = dot == std::string::npos ? Names() : within(all, wanted.substr(0, dot));
    return {wanted, own.empty() ? all : own};
  }
  Names colours = views;
  for (const std::string& layer : all)
    if (!layer.empty() && hasChannels(file, layer, "RGB")) colours.push_back(layer);
  throw Error(ExitCode::BadInput, fmt::format("{}: no layer '{}'{}", file.path, wanted,
                                              colours.empty() ? std::string("; it has no layers with names")
                                                              : "; it has " + joined(colours)));
}

// pbrt: samplesPerPixel; Cycles: cycles.<Layer>.samples, as text, of the layer that is read.
uint64_t samplesOf(const ImageFile& file, const std::string& colour) {
  const std::string cycles = "cycles." + colour.substr(0, colour.rfind('.')) + ".samples";
  for (const Attribute& a : file.attributes) {
    if (a.name != "samplesPerPixel" && a.name != cycles) continue;
    const int64_t n = a.kind == Attribute::Kind::Int ? a.integer : std::atoll(a.text.c_str());
    if (n > 0) return static_cast<uint64_t>(n);
  }
  return 0;
}

// Variance of the mean: pbrt's Variance is that of one sample; Mitsuba's second moments give the same.
Rgb<float> varianceOfMean(const ImageFile& file, const std::string& colour, const Rgb<float>& mean, uint64_t samples) {
  const std::string moment = "m2_" + colour;
  const bool second = !colour.empty() && hasLayer(file, moment);
  if (samples == 0 || (!second && !hasLayer(file, "Variance"))) return {};
  Rgb<float> v = file.rgb(second ? moment : "Variance");
  const auto n = static_cast<double>(samples);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto value = static_cast<double>(v[c][i]);
        const double spread = value - sqr(static_cast<double>(mean[c][i]));
        v[c][i] = static_cast<float>(second ? std::max(0.0, spread) / std::max(1.0, n - 1) : value / n);
      }
    });
  return v;
}

// Depth, or else the distance of positions in camera space.
Plane<float> anyDepth(const ImageFile& file, const Names& layers) {
  for (const char* component : {"Z", "V", "T", "R"})
    if (const std::string* layer = findLayer(file, layers, kDepth, component))
      return file.planes.at(*layer + "." + component);
  for (const std::string& channel : file.channelNames)
    if (channel.size() > 2 && channel.ends_with(".T")) return file.planes.at(channel);
  const std::string* position = findLayer(file, layers, {"p"}, "XYZ");
  if (!position) return {};
  const Rgb<float> p = file.rgb(*position);
  Plane<float> depth(file.width, file.height);
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = glm::length(p.pixel(i));
  return depth;
}

// What other renderers write where a camera ray meets nothing is 0, as braid's own.
Plane<float> readDepth(const ImageFile& file, const Names& layers) {
  constexpr float kNothing = 1e9f;
  Plane<float> depth = anyDepth(file, layers);
  for (float& d : depth.data)
    if (d >= kNothing) d = 0;
  return depth;
}

template <class P>
void completeFeature(FeaturePlanes<P>& f, const P& zero) {
  if (f.mean.empty()) f.mean = zero;
  for (P& half : f.half)
    if (half.empty()) half = f.mean;
  if (f.variance.empty()) f.variance = zero;
}

}  // namespace

bool completeFeatures(Features& f, int width, int height) {
  if (f.albedo.mean.empty() && f.normal.mean.empty()) return false;
  completeFeature(f.albedo, Rgb<float>(width, height));
  completeFeature(f.normal, Rgb<float>(width, height));
  completeFeature(f.depth, Plane<float>(width, height));
  completeFeature(f.visibility, Plane<float>(width, height));
  return true;
}

ForeignImage readForeign(const ImageFile& file, bool denoised, uint64_t samplesPerPixel, const std::string& layer) {
  ForeignImage out;
  const auto note = [&](const std::string& text) { out.notes.push_back(file.path + ": " + text); };
  const auto [colour, layers] = chooseLayers(file, denoised, layer, out.notes);
  out.estimate.mean = file.rgb(colour);
  const uint64_t told = samplesOf(file, colour);
  out.estimate.passes = told > 0 ? told : samplesPerPixel;
  if (const auto alpha = file.planes.find(colour.empty() ? "A" : colour + ".A"); alpha != file.planes.end())
    out.alpha = alpha->second;
  if (!denoised) {
    out.estimate.variance = varianceOfMean(file, colour, out.estimate.mean, out.estimate.passes);
    const bool perSample = hasLayer(file, "Variance") || hasLayer(file, "m2_" + colour);
    if (perSample && out.estimate.passes == 0)
      note("its variances are of one sample, and the number of samples is not known: give it with --spp");
  }

  Features f;
  if (const std::string* albedo = findLayer(file, layers, kAlbedo, "RGB")) f.albedo.mean = file.rgb(*albedo);
  for (const char* components : {"XYZ", "RGB"})
    if (const std::string* normal = findLayer(file, layers, kNormal, components); normal && f.normal.mean.empty())
      f.normal.mean = file.rgb(*normal);
  f.depth.mean = readDepth(file, layers);
  std::string missing;
  for (const auto& [name, there] : {std::pair("albedo", !f.albedo.mean.empty()), {"normal", !f.normal.mean.empty()}})
    if (!there) missing += fmt::format("{}{}", missing.empty() ? "" : " and ", name);
  if (!completeFeatures(f, file.width, file.height)) {
    if (!denoised) note("no albedo and no normal: denoisers see colours only");
    return out;
  }
  if (!missing.empty() && !denoised) note(fmt::format("no {}", missing));
  out.features = std::move(f);
  return out;
}

}  // namespace braid
