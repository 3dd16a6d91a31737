// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_reference.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/exr.h"
#include "renderer/session/rendering_revision.h"
#include "tools/images/braid_image.h"
#include "tools/images/exr_metadata.h"

namespace braid {

namespace {

[[noreturn]] void refuse(const std::string& path, const std::string& reason) {
  throw Error(ExitCode::BadInput, fmt::format("{}: is no reference for this sweep: {}", path, reason));
}

std::string textOf(const ImageFile& file, const std::string& name) {
  const Attribute* a = findAttribute(file, name);
  return a ? a->text : std::string();
}

// Headers hold floats, so equal cameras agree to rounding.
bool sameMatrix(const Attribute* a, const Mat4& m) {
  if (!a || a->values.size() != 16) return true;  // nothing to compare with
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      const float v = a->values[static_cast<size_t>(4 * i + j)];
      if (!(std::fabs(v - m[i][j]) <= 1e-4f * std::max(1.0f, std::fabs(m[i][j])))) return false;
    }
  return true;
}

// Why a file of braid shows other pixels than this braid would make; empty: it does not.
std::string staleness(const ImageFile& file) {
  const Attribute* revision = findAttribute(file, "braid/renderingRevision");
  if (revision && revision->integer == kRenderingRevision) return "";
  return fmt::format("it was rendered at rendering revision {}, and this braid renders at {}",
                     revision ? std::to_string(revision->integer) : "0", kRenderingRevision);
}

// What files of braid say about themselves must agree.
void checkHeader(const ImageFile& file, const ReferenceFrame& frame, uint64_t firstSeed, uint64_t seeds) {
  if (!sameMatrix(findAttribute(file, "worldToCamera"), frame.worldToCamera) ||
      !sameMatrix(findAttribute(file, "worldToNDC"), frame.worldToNdc))
    refuse(file.path, "it was rendered with another camera; render it with the camera of the scene file");
  const std::string hash = textOf(file, "braid/sceneHash"), expected = hexString(frame.sceneHash);
  if (!hash.empty() && hash != expected)
    refuse(file.path,
           fmt::format("it shows another scene (content hash {} instead of {}); render it anew", hash, expected));
  if (const Attribute* depth = findAttribute(file, "braid/maxDepth"); depth && depth->integer != frame.maxDepth)
    refuse(file.path, fmt::format("it was rendered with --max-depth {}, the sweep uses {}; give both the same",
                                  depth->integer, frame.maxDepth));
  const std::string seed = textOf(file, "braid/seed");
  for (uint64_t k = 0; k < seeds; ++k)
    if (seed == std::to_string(firstSeed + k))
      refuse(file.path, fmt::format("it was rendered with seed {}, which a run of the sweep uses too, so that their "
                                    "errors are correlated; choose another --seed",
                                    seed));
}

// The estimate of the file to take: the preferred one if it is there, else the first with mean and halves.
std::string chooseEstimate(const ImageFile& file, const std::string& preferred) {
  const auto complete = [&](const std::string& name) {
    return hasLayer(file, name + ".mean") && hasLayer(file, name + ".halfA") && hasLayer(file, name + ".halfB");
  };
  if (complete(preferred)) return preferred;
  for (const std::string& name : estimateNames(file))
    if (complete(name)) return name;
  return {};
}

uint64_t hashOf(const Rgb<float>& image) {
  ContentHash hash;
  for (size_t c = 0; c < 3; ++c) hash.add(image[c].data.data(), image[c].size() * sizeof(float));
  return hash.value();
}

SweepReference toReference(const ImageFile& file, const std::string& integrator) {
  SweepReference r;
  r.file = file.path;
  const std::string estimate = chooseEstimate(file, integrator);
  r.image.mean = file.rgb(estimate.empty() ? "" : estimate + ".mean");
  if (!estimate.empty()) {
    r.integrator = estimate;
    r.passedOver = textOf(file, "braid/headline");
    r.image.half[0] = file.rgb(estimate + ".halfA");
    r.image.half[1] = file.rgb(estimate + ".halfB");
    if (const Attribute* passes = findAttribute(file, "braid/" + estimate + "/passes"))
      r.spp = static_cast<uint64_t>(std::max<int64_t>(0, passes->integer));
    if (const Attribute* seconds = findAttribute(file, "braid/" + estimate + "/seconds")) r.seconds = seconds->number;
  }
  r.contentHash = hashOf(r.image.mean);
  return r;
}

ImageFile readChecked(const std::string& path, const ReferenceFrame& frame, uint64_t firstSeed, uint64_t seeds) {
  ImageFile file = readImage(path);
  if (file.width != frame.width || file.height != frame.height)
    refuse(path, fmt::format("it has {}x{} pixels, the sweep renders {}x{}; give --size {}x{} or another reference",
                             file.width, file.height, frame.width, frame.height, file.width, file.height));
  if (findAttribute(file, "braid/version")) checkHeader(file, frame, firstSeed, seeds);
  return file;
}

}  // namespace

ReferenceFrame referenceFrame(const Scene& scene, const CameraData& camera, const Settings& settings,
                              const std::string& options) {
  const Camera view(camera, settings.width, settings.height);
  const glm::dvec3& origin = scene.data().origin;
  return {
      settings.width,    settings.height, view.worldToCamera(origin), view.worldToNdc(origin), scene.data().contentHash,
      settings.maxDepth, options};
}

std::string referenceName(const ReferenceFrame& frame) {
  ContentHash camera;
  camera.add(&frame.worldToCamera, sizeof(Mat4));
  camera.add(&frame.worldToNdc, sizeof(Mat4));
  ContentHash options;
  options.add(frame.options.data(), frame.options.size());
  return fmt::format("{}-{}x{}-{}-{}{}.exr", hexString(frame.sceneHash), frame.width, frame.height,
                     hexString(camera.value()), frame.maxDepth,
                     frame.options.empty() ? "" : "-" + hexString(options.value()));
}

SweepReference readReference(const std::string& path, const ReferenceFrame& frame, const std::string& integrator,
                             uint64_t firstSeed, uint64_t seeds) {
  const ImageFile file = readChecked(path, frame, firstSeed, seeds);
  if (findAttribute(file, "braid/version"))
    if (const std::string reason = staleness(file); !reason.empty()) refuse(path, reason + "; render it anew");
  return toReference(file, integrator);
}

std::optional<SweepReference> keptReference(const std::string& folder, const ReferenceFrame& frame,
                                            const std::string& integrator, uint64_t spp, std::string* stale) {
  const std::string path = folder + "/" + referenceName(frame);
  if (!std::filesystem::exists(path)) return {};
  const ImageFile file = readChecked(path, frame, 0, 0);
  if (const std::string reason = staleness(file); !reason.empty()) {
    if (stale) *stale = fmt::format("{}: {}: the reference is rendered again", path, reason);
    return {};
  }
  SweepReference reference = toReference(file, integrator);
  if (reference.integrator != integrator || reference.spp < spp || !reference.image.hasHalves()) return {};
  return reference;
}

std::optional<SweepReference> renderReference(const std::string& folder, const ReferenceJob& job,
                                              const Session::ProgressCallback& progress,
                                              const std::atomic<bool>* cancel) {
  const Scene& scene = job.scene;
  Settings settings = job.settings;
  settings.seed = kReferenceSeed;
  settings.spp += settings.spp % 2;
  settings.keep.features = false;
  Session session(scene, makePlan(scene, job.camera, settings, job.integrators));
  const RenderResult result = session.run(progress, cancel);
  if (result.reason == StopReason::Cancelled) return {};

  Estimates estimates = *result.estimates;
  estimates.attributes = headerAttributes(scene, session, result, scene.accel().isa(), true);
  ExrOptions exr;
  exr.floatHeadline = true;
  SweepReference reference;
  reference.file = folder + "/" + referenceName(referenceFrame(scene, job.camera, settings, job.options));
  writeExr(reference.file, estimates, result.image, nullptr, exr);
  const Estimate& e = estimates.estimates.front();
  reference.image = {e.mean, {e.half[0], e.half[1]}};
  reference.integrator = e.name;
  reference.spp = e.passes;
  reference.seconds = e.seconds;
  reference.contentHash = hashOf(e.mean);
  return reference;
}

}  // namespace braid
