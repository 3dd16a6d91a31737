// SPDX-License-Identifier: Apache-2.0
#include "tools/images/same_view.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr const char* kSceneHash = "braid/sceneHash";
constexpr const char* kCameras[] = {"worldToCamera", "worldToNDC"};  // braid, pbrt
constexpr const char* kBlender[] = {"Scene", "Camera", "Frame"};

const Attribute* find(const ImageFile& file, const std::string& name) {
  for (const Attribute& a : file.attributes)
    if (a.name == name) return &a;
  return nullptr;
}

bool same(const Attribute& a, const Attribute& b) {
  if (a.text != b.text || a.integer != b.integer || a.values.size() != b.values.size()) return false;
  float largest = 0;
  for (const float v : a.values) largest = std::max(largest, std::abs(v));
  for (size_t i = 0; i < a.values.size(); ++i)
    if (!(std::abs(a.values[i] - b.values[i]) <= 1e-5f * largest)) return false;
  return true;
}

// Whether both files have the attribute, with values that differ.
bool differs(const ImageFile& a, const ImageFile& b, const char* name) {
  const Attribute *one = find(a, name), *other = find(b, name);
  return one && other && !same(*one, *other);
}

bool agree(const ImageFile& a, const ImageFile& b, const char* name) {
  const Attribute *one = find(a, name), *other = find(b, name);
  return one && other && same(*one, *other);
}

[[noreturn]] void refuse(const ImageFile& first, const ImageFile& other, const std::string& what,
                         const std::string& mend) {
  throw Error(ExitCode::BadInput, fmt::format("{}: {} {}: {}", other.path, what, first.path, mend));
}

}  // namespace

ImageFile headOf(const ImageFile& file) {
  ImageFile head = file;
  head.planes.clear();
  return head;
}

std::vector<Attribute> viewAttributes(const ImageFile& file) {
  std::vector<Attribute> list;
  for (const char* name : {kSceneHash, "braid/scene", "worldToCamera", "worldToNDC", "Scene", "Camera", "Frame"})
    if (const Attribute* a = find(file, name)) list.push_back(*a);
  return list;
}

void requireSameView(const ImageFile& first, const ImageFile& other) {
  if (first.width != other.width || first.height != other.height)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {}x{} pixels, but the image that it belongs to, {}, has {}x{}", other.path,
                            other.width, other.height, first.path, first.width, first.height));
  const char* together = "combine images of one scene and one view";
  if (differs(first, other, kSceneHash)) refuse(first, other, "is of another scene than", together);
  // Renderers do not agree on coordinates.
  const bool braid = find(first, kSceneHash), alike = braid == (find(other, kSceneHash) != nullptr);
  if (!alike) return;
  for (const char* name : kCameras)
    if (differs(first, other, name)) refuse(first, other, "is seen by another camera than", together);
  for (const char* name : kBlender)
    if (differs(first, other, name))
      refuse(first, other, fmt::format("has another '{}' in its header than", name), together);
  const PixelWindow &a = first.window, &b = other.window;
  if (braid &&
      (a.x0 != b.x0 || a.y0 != b.y0 || first.fullWidth != other.fullWidth || first.fullHeight != other.fullHeight))
    refuse(first, other, "is another part of the frame than", together);
}

void requireOtherSeed(const ImageFile& first, const ImageFile& other) {
  if (agree(first, other, kSceneHash) && agree(first, other, "braid/seed"))
    refuse(first, other, "has the same samples (one seed of one scene) as",
           "render one of them with another --seed; shares of one render are added by braid merge");
}

}  // namespace braid
