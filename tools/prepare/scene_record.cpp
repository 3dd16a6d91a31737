// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/scene_record.h"

#include <set>

#include "renderer/core/hash.h"

namespace braid {

namespace {

// A point in the coordinates of the file; as many digits as a float has where that is all that is known.
nlohmann::json inFile(const Vec3& v, const glm::dvec3& origin) {
  if (origin == glm::dvec3(0)) return {v.x, v.y, v.z};
  const glm::dvec3 p = glm::dvec3(v) + origin;
  return {p.x, p.y, p.z};
}

}  // namespace

nlohmann::json sceneRecord(const Scene& scene) {
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
  if (data.environment && data.environment->ofFile) lights.push_back({{"name", ""}, {"type", "image-based"}});
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

}  // namespace braid
