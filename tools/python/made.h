// SPDX-License-Identifier: Apache-2.0
// What a render or a combination made, in the form that files hold. It never changes: arrays point into it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "combiners/pipeline/pipeline.h"
#include "renderer/film/files/exr.h"
#include "tools/options/combining.h"

namespace braid::python {

class Made {
 public:
  // Combines the estimates by the choice. Throws Error(BadInput) where a method that was asked for cannot run.
  Made(Estimates estimates, std::optional<Plane<float>> alpha, const CombineChoice& choice, int threads);
  Made(const Made&) = delete;
  Made& operator=(const Made&) = delete;

  // R, G, B, A, Albedo.R, pt.mean.R, …: the channels of an EXR file with all layers.
  const std::vector<ExrChannel>& planes() const { return planes_; }
  const Rgb<float>& image() const { return *image_; }
  const Estimates& estimates() const { return estimates_; }
  // By name: of the method that made the image; empty: nothing is combined.
  const std::string& method() const { return method_; }
  double combineSeconds() const { return combineSeconds_; }
  // relativeError() of the image, where it is known.
  std::optional<double> error() const { return error_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  // Writes the image in the format that the ending of the path says; with `all` layers where it is EXR, else with the
  // features. Returns a warning, or nothing. Throws Error(OutputFailed).
  std::string save(const std::string& path, bool all) const;

 private:
  ExrOptions exr(AovSet aovs) const;

  Estimates estimates_;
  std::optional<Plane<float>> alpha_;
  PipelineResult combined_;
  std::optional<CombinedLayers> layers_;
  const Rgb<float>* image_ = nullptr;
  Rgb<float> first_;
  std::string method_;
  double combineSeconds_ = 0;
  std::optional<double> error_;
  std::vector<std::string> warnings_;
  std::vector<ExrChannel> planes_;
};

}  // namespace braid::python
