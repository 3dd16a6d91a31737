// SPDX-License-Identifier: Apache-2.0
// Lobes that cover the base of a surface, one upon the other. Each reflects, and leaves part of the light to what lies
// below it. The plain diffuse path must not pay for covers: their members stay uninitialised until init(). What
// the class of a cover has: renderer/README.md, Adding a lobe.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>

#include "renderer/transport/bsdf/scattering.h"

namespace braid {

// What most covers have in common.
struct CoverLobe {
  bool smooth() const { return false; }  // a mirror: nothing to evaluate
  bool broad() const { return true; }    // LobeGroup
  void turn() {}                         // the same surface, seen from its other side
};

// The covers of a surface, from the base up.
template <class... L>
struct CoverList : L... {
  static constexpr size_t kCount = sizeof...(L);
  struct Parameters : L::Parameters... {};

  // visit(cover, index) for each.
  template <size_t I = 0, class Visit>
  void upward(const Visit& visit) {
    if constexpr (I < kCount) {
      visit(static_cast<At<I>&>(*this), I);
      upward<I + 1>(visit);
    }
  }
  template <size_t I = 0, class Visit>
  void upward(const Visit& visit) const {
    if constexpr (I < kCount) {
      visit(static_cast<const At<I>&>(*this), I);
      upward<I + 1>(visit);
    }
  }
  template <size_t I = kCount, class Visit>
  void downward(const Visit& visit) const {
    if constexpr (I > 0) {
      visit(static_cast<const At<I - 1>&>(*this), I - 1);
      downward<I - 1>(visit);
    }
  }
  // Of each cover's class.
  static constexpr uint32_t kLobes = (L::kLobe | ... | 0u);
  static constexpr std::array<uint32_t, sizeof...(L)> kLobe{L::kLobe...};
  static constexpr std::array<bool, sizeof...(L)> kAlwaysBroad{L::kAlwaysBroad...};
  template <class Point>
  static void read(const Point& point, uint32_t lobes, Parameters& p) {
    ((lobes & L::kLobe ? L::read(point, p) : void()), ...);
  }
  // `lobes` without those of covers that do nothing.
  static uint32_t present(const Parameters& p, uint32_t lobes) {
    ((lobes &= (lobes & L::kLobe) && L::present(p) ? ~0u : ~uint32_t{L::kLobe}), ...);
    return lobes;
  }

 private:
  template <size_t I>
  using At = std::tuple_element_t<I, std::tuple<L...>>;
};

}  // namespace braid
