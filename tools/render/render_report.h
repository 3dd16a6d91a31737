// SPDX-License-Identifier: Apache-2.0
// What `braid render` says while it runs and at its end: lines for people, records for programs, an exit code.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "renderer/session/session.h"
#include "tools/render/render_options.h"
#include "tools/options/open_scene.h"
#include "tools/publish/publisher.h"
#include "tools/run/progress_line.h"
#include "tools/run/run_clock.h"

namespace braid {

// When the pass loop began and ended, and the work for the image began, by the clock of the process.
struct LoopTimes {
  double began = 0, ended = 0;
  double imageBegan = 0;
};

// A render that has ended.
struct FinishedRender {
  const RunReport& run;
  const WrittenImage& written;
  RunTimes times;
};

// What is neither the loop's nor combining is writing.
RunTimes timesOf(const OpenedScene& opened, const LoopTimes& loop, const WrittenImage& written);

nlohmann::json resultRecord(const FinishedRender& render, const RenderOptions& options, const Scene& scene);
void sayResult(const FinishedRender& render, const RenderOptions& options);
void sayNews(const std::vector<Publication>& news, const RenderOptions& options, JsonLog& json);

// What the run comes to: interrupted, short of its target, or neither.
int exitCode(const FinishedRender& render, const RenderOptions& options);

}  // namespace braid
