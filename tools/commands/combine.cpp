// SPDX-License-Identifier: Apache-2.0
// `braid combine`: denoisers and combiners on the images of earlier renders, braid's or another renderer's.
#include <algorithm>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/files/picture.h"
#include "renderer/film/make_attribute.h"
#include "tools/options/cli.h"
#include "tools/options/combining.h"
#include "tools/images/estimates_file.h"
#include "tools/options/file_uses.h"
#include "tools/options/syntax/help.h"
#include "tools/publish/image_output.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/syntax/option_texts.h"
#include "tools/options/output_options.h"
#include "tools/images/same_view.h"
#include "version.h"

namespace braid {

namespace {

struct CombineOptions {
  std::string unbiased, correlated, reference, output, png;
  AovSet aovs = AovSet::All;
  CombineChoice choice;
  uint64_t samplesPerPixel = 0;
  ToneChoice tone;
  int threads = 0;
  bool quarters = false, floatHeadline = false, noTiming = false, quiet = false;
};

bool isFile(const std::string& text) {
  std::error_code ignored;
  const std::string first = text.substr(0, text.find(','));
  return std::filesystem::is_regular_file(first, ignored) ||
         std::filesystem::is_regular_file(first.substr(0, first.rfind(':')), ignored);
}

bool looksLikeFile(const std::string& text) { return text.find('.') != std::string::npos || isFile(text); }

// What the files hold.
struct Inputs {
  Estimates estimates;
  Plane<float> alpha;  // of the unbiased image; empty: none
  ImageFile head;      // of its file
  std::vector<std::string> notes;
};

bool samePixels(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (!std::equal(a[c].data.begin(), a[c].data.end(), b[c].data.begin(), b[c].data.end())) return false;
  return true;
}

// Adds the first estimate of `from` that fits, or else the very first, under a name that is free, unless the same one
// has been read already: two copies of an image would count as independent.
template <class Fits>
Estimate& addEstimate(Estimates& all, Estimates from, const std::string& file, const Fits& fits) {
  auto found = std::find_if(from.estimates.begin(), from.estimates.end(), fits);
  if (found == from.estimates.end() || file.find(':') != std::string::npos) found = from.estimates.begin();
  for (Estimate& e : all.estimates)
    if (fits(e) && e.name == found->name && samePixels(e.mean, found->mean)) return e;
  while (all.find(found->name) || isMethod(found->name)) found->name += "-file";
  return all.estimates.emplace_back(std::move(*found));
}

// A braid file as the biased input stands for its headline where it has no biased estimate: a combined image.
Estimates readBiased(const std::string& text, const ReadOptions& options) {
  Estimates all = readEstimatesOption(text, options);
  if (text.find(',') != std::string::npos || text.find(':') != std::string::npos) return all;
  const ImageFile file = readImage(text);
  const bool any =
      std::any_of(all.estimates.begin(), all.estimates.end(), [](const Estimate& e) { return !e.unbiased; });
  if (any || !hasLayer(file, "")) return all;
  Estimate headline;
  headline.name = options.foreignName;
  headline.mean = file.rgb("");
  all.estimates = {std::move(headline)};
  return all;
}

// The image of the file, or of a view layer.
Rgb<float> readReferenceImage(const std::string& text, const Inputs& in) {
  ReadOptions read;
  read.role = ImageRole::Denoised;
  read.like = &in.head;
  Estimates all = readEstimatesOption(text, read);
  std::error_code ignored;
  const ImageFile file = std::filesystem::exists(text, ignored) ? readImage(text) : ImageFile();
  return hasLayer(file, "") ? file.rgb("") : std::move(all.estimates.front().mean);
}

// Files that methods read themselves.
void checkExternal(const std::string& name, const Inputs& in) {
  for (size_t begin = 0; begin <= name.size();) {  // FILE:HALFA:HALFB
    const size_t end = std::min(name.find(':', begin), name.size());
    if (const std::string file = name.substr(begin, end - begin); isFile(file))
      requireSameView(in.head, readImage(file));
    begin = end + 1;
  }
}

// Fills the roles of the pipeline from the options; files become estimates.
Inputs readInputs(const CombineOptions& o, PipelineOptions& pipeline) {
  Inputs in;
  ReadOptions read{"unbiased", ImageRole::Noisy, o.samplesPerPixel, &in.notes};
  read.derive = true;
  read.alpha = &in.alpha;
  read.head = &in.head;
  Estimates& all = in.estimates = readEstimatesOption(o.unbiased, read);
  read = {"correlated", ImageRole::Noisy, o.samplesPerPixel, &in.notes};
  read.like = &in.head;
  pipeline.roles.unbiased = defaultUnbiased(availableIn(all));
  if (pipeline.roles.unbiased.empty())
    throw Error(ExitCode::BadInput,
                fmt::format("{}: holds no unbiased estimate with independent pixels, such as pt", o.unbiased));
  if (!o.correlated.empty()) {
    Estimate& e = addEstimate(all, readEstimatesOption(o.correlated, read), o.correlated,
                              [](const Estimate& other) { return other.correlation != Correlation::Independent; });
    pipeline.roles.correlated = e.name;
    if (e.correlation == Correlation::Independent) e.correlation = Correlation::CommonRandomNumbers;
  }
  const std::string& biased = o.choice.biased;
  if (!biased.empty() && !all.find(biased) && !isMethod(biased) && looksLikeFile(biased) &&
      biased.rfind("external", 0) != 0) {
    read.foreignName = "biased";
    read.role = ImageRole::Denoised;
    Estimate& e =
        addEstimate(all, readBiased(biased, read), biased, [](const Estimate& other) { return !other.unbiased; });
    pipeline.roles.biased = e.name;
    e.unbiased = false;
  }
  if (!o.reference.empty()) all.reference = readReferenceImage(o.reference, in);
  for (std::string& base : pipeline.roles.bases)
    if (!all.find(base) && base.find(':') == std::string::npos && isFile(base)) base = "external:" + base;
  std::vector<std::string> names = pipeline.roles.bases;
  for (const std::vector<std::string>& more : {o.choice.methods, pipeline.roles.denoisers, {biased}})
    names.insert(names.end(), more.begin(), more.end());
  for (const std::string& name : names)
    if (const size_t at = name.find("external:"); at != std::string::npos) checkExternal(name.substr(at + 9), in);
  return in;
}

// Names of what would run on these inputs, for a user whose choice does not.
std::string runnable(const Estimates& all, const CombinePlanOptions& roles) {
  std::string names;
  for (const auto& m : makeMethods()) {
    const CombinePlan combinePlan = makeCombinePlan(availableIn(all), {m->name()}, roles);
    if (const Step* step = combinePlan.find(m->name()); step && step->skipReason.empty())
      names += fmt::format("{}{}", names.empty() ? "" : ", ", m->name());
  }
  return names.empty() ? "; nothing can run on these files" : "; what can run on these files: " + names;
}

// "FILE:ESTIMATE" and "FILE,HALFA,HALFB" are files too.
void addInput(FileUses& uses, const std::string& what, const std::string& text) {
  for (const std::string& file : splitList(text)) {
    uses.input(what, file);
    uses.input(what, file.substr(0, file.rfind(':')));
  }
}

void checkOutputs(const CombineOptions& o) {
  FileUses uses;
  addInput(uses, "an input of --unbiased", o.unbiased);
  addInput(uses, "an input of --correlated", o.correlated);
  addInput(uses, "an input of --biased", o.choice.biased);
  for (const std::string& base : o.choice.bases) addInput(uses, "an input of --bases", base);
  uses.input("the reference", o.reference);
  for (const std::string& name : o.choice.names()) uses.method(name);
  uses.output("--output", o.output);
  uses.output("--png", o.png);
  uses.check();
  ImageOutput files;
  files.file = o.output;
  files.png = o.png;
  checkImageFiles(files);
}

// What no method could run without is told before any of them runs. Throws Error(BadInput).
CombinePlan requireMethods(const Estimates& all, const std::vector<std::string>& wanted,
                           const CombinePlanOptions& roles) {
  const CombinePlan combinePlan = makeCombinePlan(availableIn(all), wanted, roles);
  for (const std::string& name : wanted)
    if (const Step* step = combinePlan.find(name); step && !step->skipReason.empty())
      throw Error(ExitCode::BadInput, fmt::format("{} cannot run: {}{}", name, step->skipReason, runnable(all, roles)));
  return combinePlan;
}

// Writes the files; the warning, if there is one.
std::string writeResult(const CombineOptions& o, const PipelineResult& result, Inputs& in) {
  Estimates& all = in.estimates;
  const Attribute version = textAttribute("Software", std::string("braid ") + BRAID_VERSION);
  const std::vector<Attribute> derived = std::move(all.attributes);
  all.attributes = {version};
  for (const std::vector<Attribute>& list : {estimateAttributes(all, !o.noTiming), derived, viewAttributes(in.head)})
    all.attributes.insert(all.attributes.end(), list.begin(), list.end());
  const CombinedLayers combined(result, o.choice.methods, o.choice.weights, !o.noTiming, all);
  BRAID_ASSERT(combined.headline());
  ExrOptions exr;
  exr.aovs = o.aovs;
  exr.quarters = o.quarters;
  exr.floatHeadline = o.floatHeadline;
  exr.layers = combined.layers();
  const Plane<float>* alpha = in.alpha.empty() ? nullptr : &in.alpha;
  const Rgb<float>& image = *combined.headline();
  const std::optional<Tone> tone = toneOf(o.output, o.png, o.tone, image, alpha);
  const std::string clamped = writeImageFile(o.output, all, image, alpha, exr, tone.value_or(Tone()));
  if (!o.png.empty()) writePicture(o.png, ImageFormat::Png, image, alpha, *tone);
  if (tone && !o.quiet) fmt::print(stderr, "{}\n", describe(*tone));
  return clamped;
}

int runCombine(const CombineOptions& o) {
  if (o.unbiased.empty()) throw Error(ExitCode::Usage, "combine: name the image: braid combine FILE -o OUT.exr");
  checkOutputs(o);
  const std::vector<std::string>& wanted = o.choice.methods;
  if (wanted.empty()) throw Error(ExitCode::Usage, "--method: name at least one method (braid --list)");
  for (const std::string& name : wanted) makeCombinePlan({}, {name}, {});  // unknown names first
  PipelineOptions pipeline = o.choice.options();
  Inputs in = readInputs(o, pipeline);
  if (!o.quiet)
    for (const std::string& line : in.notes) fmt::print(stderr, "note: {}\n", line);

  const CombinePlan combinePlan = requireMethods(in.estimates, wanted, pipeline.roles);
  const PipelineResult result = runCombining(in.estimates, o.choice, pipeline, o.threads);
  for (const std::string& name : wanted)
    if (const PipelineOutput* out = result.find(name); out && !out->ran())
      throw Error(ExitCode::BadInput, fmt::format("{} cannot run: {}", name, out->step.skipReason));
  const std::string clamped = writeResult(o, result, in);
  if (o.quiet) return 0;
  for (const std::string& line : combineWarnings(result)) fmt::print(stderr, "warning: {}\n", line);
  if (!clamped.empty()) fmt::print(stderr, "warning: {}\n", clamped);
  fmt::print(stderr, "{}", combinePlanText(combinePlan));
  for (const PipelineOutput& out : result.outputs)
    if (out.ran())
      fmt::print(stderr, "{}: {:.3f} s, its inputs {:.3f} s\n", out.step.name, out.seconds, out.inputSeconds);
  fmt::print(stderr, "Saved: {}\n", o.output);
  return 0;
}

void addInputOptions(CLI::App& command, CombineOptions& o) {
  CLI::Option* files =
      command.add_option("FILES", o.unbiased, "The unbiased image, in the forms of --unbiased")->type_name("FILES");
  command
      .add_option("--unbiased", o.unbiased,
                  "FILE, or FILE:ESTIMATE of braid's, FILE:LAYER of others'; HALFA,HALFB: two renders with "
                  "different seeds; or FILE,HALFA,HALFB")
      ->excludes(files)
      ->type_name("FILES");
  command.add_option("--correlated", o.correlated, "The same, for the estimate by common random numbers or gradients")
      ->type_name("FILES");
  command
      .add_option("--reference", o.reference,
                  "Image that the true errors are measured by, for ideal and ensemble-oracle")
      ->type_name("FILE");
  o.choice.methods = {kDefaultMethod};
  addWords(command, "--method", o.choice.methods, parseMethods,
           "Methods to run, separated by commas; the last one is the image R G B")
      ->default_str(kDefaultMethod)
      ->type_name("NAMES");
  addCombineOptions(command, o.choice);
  command.get_option("--biased")
      ->description("Biased input: a file as for --unbiased, an estimate, a denoiser or another combiner");
  command
      .add_option("--spp", o.samplesPerPixel, "Samples per pixel of the unbiased image, where its file does not say")
      ->check(wholeNumber(1, kMostSamples));
  showFirst(command, "Inputs", {"--unbiased", "--correlated", "--biased", "--bases", "--method"});
}

void addOutputOptions(CLI::App& command, CombineOptions& o) {
  addOutput(command, o.output)->required();
  command.add_option("--png", o.png, "Also write a tone-mapped PNG")->type_name("FILE");
  addToneOptions(command, o.tone);
  addWords(command, "--aovs", o.aovs, parseAovs, "Layers besides the image: none, features or all")
      ->default_str("all")
      ->type_name("SET");
  command.add_flag("--quarters", o.quarters, "Also write the four quarter buffers");
  command.add_flag("--float", o.floatHeadline, "R G B as 32-bit floats");
  command.add_flag("--reproducible", o.noTiming, "No run times in the header: identical runs give identical files");
  addThreads(command, o.threads);
  command.add_flag("-q,--quiet", o.quiet, "Errors only");
  showFirst(command, kOutputHelp, {"--output", "--png", "--exposure", "--aovs", "--threads", "--quiet"});
}

constexpr const char* kCombineHints =
    "METHOD@INPUT chooses the biased input of one method, e.g. js@ensemble.\n"
    "Examples:\n"
    "  braid render scene.glb --aovs all -o out.exr\n"
    "  braid combine out.exr -o clean.exr\n"
    "  braid combine out.exr --method js -o js.exr\n"
    "  braid combine out.exr --method js --biased ensemble --bases nfor,nlm -o js.exr\n"
    "  braid combine seed1.exr,seed2.exr --biased denoised.exr --method average -o a.exr\n"
    "Files of pbrt, Mitsuba 3 and Cycles are read by their channel names. Where one image is all there\n"
    "is, its variance is estimated from neighbouring pixels, and halves are made from it (the header says\n"
    "so).";

}  // namespace

void addCombine(CLI::App& app, Action& action) {
  auto options = std::make_shared<CombineOptions>();
  CLI::App* command = app.add_subcommand("combine", "Denoise or combine the images of earlier renders");
  addInputOptions(*command, *options);
  addOutputOptions(*command, *options);
  command->footer(kCombineHints);
  command->callback([options, &action] { action = [options] { return runCombine(*options); }; });
}

}  // namespace braid
