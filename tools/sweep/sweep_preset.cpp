// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_preset.h"

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/sweep/report/papers.h"

namespace braid {

void applyPreset(const std::string& preset, const std::set<std::string>& given, SweepOptions& o) {
  if (preset != "papers")
    throw Error(ExitCode::Usage, fmt::format("--preset: unknown preset '{}'; known is papers", preset));
  const auto fill = [&](const char* option, auto& value, auto wanted) {
    if (!given.count(option)) value = std::move(wanted);
  };
  fill("--methods", o.methods, paperMethods());
  if (!given.count("--time")) fill("--spp", o.spp, parseLadder("8:128", false));
  fill("--size", o.view.size, FrameSize{192, 108});
  fill("--seeds", o.seeds, 2);
  fill("--metric", o.metrics, std::vector<std::string>{"relL2", "SMAPE", "DSSIM"});
  fill("--reference-integrator", o.referenceIntegrators, std::vector<std::string>{"auto"});
  fill("--reference-spp", o.referenceSpp, uint64_t(2048));
}

}  // namespace braid
