// SPDX-License-Identifier: Apache-2.0
// Bytes that are no glTF, files outside of the folder and sizes that lie are refused; nothing crashes, hangs or takes
// unbounded memory.
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test_gltf_errors_containers {

using namespace test;

namespace {

std::string errorOfBytes(const std::string& bytes, const std::string& name = "a.gltf") {
  const Folder folder;
  const std::string path = folder.write(name, bytes);
  LoadOptions options;
  options.strict = true;
  return errorOf([&] { loadGltf(path, options); });
}

#define CHECK_BYTES(bytes, part)                  \
  do {                                            \
    const std::string text = errorOfBytes(bytes); \
    INFO("error: ", text);                        \
    CHECK(contains(text, part));                  \
  } while (false)

}  // namespace

TEST_CASE("gltf errors: files that are no glTF at all") {
  CHECK_BYTES("", "is empty");
  CHECK_BYTES("   \n", "is empty");
  CHECK_BYTES("hello", "neither GLB nor valid JSON");
  CHECK_BYTES("{\"asset\": ", "neither GLB nor valid JSON");
  CHECK_BYTES("\xFF\xFE{", "UTF-16");
  CHECK_BYTES("{\"a\": \"\xC3\x28\"}", "holds bytes that are not UTF-8");
  CHECK_BYTES("[]", "must be an object");
  CHECK_BYTES("{}", "/asset: is missing");
  CHECK_BYTES(R"({"asset":{"version":"1.0"}})", "/asset/version: is '1.0'");
  CHECK_BYTES(R"({"asset":{"version":"2.0","minVersion":"2.1"}})", "/asset/minVersion");
  CHECK_BYTES(R"({"asset":{"version":2}})", "must be text in quotes");
  CHECK_BYTES(std::string(100000, '['), "neither GLB nor valid JSON");
  CHECK(contains(errorOf([] { loadGltf("/no/such/file.gltf"); }), "does not exist"));
  CHECK(contains(errorOf([] { loadGltf("/"); }), "not a regular file"));
  CHECK(contains(errorOf([] { loadGltf("/dev/zero"); }), "not a regular file"));
}

TEST_CASE("gltf errors: files of other formats, and what helps") {
  CHECK_BYTES("BLENDER-v304RENDH", "is a file of Blender; open it in Blender, say, and export glTF 2.0");
  CHECK_BYTES("Kaydara FBX Binary  ", "is FBX; ");
  CHECK_BYTES("# Wavefront\nv 0 0 0\n", "such as Wavefront OBJ; ");
  CHECK_BYTES("mtllib a.mtl\n", "is Wavefront OBJ; ");
  CHECK_BYTES("ply\nformat ascii 1.0\n", "is PLY; ");
  CHECK_BYTES("#usda 1.0\n", "is USD; ");
  CHECK_BYTES("<?xml version=\"1.0\"?><COLLADA/>", "COLLADA");
  CHECK_BYTES(std::string("PK\x03\x04\0\0", 6), "is a ZIP archive (USDZ is one, too); unpack it");
  CHECK_BYTES(std::string("\x1F\x8B\x08\0", 4), "is compressed (gzip)");
  CHECK_BYTES(std::string("\x76\x2F\x31\x01\0", 5), "is an OpenEXR image; `braid info`, `combine`");
  CHECK_BYTES(std::string("MM\0*", 4), "is a TIFF image");
  CHECK_BYTES(std::string("MM\x20\0", 4), "is 3DS");
  CHECK_BYTES("#?RADIANCE\n", "is an HDR image");
  CHECK_BYTES("version https://git-lfs.github.com/spec/v1\noid sha256:0\n",
              "is a pointer of Git LFS, not the file itself");
  CHECK_BYTES("<!doctype HTML><title>404</title>", "is a web page, not the file itself");
  CHECK_BYTES("v", "neither GLB nor valid JSON");  // too short to tell
}

TEST_CASE("gltf errors: buffers that are pointers of Git LFS or web pages say so") {
  const Folder folder;
  GltfFile file = triangleFile();
  file.root["buffers"] = {{{"byteLength", 36}, {"uri", "a.bin"}}};
  for (const auto& [bytes, what] :
       {std::pair("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 36\n", "git lfs pull"),
        std::pair("<!DOCTYPE html><title>not here, not here, not here</title>", "is a web page")}) {
    folder.write("a.bin", bytes);
    const std::string path = folder.write("a.gltf", file.root.dump());
    LoadOptions strict;
    strict.strict = true;
    CHECK(contains(errorOf([&] { loadGltf(path, strict); }), what));
  }
}

TEST_CASE("gltf errors: deep JSON does not overflow the stack") {
  const std::string deep = std::string(1000000, '[') + std::string(1000000, ']');
  CHECK_BYTES("{\"asset\":{\"version\":\"2.0\"},\"nodes\":" + deep + "}", "/nodes/0");
}

TEST_CASE("gltf errors: broken GLB containers") {
  const std::string json = chunk(kJsonChunk, R"({"asset":{"version":"2.0"}})", ' ');
  std::string good = glbOf(json);
  CHECK_BYTES(good.substr(0, 15), "truncated");
  CHECK_BYTES(good.substr(0, good.size() - 4), "truncated: its header says");
  CHECK_BYTES(glbOf(chunk(kBinaryChunk, "abcd", ' ')), "does not begin with a JSON chunk");
  std::string version = good;
  version[4] = 1;
  CHECK_BYTES(version, "GLB version 1");
  std::string overrun = good;
  overrun[15] = 0x7f;
  CHECK_BYTES(overrun, "runs past the end");
}

TEST_CASE("gltf errors: URIs that leave the folder or the machine") {
  GltfFile file = triangleFile();
  const auto withUri = [&](const std::string& uri) {
    file.root["buffers"] = {{{"byteLength", 36}, {"uri", uri}}};
    return file;
  };
  CHECK_ERROR(withUri("../a.bin"), "leads out of the scene's folder");
  CHECK_ERROR(withUri("b/../../a.bin"), "leads out of the scene's folder");
  CHECK_ERROR(withUri("%2e%2e/a.bin"), "leads out of the scene's folder");
  CHECK_ERROR(withUri("..\\a.bin"), "leads out of the scene's folder");
  CHECK_ERROR(withUri("/etc/passwd"), "leads out of the scene's folder");
  CHECK_ERROR(withUri("file:///etc/passwd"), "is not relative");
  CHECK_ERROR(withUri("http://example.com/a.bin"), "is not relative");
  CHECK_ERROR(withUri("c:/a.bin"), "is not relative");
  CHECK_ERROR(withUri("a%00.bin"), "is not a file name");
  CHECK_ERROR(withUri("missing.bin"), "/buffers/0/uri: file 'missing.bin' does not exist");
  CHECK_ERROR(withUri("data:application/octet-stream;base64,***"), "base64");
  CHECK_ERROR(withUri("data:oops"), "without a comma");
  CHECK_ERROR(withUri("data:;base64,AAAA"), "/buffers/0/byteLength: is 36, but the data has 3 bytes");
}

TEST_CASE("gltf errors: symbolic links out of the folder") {
  const Folder folder;
  const std::string outside = folder.write("outside/a.bin", std::string(36, '\0'));
  GltfFile file = triangleFile();
  file.root["buffers"] = {{{"byteLength", 36}, {"uri", "a.bin"}}};
  const std::string scene = folder.write("scene/scene.gltf", file.root.dump());
  fs::create_symlink(outside, folder.path / "scene/a.bin");
  const std::string text = errorOf([&] { loadGltf(scene); }, ExitCode::BadInput);
  CHECK(contains(text, "/buffers/0/uri: 'a.bin' is a link out of the scene's folder; copy the file there"));
  LoadOptions trusting;
  trusting.allowExternal = true;
  CHECK_NOTHROW(loadGltf(scene, trusting));
  // Links that stay inside, and a scene that is a link itself, are no matter.
  fs::remove(folder.path / "scene/a.bin");
  folder.write("scene/data/b.bin", std::string(36, '\0'));
  fs::create_symlink("data/b.bin", folder.path / "scene/a.bin");
  CHECK_NOTHROW(loadGltf(scene));
  fs::create_directory_symlink(folder.path / "scene", folder.path / "elsewhere");
  CHECK_NOTHROW(loadGltf((folder.path / "elsewhere/scene.gltf").string()));
}

TEST_CASE("gltf errors: sizes that lie are refused before anything is allocated") {
  GltfFile file = triangleFile();
  Json& accessor = file.root["accessors"][0];
  Json& view = file.root["bufferViews"][0];
  SUBCASE("buffer") {
    file.root["buffers"] = {{{"byteLength", 1e15}}};
    CHECK_ERROR(file, "/buffers/0/byteLength: is 1000000000000000, but the data has 36");
  }
  SUBCASE("view") {
    view["byteLength"] = 1e300;
    CHECK_ERROR(file, "/bufferViews/0/byteLength: is 1e+300; it must be a whole number");
  }
  SUBCASE("view beyond its buffer") {
    view["byteOffset"] = 4;
    CHECK_ERROR(file, "/bufferViews/0: covers bytes 4 to 40 of buffer 0, which has 36");
  }
  SUBCASE("negative") {
    view["byteOffset"] = -4;
    CHECK_ERROR(file, "/bufferViews/0/byteOffset: is -4");
  }
  SUBCASE("accessor") {
    accessor["count"] = 9007199254740991;
    CHECK_ERROR(file, "/accessors/0: needs 9007199254740991 elements of 12 bytes");
  }
  SUBCASE("accessor offset") {
    accessor["byteOffset"] = 4;
    CHECK_ERROR(file, "/accessors/0: needs 3 elements");
  }
  SUBCASE("stride") {
    view["byteStride"] = 8;
    CHECK_ERROR(file, "/bufferViews/0/byteStride: is 8, less than the 12 bytes");
  }
  SUBCASE("zeros without data") {
    accessor.erase("bufferView");
    accessor["count"] = 1e12;
    CHECK_ERROR(file, "too many for an accessor without a bufferView");
  }
  SUBCASE("sparse") {
    accessor["sparse"] = {
        {"count", 4}, {"indices", {{"bufferView", 0}, {"componentType", 5121}}}, {"values", {{"bufferView", 0}}}};
    CHECK_ERROR(file, "/accessors/0/sparse/count: is 4, more than");
  }
  SUBCASE("sparse indices") {
    const int indices = file.view<uint8_t>({2, 1}), values = file.view<float>({0, 0, 0, 0, 0, 0});
    file.root["accessors"][0]["sparse"] = {{"count", 2},
                                           {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                           {"values", {{"bufferView", values}}}};
    CHECK_ERROR(file, "/accessors/0/sparse/indices: must increase");
  }
}

}  // namespace braid::test_gltf_errors_containers
