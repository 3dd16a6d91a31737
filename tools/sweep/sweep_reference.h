// SPDX-License-Identifier: Apache-2.0
// References of a sweep: EXR files with two independent halves, rendered once and kept under a name that says what they
// show, or given by the user; checked against the frame that the sweep renders.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/scene.h"
#include "renderer/session/session.h"
#include "tools/sweep/table/sweep_error.h"

namespace braid {

// Far from the seeds of runs, which are below 2⁶³: errors against a reference of the run's own seed would vanish.
inline constexpr uint64_t kReferenceSeed = uint64_t(1) << 63;

// What a reference has to show.
struct ReferenceFrame {
  int width = 0, height = 0;
  Mat4 worldToCamera{1}, worldToNdc{1};
  uint64_t sceneHash = 0;
  int maxDepth = 0;
  std::string options;  // what options change in the file: changedOptions()
};
ReferenceFrame referenceFrame(const Scene& scene, const CameraData& camera, const Settings& settings,
                              const std::string& options = "");

// <scene hash>-<width>x<height>-<camera hash>-<depth>.exr; before the ending the hash of the options, if there are any.
std::string referenceName(const ReferenceFrame& frame);

struct SweepReference {
  ReferenceImage image;
  std::string file, integrator;  // no integrator: an image of another renderer
  std::string passedOver;        // the combined image that the file shows first: its halves are not independent
  uint64_t spp = 0;              // 0: not known
  double seconds = 0;            // that its render took, 0: not known
  uint64_t contentHash = 0;      // over the mean
};

// Reads and checks an EXR. The preferred integrator's layers are taken where there are several; an image without halves
// serves too, but then its own noise is part of every error. Throws Error(BadInput) naming what differs: size, and for
// files of braid also camera, scene, depth, rendering revision, and a seed in [firstSeed, firstSeed + seeds).
SweepReference readReference(const std::string& path, const ReferenceFrame& frame, const std::string& integrator,
                             uint64_t firstSeed, uint64_t seeds);

// The kept reference of the frame if it was rendered by this integrator at this rendering revision with at least so
// many samples, or nothing; then `stale`, unless null, gets a sentence if the revision is the reason. Throws
// Error(BadInput) when the file shows something else than its name says.
std::optional<SweepReference> keptReference(const std::string& folder, const ReferenceFrame& frame,
                                            const std::string& integrator, uint64_t spp, std::string* stale = nullptr);

// What a reference is rendered of: `settings.integrators` names the integrator and `settings.spp` the samples, rounded
// up to an even number for two equal halves.
struct ReferenceJob {
  const Scene& scene;
  const CameraData& camera;
  const Settings& settings;
  const std::vector<const Integrator*>& integrators;
  std::string options = "";  // as in ReferenceFrame
};

// Renders a reference and keeps it in the folder; nothing when cancelled.
std::optional<SweepReference> renderReference(const std::string& folder, const ReferenceJob& job,
                                              const Session::ProgressCallback& progress,
                                              const std::atomic<bool>* cancel);

}  // namespace braid
