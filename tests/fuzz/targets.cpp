// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/targets.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "braid/braid.h"
#include "combiners/denoise/oidn/oidn_unet.h"
#include "combiners/learned/tza.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/state_file.h"
#include "renderer/scene/data/gltf.h"
#include "renderer/scene/data/textures/texture.h"
#include "tools/images/estimates_file.h"

namespace braid::fuzz {

namespace {

namespace fs = std::filesystem;

// A file in memory where the system has such a folder; its name is this process's own.
std::string scratch(const char* extension) {
  static const fs::path folder = fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path();
  return (folder / fmt::format("braid-fuzz-{}.{}", ::getpid(), extension)).string();
}

void write(const std::string& path, const void* data, size_t bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
}

void require(bool ok, const char* what) {
  if (!ok) throw std::logic_error(what);
}

// One line a problem and nothing that steers a terminal, however strange the file was.
void checkMessage(const Error& error) {
  const auto* scene = dynamic_cast<const SceneError*>(&error);
  const std::string text = error.what();
  const auto lines = static_cast<size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  require(lines == (scene ? scene->problems().size() : 1), "a message has more lines than problems");
  for (const char c : text)
    require(static_cast<unsigned char>(c) >= 0x20 || c == '\n', "a message has control characters");
}

void checkLine(const std::string& line) {
  for (const char c : line) require(static_cast<unsigned char>(c) >= 0x20, "a warning has control characters");
}

template <class Run>
void expectingErrors(const Run& run) {
  try {
    run();
  } catch (const Error& error) {
    require(error.code() != ExitCode::Internal, error.what());
    checkMessage(error);
  }
}

void append(std::vector<uint8_t>& out, const void* data, size_t bytes) {
  const auto* p = static_cast<const uint8_t*>(data);
  out.insert(out.end(), p, p + bytes);
}

void appendChunk(std::vector<uint8_t>& out, uint32_t kind, Input data, uint8_t padding) {
  const auto size = static_cast<uint32_t>((data.size() + 3) / 4 * 4);
  append(out, &size, 4);
  append(out, &kind, 4);
  append(out, data.data(), data.size());
  out.resize(out.size() + size - data.size(), padding);
}

std::vector<uint8_t> asGlb(Input input) {
  if (input.size() >= 4 && std::memcmp(input.data(), "glTF", 4) == 0) return {input.begin(), input.end()};
  const auto json = static_cast<size_t>(std::find(input.begin(), input.end(), 0) - input.begin());
  std::vector<uint8_t> glb(12);
  appendChunk(glb, 0x4E4F534A, input.first(json), ' ');
  if (json + 1 < input.size()) appendChunk(glb, 0x004E4942, input.subspan(json + 1), 0);
  const uint32_t header[3] = {0x46546C67, 2, static_cast<uint32_t>(glb.size())};
  std::memcpy(glb.data(), header, sizeof header);
  return glb;
}

void renderOnce(const Scene& scene) {
  Settings settings;
  settings.width = settings.height = 4;
  settings.spp = 1;
  settings.maxDepth = 4;
  settings.threads = 1;
  const Rendering rendering = render(scene, plan(scene, settings));
  for (const auto& [name, plane] : rendering.planes)
    for (const float v : plane.data) require(std::isfinite(v) || name == "Depth.Z", "a pixel is not finite");
}

}  // namespace

void gltf(Input input) {
  constexpr size_t kMostRendered = 20000;  // triangles
  const std::string path = scratch("glb");
  const std::vector<uint8_t> glb = asGlb(input);
  write(path, glb.data(), glb.size());
  LoadOptions options;
  options.frameTime = 0.5f;
  options.pointRadius = 0.1f;
  options.ignoredExtensions = {"ACME_gizmo"};
  // What is left of a broken scene is rendered; the strict way must end in a message or in the same scene.
  expectingErrors([&] {
    const auto scene = load(path, options);
    for (const std::string& line : scene->data().warnings) checkLine(line);
    for (const std::string& line : scene->data().notes) checkLine(line);
    if (scene->traits().instancedTriangles <= kMostRendered) renderOnce(*scene);
  });
  options.strict = true;
  options.keepAllAttributes = true;
  expectingErrors([&] { loadGltf(path, options); });
}

namespace {

void sampleTexture(Input input) {
  expectingErrors([&] {
    const auto decoded = decodeImage(input.data(), input.size(), "fuzz");
    for (const float v : decoded->floats) require(std::isfinite(v) && v >= 0, "a texel is not finite");
    const Texture sampler(decoded, true, Wrap::Repeat, Wrap::Mirror, Filter::Linear);
    for (const Vec2 uv : {Vec2(0), Vec2(1), Vec2(-1e30f, 0.5f), Vec2(NAN, 2.5f)})
      require(std::isfinite(sampler.sample(uv).x), "a sample of a texture is not finite");
  });
}

}  // namespace

void texture(Input input) { sampleTexture(input); }

void ktx2(Input input) {
  constexpr size_t kWidth = 20, kHeight = 24, kBytes = 4;
  std::vector<uint8_t> file(input.begin(), input.end());
  for (const size_t side : {kWidth, kHeight})
    for (size_t i = side + 1; i < std::min(side + kBytes, file.size()); ++i) file[i] = 0;
  sampleTexture(file);
}

void image(Input input) {
  const std::string path = scratch("exr");
  write(path, input.data(), input.size());
  expectingErrors([&] {
    std::vector<std::string> notes;
    ReadOptions options;
    options.notes = &notes;
    readEstimates(readImage(path), options);
  });
}

void state(Input input) {
  const auto header = static_cast<size_t>(std::find(input.begin(), input.end(), 0) - input.begin());
  const Input planes = input.subspan(std::min(header + 1, input.size()));
  const std::string first = fmt::format("braid-state {} {} {}\n", kStateFormat, header, planes.size());
  std::vector<uint8_t> file;
  append(file, first.data(), first.size());
  append(file, input.data(), header);
  append(file, planes.data(), planes.size());
  ContentHash hash;
  hash.add(file.data(), file.size());
  const std::string checksum = hexString(hash.value()) + '\n';
  append(file, checksum.data(), checksum.size());
  const std::string path = scratch("state");
  write(path, file.data(), file.size());
  expectingErrors([&] {
    const FilmState read = readStateFile(path);
    estimatesOf(read, true);
    overlap(read, readStateHeader(path));
    const std::string again = scratch("again.state");
    writeStateFile(again, read);
    readStateFile(again);
  });
}

void weights(Input input) {
  expectingErrors([&] {
    WeightTensors tensors = parseTza(input, "weights.tza");
    for (const auto& [name, tensor] : tensors)
      for (const float value : tensor.values) require(std::isfinite(value), "a weight is not finite");
    graphOf(oidnUnet(std::move(tensors)));
  });
}

const std::vector<Target>& targets() {
  static const std::vector<Target> all{{"gltf", gltf},   {"texture", texture}, {"ktx2", ktx2},
                                       {"image", image}, {"state", state},     {"weights", weights}};
  return all;
}

}  // namespace braid::fuzz
