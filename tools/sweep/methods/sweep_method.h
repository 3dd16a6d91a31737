// SPDX-License-Identifier: Apache-2.0
// What a sweep measures: a method as the integrators it needs and the way from their estimates to an image.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/kept_buffers.h"
#include "renderer/session/integrator.h"

namespace braid {

struct MethodShare {
  std::string integrator;
  int passes = 1;  // of every round
  bool operator==(const MethodShare&) const = default;
};

// What a method makes of estimates, and the seconds that took.
struct MethodImage {
  Rgb<float> image;  // empty when it could not run
  double denoiseSeconds = 0, combineSeconds = 0;
  std::string skipReason;       // why it could not
  std::optional<double> error;  // estimated by the method itself, as relativeError(); none where it says nothing
  bool failed = false;          // it was run and failed, as another denoiser's program may
};

// A method. Without `finish` it is an integrator, and its image is the mean of its only input. The estimates that
// `finish` gets may hold more integrators than the inputs: find() them by name. It also gets the mean of the scene's
// reference, for methods that are only there to compare with.
struct SweepMethod {
  std::string name;
  // The first one is the estimate that the method improves: its passes are the row's spp, and pixels count as better
  // or worse than its mean.
  std::vector<MethodShare> inputs;
  KeptBuffers buffers;  // what the estimates must hold
  std::function<MethodImage(const std::shared_ptr<const Estimates>&, const Rgb<float>& reference)> finish;
};

// One method for every integrator.
std::vector<SweepMethod> integratorMethods(const std::vector<const Integrator*>& integrators);

// The methods of these names, in this order, each once. Throws Error(Usage) naming an unknown one and the known ones.
std::vector<SweepMethod> chooseMethods(const std::vector<std::string>& names, const std::vector<SweepMethod>& known);

// Methods that one render session serves, as indices. Methods that share an integrator in equal numbers of passes share
// its render; integrators that no method uses together run in sessions of their own, so that none pays for buffers of
// another. Features are those of a session's first integrator: methods that read them share a render only if it is the
// first of their inputs for all, as in a render for the method alone (combiners/EXPERIMENTS.md, Features of a shared
// render). With `equalTime` only methods of the same inputs share a session: the others reach a time at different
// rounds.
std::vector<std::vector<size_t>> groupMethods(const std::vector<SweepMethod>& methods, bool equalTime);

}  // namespace braid
