// SPDX-License-Identifier: Apache-2.0
// The features of the first non-specular vertex of a camera path (renderer/README.md, Features), expanded from
// features.def.
#pragma once

#include <array>
#include <string_view>

#include "renderer/core/plane.h"

namespace braid {

// What files and words call a feature. Its layers are "<layer>" and, for halves and the variance of the mean,
// "<layer>A",
// "<layer>B" and "<layer>Variance", with one channel a component.
struct FeaturePlane {
  const char* name;
  const char* layer;
  std::string_view components;
  bool anySize;
};

inline constexpr std::array kFeaturePlanes = {
#define FEATURE(name, Type, layer, components, anySize) FeaturePlane{#name, layer, components, anySize},
#include "renderer/film/features.def"
#undef FEATURE
};

// Of all features together.
inline constexpr size_t kFeatureComponents = [] {
  size_t count = 0;
  for (const FeaturePlane& f : kFeaturePlanes) count += f.components.size();
  return count;
}();

struct FeatureSample {
#define FEATURE(name, Type, ...) Type name{0};
#include "renderer/film/features.def"
#undef FEATURE

  // What shines is white, however brightly: features do not scale with the light.
  void setAlbedo(const Spectrum& value) { albedo = glm::clamp(value, Spectrum(0), Spectrum(1)); }

  std::array<float, kFeatureComponents> values() const {
    std::array<float, kFeatureComponents> list{};
    float* next = list.data();
    const auto append = [&next](const auto& value) {
      if constexpr (requires { value.z; })
        for (const float v : {value.x, value.y, value.z}) *next++ = v;
      else
        *next++ = value;
    };
#define FEATURE(name, ...) append(name);
#include "renderer/film/features.def"
#undef FEATURE
    return list;
  }
};

// Mean, halves and variance of the mean of one feature.
template <class P>
struct FeaturePlanes {
  P mean, half[2], variance;
};

namespace feature {
Rgb<float> imageOf(const Vec3&);
Plane<float> imageOf(float);
}  // namespace feature

struct Features {
#define FEATURE(name, Type, ...) FeaturePlanes<decltype(feature::imageOf(Type{}))> name;
#include "renderer/film/features.def"
#undef FEATURE
};

// Calls visit(planes) for every feature, or visit(planes of one, the same of the other).
template <class F, class Visit>
void forEachFeature(F& features, const Visit& visit) {
#define FEATURE(name, ...) visit(features.name);
#include "renderer/film/features.def"
#undef FEATURE
}
template <class Visit>
void forEachFeature(const Features& from, Features& to, const Visit& visit) {
#define FEATURE(name, ...) visit(from.name, to.name);
#include "renderer/film/features.def"
#undef FEATURE
}

}  // namespace braid
