// SPDX-License-Identifier: Apache-2.0
// `braid info`: what a scene, an image or the state of a render holds.
#include <sstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/error.h"
#include "tools/images/file_record.h"
#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/open_scene.h"
#include "tools/prepare/scene_record.h"

namespace braid {

namespace {

struct InfoOptions {
  SceneChoice scene;
  bool json = false;
};

void print(const nlohmann::json& j) {
  const auto list = [](const nlohmann::json& items) {
    std::string text;
    for (const auto& i : items)
      text += fmt::format("{}{}", text.empty() ? "" : ", ", (i.is_string() ? i : i["type"]).get<std::string>());
    return text.empty() ? std::string("none") : text;
  };
  fmt::print("{}\n", j["file"].get<std::string>());
  fmt::print("  triangles   {} ({} instanced) in {} meshes, {} instances\n", j["triangles"].dump(),
             j["instancedTriangles"].dump(), j["meshes"].dump(), j["instances"].dump());
  fmt::print("  bounds      {} to {} metres\n", j["bounds"]["min"].dump(), j["bounds"]["max"].dump());
  fmt::print("  cameras     {}{}\n", list(j["cameras"]), j["defaultCamera"].get<bool>() ? " (one is made up)" : "");
  fmt::print("  lights      {}{}\n", list(j["lights"]),
             j["defaultLight"].is_null() ? "" : fmt::format(" ({} is added)", j["defaultLight"].get<std::string>()));
  fmt::print("  emitters    {} materials, {} triangles\n", j["emitters"].dump(), j["emissiveTriangles"].dump());
  fmt::print("  materials   {}, textures {}\n", j["materials"].dump(), j["textures"].dump());
  fmt::print("  traits      {}\n  extensions  {}\n", list(j["traits"]), list(j["extensionsUsed"]));
  if (!j["extensionsIgnored"].empty()) fmt::print("  ignored     {}\n", list(j["extensionsIgnored"]));
  if (!j["variants"].empty()) fmt::print("  variants    {}\n", list(j["variants"]));
  for (size_t i = 0; i < j["animations"].size(); ++i) {
    const nlohmann::json& a = j["animations"][i];
    fmt::print("  {:<11} {} '{}', {:.6g} s\n", i == 0 ? "animations" : "", i, a["name"].get<std::string>(),
               a["seconds"].get<double>());
  }
  fmt::print("  warnings    {}\n", j["warnings"].size());
  for (const auto& note : j["notes"]) fmt::print("  note        {}\n", note.get<std::string>());
}

// A value of a header in one line, or under its name.
std::string valueText(const nlohmann::json& value) {
  std::istringstream lines(value.is_string() ? value.get<std::string>() : value.dump());
  std::string text;
  for (std::string line; std::getline(lines, line);) text += (text.empty() ? "" : "\n      ") + printable(line);
  return text;
}

void printFile(const nlohmann::json& j) {
  const nlohmann::json &size = j["size"], &window = j["window"];
  fmt::print("{}\n", j["file"].get<std::string>());
  fmt::print("  {:<11} {}x{}\n", j["kind"].get<std::string>(), size[0].dump(), size[1].dump());
  if (window != nlohmann::json{0, 0, size[0], size[1]}) fmt::print("  window      {}\n", window.dump());
  if (j.contains("layers"))
    for (const auto& [name, channels] : j["layers"].items())
      fmt::print("  layer       {} {}\n", name.empty() ? "(image)" : name, channels.dump());
  if (j.contains("passes"))
    for (const auto& [name, intervals] : j["passes"].items())
      fmt::print("  passes      {} {}\n", name, intervals.dump());
  if (j.contains("seed")) fmt::print("  seed        {}\n", j["seed"].dump());
  for (const char* group : {"options", "attributes"})
    if (j.contains(group))
      for (const auto& [name, value] : j[group].items()) fmt::print("  {}: {}\n", name, valueText(value));
}

int runInfo(InfoOptions o) {
  o.scene.quiet = o.scene.quiet || o.json;  // warnings are in the record
  const std::optional<nlohmann::json> file = fileRecord(o.scene.file);
  const nlohmann::json record = file ? *file : sceneRecord(*openScene(o.scene).scene);
  if (o.json)
    fmt::print("{}\n", record.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  else if (file)
    printFile(record);
  else
    print(record);
  return 0;
}

}  // namespace

void addInfo(CLI::App& app, Action& action) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand("info", "Print what a scene holds, or an image, or the state of a render");
  command->footer("Examples:\n  braid info scene.glb --json\n  braid info out.exr");
  addSceneOptions(*command, options->scene);
  command->add_flag("--json", options->json, "As JSON");
  showFirst(*command, kOutputHelp, {"--json"});
  command->callback([options, &action] { action = [options] { return runInfo(*options); }; });
}

}  // namespace braid
