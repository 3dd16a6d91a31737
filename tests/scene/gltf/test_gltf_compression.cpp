// SPDX-License-Identifier: Apache-2.0
// Compressed glTF geometry: Draco and meshopt.
#include "tests/support/gltf_fixture.h"

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>

namespace braid::test_gltf_compression {

using namespace test;

TEST_CASE("gltf: Draco meshes") {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const float a[3] = {0, 0, 0}, b[3] = {1, 0, 0}, c[3] = {1, 1, 0}, d[3] = {0, 1, 0};
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(0), a, b, c);
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(1), a, c, d);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  draco::EncoderBuffer encoded;
  REQUIRE(draco::Encoder().EncodeMeshToBuffer(*mesh, &encoded).ok());

  GltfFile file = quadFile();
  file.root["extensionsRequired"] = file.root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  const int view = file.view(std::vector<char>(encoded.data(), encoded.data() + encoded.size()));
  const int position = file.append("accessors", {{"componentType", 5126}, {"type", "VEC3"}, {"count", 4}});
  const int indices = file.append("accessors", {{"componentType", 5123}, {"type", "SCALAR"}, {"count", 6}});
  file.primitive() = {
      {"attributes", {{"POSITION", position}}},
      {"indices", indices},
      {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", 0}}}}}}}};
  SUBCASE("decode") {
    const SceneData scene = file.load();
    CHECK(scene.parts[static_cast<size_t>(FilePart::DracoPrimitives)] == 1);
    const TriangleMesh decoded = onlyMesh(scene);
    CHECK(decoded.triangles.size() == 2);
    CHECK(decoded.positions.size() == 4);
    Bounds bounds;
    for (const Vec3& p : decoded.positions) bounds.extend(p);
    CHECK(glm::length(bounds.lo) < 1e-3f);
    CHECK(glm::length(bounds.hi - Vec3(1, 1, 0)) < 1e-3f);
  }
  SUBCASE("broken data") {
    file.root["bufferViews"][static_cast<size_t>(view)]["byteLength"] = encoded.size() / 2;
    CHECK_ERROR(file, "cannot be decompressed");
  }
  SUBCASE("an attribute that is not there") {
    file.primitive()["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] = 9;
    CHECK_ERROR(file, "which the compressed mesh does not hold");
  }
}

TEST_CASE("gltf: meshopt compression with a fallback buffer that has no data") {
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::vector<uint32_t> indices{0, 1, 2, 0, 2, 3};
  std::vector<uint8_t> packedVertices(meshopt_encodeVertexBufferBound(4, 12)),
      packedIndices(meshopt_encodeIndexBufferBound(6, 4));
  packedVertices.resize(
      meshopt_encodeVertexBuffer(packedVertices.data(), packedVertices.size(), positions.data(), 4, 12));
  meshopt_encodeIndexVersion(1);
  packedIndices.resize(meshopt_encodeIndexBuffer(packedIndices.data(), packedIndices.size(), indices.data(), 6));

  for (const std::string name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    CAPTURE(name);
    GltfFile file = quadFile();
    file.root["extensionsRequired"] = file.root["extensionsUsed"] = {name};
    const int v = file.view(packedVertices), i = file.view(packedIndices);
    const auto compress = [&](int source, Json extension, uint64_t offset, uint64_t length) {
      const Json raw = file.root["bufferViews"][static_cast<size_t>(source)];
      extension["buffer"] = 0;
      extension["byteOffset"] = raw["byteOffset"];
      extension["byteLength"] = raw["byteLength"];
      return file.append(
          "bufferViews",
          {{"buffer", 1}, {"byteOffset", offset}, {"byteLength", length}, {"extensions", {{name, extension}}}});
    };
    const int vertexView = compress(v, {{"byteStride", 12}, {"count", 4}, {"mode", "ATTRIBUTES"}}, 0, 48);
    const int indexView = compress(i, {{"byteStride", 2}, {"count", 6}, {"mode", "TRIANGLES"}}, 48, 12);
    file.root["buffers"] = {{{"byteLength", file.binary.size()}},
                            {{"byteLength", 60}, {"extensions", {{name, {{"fallback", true}}}}}}};
    const int p =
        file.append("accessors", {{"bufferView", vertexView}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 4}});
    const int t = file.append("accessors",
                              {{"bufferView", indexView}, {"componentType", 5123}, {"type", "SCALAR"}, {"count", 6}});
    file.primitive() = {{"attributes", {{"POSITION", p}}}, {"indices", t}};
    const SceneData scene = file.load();
    CHECK(onlyMesh(scene).triangles.size() == 2);
    CHECK(onlyMesh(scene).positions[2] == Vec3(1, 1, 0));
    CHECK(scene.parts[static_cast<size_t>(FilePart::MeshoptViews)] == 2);

    Json& extension = file.root["bufferViews"][static_cast<size_t>(vertexView)]["extensions"][name];
    extension["count"] = 1e9;
    CHECK_ERROR(file, "more than the view can hold");
    extension["count"] = 4;
    extension["byteLength"] = 5;
    CHECK_ERROR(file, "cannot be decompressed");
    extension["byteLength"] = 1e6;
    CHECK_ERROR(file, "correct byteOffset and byteLength");
  }
}

}  // namespace braid::test_gltf_compression
