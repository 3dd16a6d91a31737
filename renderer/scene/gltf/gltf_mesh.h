// SPDX-License-Identifier: Apache-2.0
// One primitive of a glTF mesh to a TriangleMesh: decompression, triangulation, morphing, skinning, repairs, tangents.
#pragma once

#include <memory>
#include <vector>

#include "renderer/scene/data/round_shapes.h"
#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/gltf_material.h"

namespace braid::gltf {

// What its vertices follow.
struct MeshPose {
  std::vector<float> weights;  // of the morph targets
  // Joint to world times inverse bind, zero for joints that do not exist; null: not skinned.
  std::shared_ptr<const std::vector<glm::dmat4>> joints;
};

struct MeshJob : MeshPose {
  const Primitive* primitive = nullptr;
  std::string place;  // JSON pointer of the primitive
  std::string name;
  uint32_t material = 0;  // index into SceneData::materials
  MaterialTable::Uvs uvs;
  bool needsTangents = false;
  bool keepAllAttributes = false;
  RoundShape round;             // of points and lines
  glm::dvec3 origin{0};         // taken from skinned positions
  std::vector<MeshPose> later;  // at the steps 1, 2, … of the scene's motion; empty: it keeps its shape
};

// What a compressed mesh holds, with attributes by name.
struct DracoMesh {
  struct Attribute {
    uint32_t components = 0;
    std::vector<float> values;
  };
  uint64_t vertices = 0;
  std::map<std::string, Attribute> attributes;
  std::vector<uint32_t> indices;
};

// gltf_draco.cpp: nothing, with a problem reported, if the data is broken.
std::optional<DracoMesh> decodeDraco(const Document& document, const MeshJob& job, Report& report);

// Thread-safe for distinct reports. An empty mesh if there is nothing to draw.
TriangleMesh buildMesh(const Document& document, const MeshJob& job, Report& report);

// The same at all steps of its motion. One whose triangles are others at another step stands still, with a warning.
TriangleMesh buildMovingMesh(const Document& document, const MeshJob& job, Report& report);

// Whether Draco holds its attributes.
bool isPacked(const Primitive& primitive);

// RoundShape::level of all points and lines: the finest of which they together have few enough triangles. Throws
// SceneError where the coarsest is too much.
int roundLevel(const Document& document, const std::vector<MeshJob>& jobs);

// Memory a built primitive takes at most, from the counts of its accessors, but for points and lines.
uint64_t estimatedBytes(const Document& document, const Primitive& primitive);

}  // namespace braid::gltf
