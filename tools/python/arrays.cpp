// SPDX-License-Identifier: Apache-2.0
#include "tools/python/arrays.h"

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/images/foreign_image.h"

namespace braid::python {

namespace {

FloatArray floats(const py::handle& array, const std::string& what) {
  FloatArray out = FloatArray::ensure(array);
  if (!out) {
    PyErr_Clear();
    throw Error(ExitCode::BadInput, what + ": is no array of numbers");
  }
  return out;
}

void checkPixels(const FloatArray& array, const std::string& what) {
  const py::ssize_t height = array.shape(0), width = array.shape(1);
  if (height < 1 || width < 1 || height > kMaxPixels / width)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {}x{} pixels: 1 to {} are possible", what, width, height, kMaxPixels));
}

void requireSize(const Rgb<float>& image, int width, int height, const std::string& what) {
  if (!image.empty() && (image.width() != width || image.height() != height))
    throw Error(ExitCode::BadInput, fmt::format("{}: {}x{} pixels, but the image has {}x{}", what, image.width(),
                                                image.height(), width, height));
}

}  // namespace

py::array viewOf(const Plane<float>& plane, const std::shared_ptr<const Made>& owner) {
  auto* held = new std::shared_ptr<const Made>(owner);
  const py::capsule base(held, [](void* p) { delete static_cast<std::shared_ptr<const Made>*>(p); });
  py::array_t<float> view({plane.height, plane.width}, plane.data.data(), base);
  view.attr("flags").attr("writeable") = false;
  return view;
}

py::dict planesOf(const std::shared_ptr<const Made>& made) {
  py::dict planes;
  for (const ExrChannel& channel : made->planes()) planes[py::str(channel.name)] = viewOf(*channel.plane, made);
  return planes;
}

py::array arrayOf(const Rgb<float>& image) {
  py::array_t<float> out({image.height(), image.width(), 3});
  float* to = out.mutable_data();
  for (size_t i = 0; i < image.size(); ++i)
    for (size_t c = 0; c < 3; ++c) *to++ = image[c][i];
  return out;
}

Rgb<float> imageOf(const py::handle& array, const std::string& what) {
  const FloatArray in = floats(array, what);
  if (in.ndim() != 2 && !(in.ndim() == 3 && (in.shape(2) == 3 || in.shape(2) == 1)))
    throw Error(ExitCode::BadInput, what + ": its shape is neither (height, width, 3) nor (height, width)");
  checkPixels(in, what);
  const size_t channels = in.ndim() == 3 ? static_cast<size_t>(in.shape(2)) : 1;
  Rgb<float> image(static_cast<int>(in.shape(1)), static_cast<int>(in.shape(0)), kUnfilled);
  const float* from = in.data();
  for (size_t i = 0; i < image.size(); ++i, from += channels)
    for (size_t c = 0; c < 3; ++c) image[c][i] = from[channels == 3 ? c : 0];
  return image;
}

Plane<float> planeOf(const py::handle& array, const std::string& what) {
  const FloatArray in = floats(array, what);
  if (in.ndim() != 2) throw Error(ExitCode::BadInput, what + ": its shape is not (height, width)");
  checkPixels(in, what);
  Plane<float> plane(static_cast<int>(in.shape(1)), static_cast<int>(in.shape(0)), kUnfilled);
  std::copy_n(in.data(), plane.size(), plane.data.data());
  return plane;
}

Estimate estimateOf(const py::dict& of) {
  Estimate e;
  const auto given = [&](const char* key) { return of.contains(key) && !of[key].is_none(); };
  e.name = given("name") ? of["name"].cast<std::string>() : "image";
  e.unbiased = !given("unbiased") || of["unbiased"].cast<bool>();
  e.passes = given("passes") ? of["passes"].cast<uint64_t>() : 0;
  if (given("halves")) {
    const auto halves = of["halves"].cast<py::sequence>();
    if (halves.size() != 2) throw Error(ExitCode::BadInput, e.name + ": halves: two images are asked for");
    for (size_t h = 0; h < 2; ++h) e.half[h] = imageOf(halves[h], fmt::format("{}: half {}", e.name, h));
    requireSize(e.half[1], e.half[0].width(), e.half[0].height(), e.name + ": half 1");
  }
  if (given("mean")) e.mean = imageOf(of["mean"], e.name);
  if (e.mean.empty() && e.half[0].empty()) throw Error(ExitCode::BadInput, e.name + ": neither a mean nor halves");
  if (e.mean.empty()) e.mean = average(e.half[0], e.half[1]);
  if (given("variance")) e.variance = imageOf(of["variance"], e.name + ": variance");
  for (const Rgb<float>* image : {&e.half[0], &e.variance})
    requireSize(*image, e.mean.width(), e.mean.height(), e.name);
  return e;
}

std::optional<Features> featuresOf(const py::dict& of, int width, int height) {
  Features f;
  const auto given = [&](const char* key) { return of.contains(key) && !of[key].is_none(); };
  if (given("albedo")) f.albedo.mean = imageOf(of["albedo"], "albedo");
  if (given("normal")) f.normal.mean = imageOf(of["normal"], "normal");
  if (given("depth")) f.depth.mean = planeOf(of["depth"], "depth");
  requireSize(f.albedo.mean, width, height, "albedo");
  requireSize(f.normal.mean, width, height, "normal");
  if (!f.depth.mean.empty() && (f.depth.mean.width != width || f.depth.mean.height != height))
    throw Error(ExitCode::BadInput, "depth: its size is not that of the image");
  if (!completeFeatures(f, width, height)) return {};
  return f;
}

}  // namespace braid::python
