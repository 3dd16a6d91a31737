// SPDX-License-Identifier: Apache-2.0
// Planes as numpy arrays, and back.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "renderer/film/estimates.h"
#include "tools/python/made.h"

namespace braid::python {

namespace py = pybind11;
using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;

// A read-only view of the plane, (height, width); `owner` stays alive as long as the view.
py::array viewOf(const Plane<float>& plane, const std::shared_ptr<const Made>& owner);
// Every plane by its channel name: views.
py::dict planesOf(const std::shared_ptr<const Made>& made);
// A copy, (height, width, 3).
py::array arrayOf(const Rgb<float>& image);

// Copies of (height, width, 3) or (height, width) numbers; one channel becomes three equal ones. Throws Error(BadInput)
// naming `what` for another shape, no pixels or too many.
Rgb<float> imageOf(const py::handle& array, const std::string& what);
Plane<float> planeOf(const py::handle& array, const std::string& what);

// One estimate from a dict {"name", "mean", "halves": (A, B), "variance", "passes", "unbiased"}; halves and variance
// may be missing, and the mean if there are halves.
Estimate estimateOf(const py::dict& of);
// From a dict {"albedo", "normal", "depth"}, each or none; without noise. Throws Error(BadInput) for another size.
std::optional<Features> featuresOf(const py::dict& of, int width, int height);

}  // namespace braid::python
