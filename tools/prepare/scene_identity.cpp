// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/scene_identity.h"

#include <algorithm>

#include <fmt/format.h>

#include "renderer/core/hash.h"

namespace braid {

namespace {

std::string environmentHash(const SceneChoice& c, const SceneData& data) {
  if (c.environment.empty() || !data.environment || !data.environment->image) return "none";
  const Image& image = *data.environment->image;
  ContentHash hash;
  if (!image.bytes.empty()) hash.add(image.bytes.data(), image.bytes.size());
  if (!image.floats.empty()) hash.add(image.floats.data(), image.floats.size() * sizeof(float));
  return fmt::format("{}x{}:{}", image.width, image.height, hexString(hash.value()));
}

std::string focusText(const SceneChoice& c) {
  if (!c.focus) return "the middle";
  return c.focus->pixel ? fmt::format("{},{}", c.focus->pixel->first, c.focus->pixel->second)
                        : fmt::format("{}", c.focus->metres);
}

const char* yesOrNo(bool yes) { return yes ? "on" : "off"; }

}  // namespace

std::vector<StateOption> sceneIdentity(const SceneChoice& c, const SceneData& data) {
  return {{"--env", environmentHash(c, data)},
          {"--env-rotate", fmt::format("{}", c.environmentRotation)},
          {"--env-scale", fmt::format("{}", c.environmentScale)},
          {"--light-scale", fmt::format("{}", c.lightScale)},
          {"--scene", std::to_string(c.frameScene)},
          {"--variant", c.load.variant},
          {"--frame-time", fmt::format("{}", c.frameTime)},
          {"--shutter", fmt::format("{}", c.load.shutter)},
          {"--animation", c.load.animation},
          {"--point-radius", fmt::format("{}", c.load.pointRadius)},
          {"--double-sided", yesOrNo(c.load.doubleSided)},
          {"--multi-scatter", yesOrNo(c.load.multiScatter)},
          {"--default-light", toString(c.defaultLight)},
          {"the default light", yesOrNo(data.defaultLight)},
          {"--ground", yesOrNo(c.ground)},
          {"--aperture", c.aperture ? fmt::format("f/{} {}", c.aperture->fNumber, c.aperture->metres) : "none"},
          {"--focus", focusText(c)}};
}

std::string changedOptions(const SceneChoice& c, const SceneData& data) {
  const std::vector<StateOption> usual = sceneIdentity({}, data);
  std::vector<StateOption> chosen = sceneIdentity(c, data);
  std::erase_if(chosen, [&](const StateOption& o) { return std::find(usual.begin(), usual.end(), o) != usual.end(); });
  if (c.background)
    chosen.push_back({"--background", fmt::format("{},{},{}", c.background->x, c.background->y, c.background->z)});
  std::string text;
  for (const StateOption& o : chosen) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", o.name, o.value);
  return text;
}

}  // namespace braid
