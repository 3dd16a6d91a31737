// SPDX-License-Identifier: Apache-2.0
#include "combiners/regression/regression_features.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

// Files of other renderers may hold means only: both halves then see the mean.
template <class P>
const P& select(const FeaturePlanes<P>& planes, Samples samples) {
  const P& half = planes.half[samples == Samples::HalfB ? 1 : 0];
  return samples == Samples::All || half.empty() ? planes.mean : half;
}

float percentile(const Plane<float>& in, double fraction) {
  std::vector<float> values(in.data.begin(), in.data.end());
  const auto k = static_cast<size_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

bool varies(const FeatureGroup& group) {
  return std::any_of(group.begin(), group.end(), [](const Plane<float>* p) {
    return std::any_of(p->data.begin(), p->data.end(), [p](float v) { return v != p->data[0]; });
  });
}

}  // namespace

RegressionFeatures::RegressionFeatures(const Features* features, Samples samples)
    : features_(features), samples_(samples) {
  if (!features || features->depth.mean.empty()) return;
  depth_ = select(features->depth, samples);
  const float far = percentile(features->depth.mean, 0.999);
  if (far > 0 && std::isfinite(far))
    for (float& d : depth_.data) d /= far;
}

std::vector<FeatureGroup> RegressionFeatures::groups() const {
  std::vector<FeatureGroup> list;
  if (!features_) return list;
  const auto addColour = [&list](const Rgb<float>& p) {
    if (!p.empty()) list.push_back({&p[0], &p[1], &p[2]});
  };
  addColour(select(features_->albedo, samples_));
  addColour(select(features_->normal, samples_));
  if (!depth_.empty()) list.push_back({&depth_});
  const Plane<float>& visibility = select(features_->visibility, samples_);
  if (!visibility.empty()) list.push_back({&visibility});
  std::erase_if(list, [](const FeatureGroup& group) { return !varies(group); });
  return list;
}

}  // namespace braid
