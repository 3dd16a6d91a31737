// SPDX-License-Identifier: Apache-2.0
// KHR_draco_mesh_compression.
#include <algorithm>

#include <draco/compression/decode.h>

#include "renderer/scene/gltf/document/gltf_accessor.h"
#include "renderer/scene/gltf/gltf_mesh.h"

namespace braid::gltf {

namespace {

// Joint numbers stay numbers; colours and weights are fractions whatever the file says; others follow their accessor.
bool isFraction(const std::string& name, const Accessor& accessor) {
  if (name.starts_with("JOINTS_")) return false;
  return accessor.normalized || name.starts_with("COLOR_") || name.starts_with("WEIGHTS_");
}

float scaleOf(const Accessor& accessor) {
  switch (accessor.componentType) {
    case kI8:
      return 1.0f / 127;
    case kU8:
      return 1.0f / 255;
    case kI16:
      return 1.0f / 32767;
    case kU16:
      return 1.0f / 65535;
    default:
      return 1;
  }
}

bool copyAttribute(const draco::Mesh& mesh, const draco::PointAttribute& source, float scale,
                   DracoMesh::Attribute& out) {
  out.components = source.num_components();
  if (out.components < 1 || out.components > 4) return false;
  out.values.resize(size_t(mesh.num_points()) * out.components);
  const auto components = static_cast<int8_t>(out.components);
  for (draco::PointIndex point(0); point < mesh.num_points(); ++point) {
    const draco::AttributeValueIndex value = source.mapped_index(point);
    if (value.value() >= source.size()) return false;
    float* target = out.values.data() + size_t(point.value()) * out.components;
    if (!source.ConvertValue<float>(value, components, target)) return false;
    for (uint32_t c = 0; c < out.components; ++c)
      target[c] = std::max(target[c] * scale, scale == 1 ? target[c] : -1.0f);
  }
  return true;
}

bool copyIndices(const draco::Mesh& mesh, std::vector<uint32_t>& indices) {
  indices.reserve(size_t(mesh.num_faces()) * 3);
  for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face) {
    for (const draco::PointIndex& corner : mesh.face(face)) {
      if (corner.value() >= mesh.num_points()) return false;
      indices.push_back(corner.value());
    }
  }
  return true;
}

}  // namespace

std::optional<DracoMesh> decodeDraco(const Document& document, const MeshJob& job, Report& report) {
  const std::string where = job.place + "/extensions/KHR_draco_mesh_compression";
  const char* const without = "its uncompressed data is drawn, where there is any";
  const Value& json = member(job.primitive->extensions, "KHR_draco_mesh_compression");
  const Bytes data = document.views[static_cast<size_t>(index(json, "bufferView"))].data;
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    report.problem(where,
                   "cannot be decompressed (" + decoded.status().error_msg_string() + "); compress the file again",
                   without);
    return {};
  }
  const draco::Mesh& mesh = *decoded.value();
  DracoMesh out;
  out.vertices = mesh.num_points();
  bool valid = copyIndices(mesh, out.indices);
  const Value& ids = member(json, "attributes");
  for (const std::string& name : ids.Keys()) {
    const auto declared = job.primitive->attributes.find(name);
    if (declared == job.primitive->attributes.end()) continue;
    const Accessor& accessor = document.accessor(declared->second);
    const int id = index(ids, name.c_str());
    const draco::PointAttribute* source = mesh.GetAttributeByUniqueId(static_cast<uint32_t>(id));
    if (!source) {
      report.problem(where + "/attributes/" + name,
                     "is " + std::to_string(id) + ", which the compressed mesh does not hold; compress the file again",
                     "the attribute is left out");
      continue;
    }
    const bool whole = source->data_type() != draco::DT_FLOAT32 && source->data_type() != draco::DT_FLOAT64;
    valid = valid && copyAttribute(mesh, *source, whole && isFraction(name, accessor) ? scaleOf(accessor) : 1,
                                   out.attributes[name]);
  }
  if (valid) return out;
  report.problem(where, "holds values out of range; compress the file again", without);
  return {};
}

uint64_t estimatedBytes(const Document& document, const Primitive& primitive) {
  const auto position = primitive.attributes.find("POSITION");
  if (position == primitive.attributes.end() || primitive.mode < 4) return 0;
  const uint64_t vertices = document.accessor(position->second).count;
  const uint64_t indices = primitive.indices < 0 ? vertices : document.accessor(primitive.indices).count;
  const uint64_t triangles = primitive.mode == 4 ? indices / 3 : indices;
  // Vertices that no triangle uses are dropped. Decompressing the same data again and again would take for ever too.
  constexpr uint64_t kDracoRatio = 8;
  const int view = index(member(primitive.extensions, "KHR_draco_mesh_compression"), "bufferView");
  const uint64_t compressed = view < 0 ? 0 : document.views[static_cast<size_t>(view)].data.size() * kDracoRatio;
  return compressed + triangles * sizeof(glm::uvec3) + std::min(vertices, triangles * 3) * 2 * sizeof(Vec3);
}

}  // namespace braid::gltf
