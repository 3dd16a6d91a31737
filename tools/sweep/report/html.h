// SPDX-License-Identifier: Apache-2.0
// The report of a sweep as one HTML file that needs nothing else: plots as inline SVG, pictures as data URIs, and a few
// lines of script for the split slider.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderer/core/plane.h"
#include "tools/sweep/table/sweep_summary.h"

namespace braid {

// Pictures and plots of one scene.
struct ReportScene {
  std::string name;
  Rgb<float> reference;
  std::vector<std::pair<std::string, Rgb<float>>> images;  // method and image at the last rung, of the reference's size
  std::vector<std::string> plots;                          // SVG texts
};

// Text with & < > " escaped.
std::string escaped(const std::string& text);

// The section of one scene: table, plots, split slider, false-colour errors, crops. The pictures take most of the
// memory, so each scene is turned into text before the next one is read.
std::string sceneSection(const ReportScene& scene, const SweepTable& table, const SweepSummary& summary);

// The page. `available` are (name, value) pairs shown at the top: options, machine, build.
std::string reportPage(const SweepSummary& summary, const std::vector<std::pair<std::string, std::string>>& available,
                       const std::vector<std::string>& sections);

}  // namespace braid
