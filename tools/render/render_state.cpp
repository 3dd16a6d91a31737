// SPDX-License-Identifier: Apache-2.0
#include "tools/render/render_state.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/state_file.h"
#include "renderer/session/placement_map.h"
#include "tools/options/file_uses.h"

namespace braid {

std::string resumedFile(const RenderOptions& o) {
  if (!o.resume) return "";
  return o.resumeFile.empty() ? o.checkpoint : o.resumeFile;
}

void protectCheckpoint(const RenderOptions& o) {
  std::error_code ignored;
  if (o.overwrite || o.checkpoint.empty() || !std::filesystem::is_regular_file(o.checkpoint, ignored)) return;
  if (o.resume && isSameFile(resumedFile(o), o.checkpoint)) return;
  std::string held = "is there already, and is no state that this braid can read";
  try {
    const FilmState state = readStateHeader(o.checkpoint);
    uint64_t samples = 0;
    for (const PassInterval& i : state.estimates.front().passes) samples += i.count();
    held = fmt::format("holds {} samples already", samples);
  } catch (const Error&) {
  }
  throw Error(ExitCode::Usage,
              fmt::format("--checkpoint {}: {}: give --resume to go on from it, or --overwrite to begin anew",
                          o.checkpoint, held));
}

std::optional<FilmState> earlierState(const RenderOptions& o, const Settings& settings) {
  if (!o.resume) return std::nullopt;
  const std::string file = resumedFile(o);
  if (file.empty()) throw Error(ExitCode::Usage, "--resume: name a file, here or with --checkpoint");
  // A job that is started again after a crash has the same command line as at first, when there was nothing to resume.
  if (o.resumeFile.empty() && !std::filesystem::exists(file)) return std::nullopt;
  FilmState state = readStateFile(file);
  for (const EstimateState& e : state.estimates) {
    const auto perRound = static_cast<uint64_t>(e.passesPerRound);
    const uint64_t begin = settings.firstRound * perRound, end = begin + settings.spp * perRound;
    if (o.passes && !e.passes.empty() && (e.firstPass() < begin || e.endPass() > end))
      throw Error(
          ExitCode::BadInput,
          fmt::format("{}: cannot be resumed: it holds the passes {}:{} of {}, which are not all of {}:{}: name "
                      "the --passes that it was begun with",
                      file, e.firstPass(), e.endPass(), e.name, begin, end));
  }
  return state;
}

bool holdsAllPasses(const RenderOptions& o) {
  const PassInterval rounds = o.passes.value_or(PassInterval{0, o.samples.spp});
  std::error_code ignored;
  if (rounds.end == 0 || o.error > 0 || !std::filesystem::is_regular_file(o.checkpoint, ignored)) return false;
  try {
    const FilmState state = readStateHeader(o.checkpoint);
    return std::all_of(state.estimates.begin(), state.estimates.end(), [&](const EstimateState& e) {
      const auto perRound = static_cast<uint64_t>(e.passesPerRound);
      return e.passes.size() == 1 && e.firstPass() <= rounds.begin * perRound && e.endPass() >= rounds.end * perRound;
    });
  } catch (const Error&) {
    return false;  // resuming it says what is wrong
  }
}

void keepAsBefore(const FilmState& state, Settings& settings) {
  settings.keep.quarters |= state.buckets == 4;
  settings.keep.features |= state.features.has_value();
  for (const StateOption& option : state.identity.options)
    settings.keep.history |= option == StateOption{"keeping history", "on"};
  for (const EstimateState& e : state.estimates) settings.keep.directIndirect |= e.parts.has_value();
  settings.keep.stops = stopsOf(state.identity);
  if (!settings.placement.empty()) return;
  for (const StateOption& option : state.identity.options)
    if (option.name == kPlacementOption) settings.placement = option.value;
}

}  // namespace braid
