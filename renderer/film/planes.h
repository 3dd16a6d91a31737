// SPDX-License-Identifier: Apache-2.0
// The table of planes: what each plane of an estimate, of its history and of the features is called in files, and where
// it stands in memory. Whoever reads or writes planes walks it.
#pragma once

#include <array>
#include <span>
#include <string>

#include "renderer/film/estimates.h"

namespace braid {

// Which planes belong together: kept, asked for and complete together.
enum class PlaneSet { Always, Direct, Quarters };

// A plane of three channels R, G, B. Its layer in a file is "<estimate>.<name>".
struct EstimatePlane {
  const char* name;
  PlaneSet set;
  Rgb<float>& (*of)(Estimate&);
  const Rgb<float>& in(const Estimate& e) const { return of(const_cast<Estimate&>(e)); }  // reads only
};
std::span<const EstimatePlane> estimatePlanes();

// Quarters come as a list: "<estimate>.q0" to "<estimate>.q3".
std::string quarterName(size_t quarter);

// A plane of a Checkpoint. Its layer is "<estimate>.<name><passes>".
struct HistoryPlane {
  const char* name;
  Rgb<float>& (*of)(Checkpoint&);
  const Rgb<float>& in(const Checkpoint& c) const { return of(const_cast<Checkpoint&>(c)); }  // reads only
};
std::span<const HistoryPlane> historyPlanes();

// The parts of a feature in the order in which files hold them, with what follows the feature's layer.
inline constexpr std::array kFeatureParts = {"", "A", "B", "Variance"};

// The plane of component c of a part of a feature, both by their place in the tables above.
const Plane<float>& featurePlane(const Features& features, size_t feature, size_t part, size_t c);
Plane<float>& featurePlane(Features& features, size_t feature, size_t part, size_t c);

}  // namespace braid
