// SPDX-License-Identifier: Apache-2.0
// `braid info`: what a scene file holds.
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/hash.h"
#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/open_scene.h"

namespace braid {

namespace {

struct InfoOptions {
  SceneChoice scene;
  bool json = false;
};

// A point in the coordinates of the file; as many digits as a float has where that is all that is known.
nlohmann::json inFile(const Vec3& v, const glm::dvec3& origin) {
  if (origin == glm::dvec3(0)) return {v.x, v.y, v.z};
  const glm::dvec3 p = glm::dvec3(v) + origin;
  return {p.x, p.y, p.z};
}

nlohmann::json describe(const Scene& scene) {
  const SceneData& data = scene.data();
  const SceneTraits& t = scene.traits();
  nlohmann::json cameras = nlohmann::json::array(), lights = nlohmann::json::array(),
                 animations = nlohmann::json::array();
  for (const AnimationClip& a : data.animations) animations.push_back({{"name", a.name}, {"seconds", a.seconds}});
  for (const CameraData& c : data.cameras)
    cameras.push_back({{"name", c.name}, {"type", c.orthographic ? "orthographic" : "perspective"}});
  for (const PunctualLight& l : data.lights)
    lights.push_back({{"name", l.name},
                      {"type", l.kind == PunctualKind::Point  ? "point"
                               : l.kind == PunctualKind::Spot ? "spot"
                                                              : "directional"}});
  // An emitter, for people, is an emissive material in use.
  std::set<uint32_t> emitters;
  for (const EmissiveTriangle& e : scene.emitters()) emitters.insert(data.meshes[e.mesh].material);
  const bool empty = scene.bounds().empty();
  return {{"schema", 1},
          {"file", data.file},
          {"contentHash", hexString(data.contentHash)},
          {"triangles", t.triangles},
          {"instancedTriangles", t.instancedTriangles},
          {"meshes", t.meshes},
          {"instances", t.instances},
          {"bounds",
           {{"min", empty ? nlohmann::json() : inFile(scene.bounds().lo, data.origin)},
            {"max", empty ? nlohmann::json() : inFile(scene.bounds().hi, data.origin)}}},
          {"cameras", data.defaultCamera ? nlohmann::json::array() : cameras},
          {"defaultCamera", data.defaultCamera},
          {"lights", lights},
          {"defaultLight",
           !data.defaultLight ? nlohmann::json(nullptr) : nlohmann::json(data.backdrop ? "studio" : "dome")},
          {"animations", animations},
          {"emitters", emitters.size()},
          {"emissiveTriangles", t.emissiveTriangles},
          {"materials", t.materials},
          {"textures", t.textures},
          {"traits", t.names()},
          {"extensionsUsed", data.extensionsUsed},
          {"extensionsRequired", data.extensionsRequired},
          {"extensionsIgnored", data.extensionsIgnored},
          {"variants", data.variants},
          {"scenes", data.sceneNames},
          {"warnings", data.warnings},
          {"notes", data.notes}};
}

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
  const nlohmann::json record = describe(*opened.scene);
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
