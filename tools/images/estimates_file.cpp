// SPDX-License-Identifier: Apache-2.0
#include "tools/images/estimates_file.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "combiners/pipeline/invalid_pixels.h"
#include "combiners/pipeline/spatial_variance.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/make_attribute.h"
#include "tools/images/braid_image.h"
#include "tools/images/foreign_image.h"
#include "tools/images/same_view.h"

namespace braid {

namespace {

bool complete(const Rgb<float> (&half)[2]) { return !half[0].empty() && !half[1].empty(); }

void varianceFromHalves(Estimate& e, const std::string& file, std::vector<std::string>* notes) {
  if (!e.variance.empty() || !complete(e.half)) return;
  e.variance = Rgb<float>(e.mean.width(), e.mean.height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(e.variance.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) e.variance[c][i] = 0.25f * sqr(e.half[0][c][i] - e.half[1][c][i]);
    });
  if (notes) notes->push_back(fmt::format("{}: no variance: taken from the difference of the halves", file));
}

// Whether a file holds estimates of braid, with their statistics.
bool isBraids(const ImageFile& file) { return !estimateNames(file).empty(); }

std::vector<std::string> splitFiles(const std::string& text) {
  std::vector<std::string> files(1);
  for (const char c : text)
    if (c == ',')
      files.emplace_back();
    else
      files.back() += c;
  return files;
}

// FILE or FILE:NAME, one of the estimates or layers.
std::pair<std::string, std::string> splitName(const std::string& text) {
  std::error_code ignored;
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || std::filesystem::exists(text, ignored)) return {text, ""};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

void moveToFront(Estimates& all, const std::string& name, const std::string& file) {
  const auto found =
      std::find_if(all.estimates.begin(), all.estimates.end(), [&](const Estimate& e) { return e.name == name; });
  if (found == all.estimates.end()) {
    std::string known;
    for (const Estimate& e : all.estimates) known += (known.empty() ? "" : ", ") + e.name;
    throw Error(ExitCode::BadInput, fmt::format("{}: no estimate '{}': it has {}", file, name, known));
  }
  std::rotate(all.estimates.begin(), found, found + 1);
}

bool samePixels(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (!std::equal(a[c].data.begin(), a[c].data.end(), b[c].data.begin(), b[c].data.end())) return false;
  return true;
}

// An image that belongs to another one.
struct Companion {
  ImageFile head;
  Rgb<float> colour;
  Plane<float> alpha;
};

// `layer`: where the file's name does not give one.
Companion readCompanion(const std::string& text, const std::string& layer, const ImageFile& like,
                        const ReadOptions& options) {
  const auto [path, name] = splitName(text);
  const ImageFile file = readImage(path);
  requireSameView(like, file);
  Companion c{headOf(file), {}, {}};
  ReadOptions plain{options.foreignName, options.role, options.samplesPerPixel};
  plain.layer = name.empty() ? layer : name;
  plain.alpha = &c.alpha;
  Estimates all = readEstimates(file, plain);
  if (!name.empty() && isBraids(file)) moveToFront(all, name, path);
  c.colour = std::move(all.estimates.front().mean);
  return c;
}

void requireDifferent(const Rgb<float>& a, const Rgb<float>& b, const std::string& text) {
  if (samePixels(a, b))
    throw Error(ExitCode::BadInput,
                fmt::format("{}: the halves are the same pixels: give two renders with different seeds", text));
}

Rgb<float> meanOfHalves(const Estimate& e) {
  Rgb<float> mean = e.half[0];
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < mean.size(); ++i) mean[c][i] = 0.5f * e.half[0][c][i] + 0.5f * e.half[1][c][i];
  return mean;
}

// What an option names: its text, its files, and the estimate or layer of the first one.
struct Named {
  const std::string& text;
  const std::vector<std::string>& files;
  const std::string& name;
};

// Two files are the halves of a mean; three are an image and its halves.
void addHalves(Estimate& first, const Named& named, const ImageFile& head, const ReadOptions& options) {
  const auto& [text, files, name] = named;
  if (files.size() == 2) {
    Companion other = readCompanion(files[1], name, head, options);
    requireOtherSeed(head, other.head);
    requireDifferent(first.mean, other.colour, text);
    if (options.alpha && !options.alpha->empty() && !other.alpha.empty())
      for (size_t i = 0; i < other.alpha.size(); ++i)
        (*options.alpha)[i] = 0.5f * (*options.alpha)[i] + 0.5f * other.alpha[i];
    first.half[0] = first.mean;
    first.half[1] = std::move(other.colour);
    first.mean = meanOfHalves(first);
    first.variance = Rgb<float>();  // was that of one half
    first.passes *= 2;
    first.quarter.clear();
  } else if (files.size() == 3) {
    Companion a = readCompanion(files[1], name, head, options), b = readCompanion(files[2], name, head, options);
    requireOtherSeed(a.head, b.head);
    requireDifferent(a.colour, b.colour, text);
    first.half[0] = std::move(a.colour);
    first.half[1] = std::move(b.colour);
  }
}

// Fills in what can be told from the rest, and notes what is missing.
void completeEstimates(Estimates& all, const std::string& path, bool braids, const ReadOptions& options) {
  const Estimate& first = all.estimates.front();
  const uint64_t filled = braids ? 0 : fillInvalid(all);
  if (filled > 0 && options.notes)
    options.notes->push_back(
        fmt::format("{}: {} pixels are not finite: they have no weight and are filled from the "
                    "other half or their neighbours",
                    path, filled));
  for (Estimate& e : all.estimates)
    if (e.unbiased) varianceFromHalves(e, path, options.notes);
  if (options.derive && !braids && first.unbiased) deriveStatistics(all, path, options.notes);
  if (options.notes && !complete(first.half))
    options.notes->push_back(fmt::format(
        "{}: no halves of {}: give two renders with different seeds as A.exr,B.exr for methods that need them", path,
        first.name));
  if (options.notes && first.unbiased && first.variance.empty())
    options.notes->push_back(fmt::format("{}: no variance of {}", path, first.name));
}

}  // namespace

void deriveStatistics(Estimates& all, const std::string& file, std::vector<std::string>* notes) {
  Estimate& e = all.estimates.front();
  varianceFromHalves(e, file, notes);
  const bool noVariance = e.variance.empty(), noHalves = !complete(e.half);
  const auto tell = [&](const char* attribute, const char* text) {
    all.attributes.push_back(textAttribute(fmt::format("braid/{}/{}", e.name, attribute), text));
    if (notes) notes->push_back(fmt::format("{}: {} of {}: {}", file, attribute, e.name, text));
  };
  if (noVariance) {
    e.variance = spatialVariance(e.mean, all.features ? &*all.features : nullptr);
    tell("variance", "estimated from the differences of neighbouring pixels, as the file holds none");
  }
  if (noHalves) {
    makeHalves(e);
    tell("halves",
         "the image plus and minus noise of its variance, as there is only one: two renders with different "
         "seeds, A.exr,B.exr, are better");
  }
  if ((noVariance || noHalves) && e.passes < 4) e.passes = 0;  // neither is what so few samples would tell
}

// A file of braid without estimates is what renders write unless they are told otherwise.
void noteMissingEstimates(const ImageFile& file, const ReadOptions& options) {
  const Attribute *software = findAttribute(file, "Software"), *headline = findAttribute(file, "braid/headline");
  if (options.role != ImageRole::Noisy || !software || !software->text.starts_with("braid ")) return;
  if (headline)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: holds the image that {} made, and not the estimates with halves and variances that it "
                            "was made of: render it with --aovs all",
                            file.path, headline->text));
  if (options.notes)
    options.notes->push_back(fmt::format(
        "{}: its halves, variances and noise of features were not saved: render it with --aovs all", file.path));
}

Estimates readEstimates(const ImageFile& file, const ReadOptions& options) {
  for (const Attribute& a : file.attributes)
    if (a.name == kRenderedSizeAttribute)
      throw Error(
          ExitCode::BadInput,
          fmt::format("{}: its pixels are copies of those of an image of {}, which have no noise of their own to "
                      "filter: render it again with more --time",
                      file.path, a.text));
  const std::vector<std::string> layers = estimateNames(file);
  if (!layers.empty()) {
    if (const auto alpha = file.planes.find("A"); options.alpha && alpha != file.planes.end())
      *options.alpha = alpha->second;
    return readBraidImage(file, layers);
  }
  noteMissingEstimates(file, options);
  Estimates all = emptyLike(file);
  ForeignImage foreign = readForeign(file, options.role == ImageRole::Denoised, options.samplesPerPixel, options.layer);
  foreign.estimate.name = options.foreignName;
  foreign.estimate.unbiased = options.role == ImageRole::Noisy;
  all.estimates.push_back(std::move(foreign.estimate));
  all.features = std::move(foreign.features);
  if (options.notes) options.notes->insert(options.notes->end(), foreign.notes.begin(), foreign.notes.end());
  if (options.alpha) *options.alpha = std::move(foreign.alpha);
  return all;
}

Estimates readEstimatesOption(const std::string& text, const ReadOptions& options) {
  const std::vector<std::string> files = splitFiles(text);
  if (files.size() > 3 || std::count(files.begin(), files.end(), "") > 0)
    throw Error(ExitCode::Usage, fmt::format("'{}': expected FILE, or HALFA,HALFB, or FILE,HALFA,HALFB", text));
  const auto [path, name] = splitName(files[0]);
  const ImageFile file = readImage(path);
  if (options.like) requireSameView(*options.like, file);
  if (options.head) *options.head = headOf(file);
  const bool braids = isBraids(file);
  ReadOptions whole = options;
  if (!braids) whole.layer = name;
  Estimates all = readEstimates(file, whole);
  if (!name.empty() && braids) moveToFront(all, name, path);
  Estimate& first = all.estimates.front();
  if (files.size() > 1) {  // parts of the light are those of the first file's image
    first.direct = {};
    first.indirectVariance = {};
  }
  addHalves(first, {text, files, name}, headOf(file), options);
  completeEstimates(all, path, braids, options);
  return all;
}

}  // namespace braid
