// SPDX-License-Identifier: Apache-2.0
// `braid info`: what a scene file holds.
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

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

int runInfo(InfoOptions o) {
  o.scene.quiet = o.scene.quiet || o.json;  // warnings are in the record
  const OpenedScene opened = openScene(o.scene);
  const nlohmann::json record = sceneRecord(*opened.scene);
  if (o.json)
    fmt::print("{}\n", record.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  else
    print(record);
  return 0;
}

}  // namespace

void addInfo(CLI::App& app, Action& action) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand("info", "Print what a scene file holds");
  command->footer("Example:\n  braid info scene.glb --json");
  addSceneOptions(*command, options->scene);
  command->add_flag("--json", options->json, "As JSON");
  showFirst(*command, kOutputHelp, {"--json"});
  command->callback([options, &action] { action = [options] { return runInfo(*options); }; });
}

}  // namespace braid
