// SPDX-License-Identifier: Apache-2.0
// `braid merge`: the states of several machines' shares become one, as if one machine had rendered all passes.
#include <algorithm>
#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/files/state_file.h"
#include "tools/options/cli.h"
#include "tools/options/file_uses.h"
#include "tools/options/frames.h"
#include "tools/options/syntax/help.h"
#include "tools/images/exr_metadata.h"
#include "tools/publish/image_output.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/output_options.h"

namespace braid {

namespace {

struct MergeOptions {
  std::vector<std::string> parts;
  ImageOutput image;
  std::string checkpoint;
  std::optional<uint64_t> frame;
  int threads = 0;
  bool quiet = false, overwrite = false;
};

struct Part {
  std::string file;
  FilmState header;  // without planes
};

// The parts by their first passes. Throws Error(BadInput) with a sentence for two that do not go together.
std::vector<Part> sortedParts(const std::vector<std::string>& files, bool quiet) {
  std::vector<Part> parts;
  for (const std::string& file : files) parts.push_back({file, readStateHeader(file)});
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return a.header.estimates.front().firstPass() < b.header.estimates.front().firstPass();
  });
  const Part& first = parts.front();
  for (size_t i = 1; i < parts.size(); ++i) {
    const std::string differs = difference(first.header.identity, parts[i].header.identity, false);
    if (!differs.empty())
      throw Error(
          ExitCode::BadInput,
          fmt::format("{} and {} are not shares of one render: {}: render them with one braid and the same options",
                      first.file, parts[i].file, differs));
    const std::string bits = difference(first.header.identity, parts[i].header.identity, true);
    if (!bits.empty() && !quiet) fmt::print(stderr, "note: {} and {}: {}\n", first.file, parts[i].file, bits);
    for (size_t j = 0; j < i; ++j) {
      const std::string both = overlap(parts[j].header, parts[i].header);
      if (!both.empty())
        throw Error(ExitCode::BadInput,
                    fmt::format("{} and {} overlap: {}: leave one of them out", parts[j].file, parts[i].file, both));
    }
  }
  return parts;
}

// One part in memory beside the sum. The order of adding is that of the passes, so that bits do not depend on the order
// on the command line.
FilmState sumOf(const std::vector<Part>& parts) {
  FilmState sum = readStateFile(parts.front().file);
  for (size_t i = 1; i < parts.size(); ++i) {
    const FilmState next = readStateFile(parts[i].file);
    // Equal options make states of one kind, unless a file was tampered with.
    if (!holdSameSums(sum, next))
      throw Error(ExitCode::BadInput, parts[i].file + ": what it holds is not what its options say: use another copy");
    addShare(sum, next);
  }
  return sum;
}

// Throws Error(BadInput) for a wanted method that cannot run on what the states hold.
void requireInputs(const Estimates& estimates, const CombineChoice& choice) {
  const CombinePlan combinePlan = makeCombinePlan(availableIn(estimates), choice.methods, choice.options().roles);
  for (const std::string& name : choice.methods)
    if (const Step* step = combinePlan.find(name); step && !step->skipReason.empty())
      throw Error(ExitCode::BadInput, fmt::format("{} cannot run on these shares: {}: render them with --combine {}",
                                                  name, step->skipReason, name));
}

std::vector<std::string> filesOf(const MergeOptions& o) {
  std::vector<std::string> files = o.image.files();
  if (!o.checkpoint.empty()) files.push_back(o.checkpoint);
  return files;
}

void checkOutputs(const MergeOptions& o) {
  if (filesOf(o).empty()) throw Error(ExitCode::Usage, "nothing to write: give -o OUT.exr, --png or --checkpoint");
  FileUses uses;
  for (const std::string& part : o.parts) uses.input("a share", part);
  for (const std::string& name : o.image.combine.names()) uses.method(name);
  uses.output("--output", o.image.file);
  uses.output("--png", o.image.png);
  uses.output("--checkpoint", o.checkpoint);
  uses.check();
  checkImageFiles(o.image);
  if (!o.checkpoint.empty()) prepareOutput(o.checkpoint);
}

void sayResult(const MergeOptions& o, const WrittenImage& written, const std::vector<PassInterval>& passes,
               uint64_t samples) {
  for (const std::string& text : written.warnings) fmt::print(stderr, "warning: {}\n", text);
  for (const std::string& text : written.timings) fmt::print(stderr, "{}\n", text);
  if (written.tone) fmt::print(stderr, "{}\n", describe(*written.tone));
  for (const std::string& file : filesOf(o)) fmt::print(stderr, "Saved: {}\n", file);
  std::string intervals;
  for (const PassInterval& i : passes)
    intervals += fmt::format("{}{}:{}", intervals.empty() ? "" : " and ", i.begin, i.end);
  fmt::print(stderr, "{} spp of {} shares, passes {}{}\n", samples, o.parts.size(), intervals,
             written.error ? fmt::format(", estimated error {:.3g}", *written.error) : "");
}

// Of one frame: files bear its number. A merged image is written whole, so that one that is there is finished.
int runMerge(const MergeOptions& o);

int runFrameMerge(MergeOptions o) {
  for (std::string* file : {&o.image.file, &o.image.png, &o.checkpoint}) *file = withFrameNumber(*file, *o.frame);
  for (std::string& part : o.parts) part = withFrameNumber(part, *o.frame);
  const std::vector<std::string> files = filesOf(o);
  const bool finished = !o.overwrite && !files.empty() && std::all_of(files.begin(), files.end(), [](const auto& file) {
    return std::filesystem::is_regular_file(file);
  });
  if (!finished) return runMerge(o);
  if (!o.quiet) fmt::print(stderr, "frame {}: {} is there already (--overwrite: anew)\n", *o.frame, files.front());
  return 0;
}

int runMerge(const MergeOptions& o) {
  for (const std::string& name : o.image.combine.methods) makeCombinePlan({}, {name}, {});  // unknown names first
  checkOutputs(o);
  FilmState state = sumOf(sortedParts(o.parts, o.quiet));
  const std::vector<PassInterval> passes = state.estimates.front().passes;
  const uint64_t samples = state.estimates.front().sums.passes();
  if (passes.empty()) throw Error(ExitCode::BadInput, o.parts.front() + ": holds no passes yet");
  if (!o.checkpoint.empty()) writeStateFile(o.checkpoint, state);
  WrittenImage written;
  if (!o.image.files().empty()) {
    Estimates estimates = describedEstimates(state, true, !o.image.noTiming);
    requireInputs(estimates, o.image.combine);
    const std::optional<Plane<float>> alpha =
        state.coverage ? std::optional(state.coverage->mean()) : std::optional<Plane<float>>();
    state = {};  // what it held is what combiners take
    written = writeImage(o.image, estimates, alpha ? &*alpha : nullptr, o.threads);
  }
  if (!o.quiet) sayResult(o, written, passes, samples);
  return 0;
}

}  // namespace

void addMerge(CLI::App& app, Action& action) {
  auto options = std::make_shared<MergeOptions>();
  MergeOptions& o = *options;
  CLI::App* command = app.add_subcommand("merge", "Add the shares of several machines to one image");
  command->footer(
      "Examples:\n"
      "  braid merge part0.state part1.state part2.state -o out.exr\n"
      "  braid merge part*.state -o out.exr --combine auto --checkpoint all.state");
  command->add_option("PART", o.parts, "States that `braid render --passes A:B --checkpoint PART` wrote")
      ->required()
      ->type_name("FILE");
  o.image.aovs = AovSet::All;
  addImageOptions(*command, o.image);
  command->add_option("--checkpoint", o.checkpoint, "Also write the sum as a state, to resume or merge on")
      ->type_name("FILE");
  addThreads(*command, o.threads);
  command->add_flag("-q,--quiet", o.quiet, "Errors only");
  showFirst(*command, kMessageHelp, {"--quiet"});
  showFirst(*command, kOutputHelp, {"--checkpoint", "--threads"});
  command
      ->add_option("--frame", o.frame, "Put this number in place of the # signs in names of files; what is there stays")
      ->check(wholeNumber(0, 1000000));
  command->add_flag("--overwrite", o.overwrite, "With --frame: merge again what is there already");
  command->callback([options, &action] {
    action = [options] { return options->frame ? runFrameMerge(*options) : runMerge(*options); };
  });
}

}  // namespace braid
