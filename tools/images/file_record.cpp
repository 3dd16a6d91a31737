// SPDX-License-Identifier: Apache-2.0
#include "tools/images/file_record.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <span>
#include <string_view>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "renderer/scene/gltf/document/other_formats.h"

namespace braid {

namespace {

using Json = nlohmann::json;

Json valueOf(const Attribute& a) {
  switch (a.kind) {
    case Attribute::Kind::Int:
      return a.integer;
    case Attribute::Kind::Float:
      return a.number;
    case Attribute::Kind::Matrix:
    case Attribute::Kind::Chromaticities:
      return a.values;
    case Attribute::Kind::String:
      break;
  }
  return a.text;
}

Json namedValues(const std::vector<Attribute>& attributes) {
  Json all = Json::object();
  for (const Attribute& a : attributes) all[a.name] = valueOf(a);
  return all;
}

Json recordOf(const std::string& path, const char* kind, int width, int height, const PixelWindow& window) {
  return {{"schema", 1},
          {"file", path},
          {"kind", kind},
          {"size", {width, height}},
          {"window", {window.x0, window.y0, window.x1, window.y1}}};
}

Json imageRecord(const std::string& path) {
  const ImageFile file = readImage(path);
  Json record = recordOf(path, "image", file.fullWidth, file.fullHeight, file.window);
  Json layers = Json::object();
  for (const std::string& channel : file.channelNames) {
    const size_t dot = channel.rfind('.');
    layers[dot == std::string::npos ? "" : channel.substr(0, dot)].push_back(
        dot == std::string::npos ? channel : channel.substr(dot + 1));
  }
  record["layers"] = std::move(layers);
  record["attributes"] = namedValues(file.attributes);
  return record;
}

Json stateRecord(const std::string& path) {
  const FilmState state = readStateHeader(path);
  Json record = recordOf(path, "state", state.fullWidth, state.fullHeight, state.window);
  record["passes"] = Json::object();
  for (const EstimateState& e : state.estimates) {
    Json& intervals = record["passes"][e.name] = Json::array();
    for (const PassInterval& p : e.passes) intervals.push_back({p.begin, p.end});
  }
  record["seed"] = state.seed;
  record["options"] = Json::object();
  for (const StateOption& option : state.identity.options) record["options"][option.name] = option.value;
  record["attributes"] = namedValues(state.attributes);
  return record;
}

}  // namespace

std::optional<Json> fileRecord(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return std::nullopt;  // pipes may never deliver
  std::array<char, 32> beginning{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(beginning.data(), beginning.size());
  const std::string_view text(beginning.data(), static_cast<size_t>(stream.gcount()));
  if (text.starts_with("braid-state ")) return stateRecord(path);
  const std::span bytes(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  return gltf::isImage(bytes) ? std::optional(imageRecord(path)) : std::nullopt;
}

}  // namespace braid
