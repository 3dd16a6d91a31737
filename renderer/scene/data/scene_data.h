// SPDX-License-Identifier: Apache-2.0
// What a loader hands to Scene: plain, validated data in metres. Tests and benchmarks build it by hand.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/data/material.h"
#include "renderer/scene/data/textures/texture.h"

namespace braid {

// Sets of texture coordinates that one mesh can have.
inline constexpr uint32_t kUvSlots = 4;

// What moves of a mesh.
struct MeshVertices {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;   // empty: flat shading by the geometric normal
  std::vector<Vec4> tangents;  // empty unless the material needs them; w = ±1 is the sign of the bitangent
  // Frames 1 and 2 of materials whose textures lie differently (Material::coatFrame); empty: the frame is `tangents`.
  std::vector<Vec4> otherTangents[2];
};

// One glTF primitive as an indexed triangle list. Embree reads positions and triangles in place, so both are allocated
// with room for one more element (Embree loads 16 bytes a vertex): call padForEmbree() after filling them.
struct TriangleMesh : MeshVertices {
  std::string name;
  std::vector<glm::uvec3> triangles;
  std::vector<Vec2> uv[kUvSlots];  // empty unless a texture reads them
  std::vector<Vec4> colors;        // empty, or linear RGBA in [0,1] multiplying the base colour
  uint32_t material = 0;           // index into SceneData::materials, always valid
  // The same vertices at the steps 1, 2, … of SceneData::motion; empty: they stand still.
  std::vector<MeshVertices> steps;

  bool moves() const { return !steps.empty(); }
  const MeshVertices& step(size_t k) const { return k == 0 ? *this : steps[k - 1]; }
  void padForEmbree() {
    positions.reserve(positions.size() + 1);
    triangles.reserve(triangles.size() + 1);
    for (MeshVertices& s : steps) s.positions.reserve(s.positions.size() + 1);
  }
};

// A mesh placed in the world. Several instances may share a mesh; a negative determinant flips the front side.
struct MeshInstance {
  uint32_t mesh = 0;
  Mat4 toWorld{1};
  std::vector<Mat4> steps;  // toWorld at the steps 1, 2, … of SceneData::motion; empty: it stands still
};

enum class PunctualKind { Point, Spot, Directional };

// Where a light is and which way it shines.
struct LightPlace {
  Vec3 position{0};
  Vec3 direction{0, 0, -1};  // the way the light travels, unit
};

// KHR_lights_punctual, numbers taken one to one: point/spot W·sr⁻¹, directional W·m⁻².
struct PunctualLight : LightPlace {
  std::string name;
  PunctualKind kind = PunctualKind::Point;
  Spectrum intensity{1};          // colour · intensity
  std::vector<LightPlace> steps;  // at the steps 1, 2, … of SceneData::motion; empty: it stands still
  float range = kInfinity;        // metres, see rangeWindow()
  float innerConeAngle = 0;       // radians
  float outerConeAngle = kPi / 4;
};

struct CameraData {
  std::string name;
  Mat4 toWorld{1};  // rigid: rotation and translation only; looks along -Z, +Y up
  bool orthographic = false;
  float yfov = 0.8f;            // radians, full vertical angle (perspective)
  std::optional<float> aspect;  // width / height; none: that of the output
  float xmag = 1, ymag = 1;     // half extents (orthographic), metres
  float lensRadius = 0;         // metres; 0: a pinhole (perspective)
  float focusDistance = 1;      // metres along the view, of the plane that is sharp
  std::vector<Mat4> steps;      // toWorld at the steps 1, 2, … of SceneData::motion; empty: it stands still
};

// A latitude-longitude environment: up is +Y, the centre of the image lies in direction +X and what is right of it
// toward +Z, as in three.js and, with glTF's axes, in Blender; `rotation` turns it about +Y, from +Z toward +X.
struct EnvironmentData {
  std::shared_ptr<const Image> image;  // null: the constant `radiance`
  Spectrum radiance{0};                // constant radiance, or the scale of the image
  float rotation = 0;                  // radians about +Y
  // Radiance of the image that light sampling leaves, but for a twentieth, to the directions that surfaces choose.
  float base = 0;
  bool ofFile = false;  // an image-based light of the file, no choice of who renders it
};

// What lights a file that has no light of its own.
enum class DefaultLight {
  None,
  Dome,   // a constant environment, which the camera sees
  Studio  // studioEnvironment(), of which the camera sees a neutral backdrop
};

// A clip of the file, for lists.
struct AnimationClip {
  std::string name;
  double seconds = 0;  // the last key time
};

// What happens while the shutter is open: things are where they are at steps 0 to K, and between two of them on
// straight lines. Two steps at one moment are a jump: no path has a time in between.
struct SceneMotion {
  double seconds = 0;        // that the shutter is open; 0: it is not asked for
  std::vector<float> times;  // of the steps, from 0 to 1, never decreasing; empty: nothing moves
  double error = 0;          // share of its way by which something is elsewhere between two steps
  bool any() const { return !times.empty(); }
};

// What most files do without and a loader has work with, as indices of SceneData::parts. file_parts.h has their words.
enum class FilePart : uint8_t {
  Ktx2Images,
  AvifImages,
  MeshoptViews,
  DracoPrimitives,
  AnimatedProperties,  // of materials, cameras, lights, visibility: what KHR_animation_pointer moves in this pose
  HiddenNodes,
  RoundPrimitives,  // points and lines as spheres and rods
  ImageBasedLight
};
inline constexpr size_t kFileParts = 8;
using FilePartCounts = std::array<uint64_t, kFileParts>;

struct SceneData {
  std::string file;
  // Where the zero of all positions here lies in the coordinates of the file: a scene far from the file's own zero is
  // brought to it before its numbers become floats (recentre.h).
  glm::dvec3 origin{0};
  std::vector<TriangleMesh> meshes;
  std::vector<MeshInstance> instances;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<PunctualLight> lights;
  std::vector<CameraData> cameras;
  std::optional<EnvironmentData> environment;
  std::optional<Spectrum> backdrop;  // what the camera sees of the environment; none: the environment
  std::optional<Spectrum> ground;    // radiance of the ground where nothing shadows it; none: there is no ground
  SceneMotion motion;
  FilePartCounts parts{};

  // For `braid info`.
  std::vector<std::string> extensionsUsed, extensionsRequired, extensionsIgnored;
  std::vector<std::string> variants;
  std::vector<std::string> sceneNames;
  std::vector<AnimationClip> animations;
  std::vector<std::string> warnings;  // one line each, already counted
  std::vector<std::string> notes;     // flaws of what the picture does not use
  uint64_t contentHash = 0;           // over every referenced byte
  bool defaultCamera = false;         // the file had none: framingCamera()
  bool defaultLight = false;          // the file had none, or next to none: a dome, or a studio with a backdrop
};

}  // namespace braid
