// SPDX-License-Identifier: Apache-2.0
// Estimates to write to image files, and a folder for them.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>

#include <doctest/doctest.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"

namespace braid::test::exr_files {

namespace fs = std::filesystem;

// A folder that goes away with the test.
struct Folder {
  fs::path path = fs::temp_directory_path() / ("braid-test-exr-" + std::to_string(::getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string file(const std::string& name) const { return (path / name).string(); }
  size_t count() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(path), fs::directory_iterator()));
  }
};

inline Plane<float> plane(int w, int h, float seed) {
  Plane<float> p(w, h);
  for (size_t i = 0; i < p.size(); ++i) p[i] = seed + 1e-3f * static_cast<float>(i);
  return p;
}

inline Rgb<float> colour(int w, int h, float seed) {
  Rgb<float> c;
  for (size_t k = 0; k < 3; ++k) c[k] = plane(w, h, seed + static_cast<float>(k));
  return c;
}

inline Estimates sampleEstimates(int w, int h) {
  Estimates all;
  all.width = w;
  all.height = h;
  for (const char* name : {"pt", "combined.js"}) {
    Estimate e;
    e.name = name;
    e.mean = colour(w, h, 1.25f);
    e.half[0] = colour(w, h, 2e-9f);
    e.half[1] = colour(w, h, 3e9f);
    e.variance = colour(w, h, 1e-20f);
    if (e.name == "pt")
      for (int q = 0; q < 4; ++q) e.quarter.push_back(colour(w, h, 10.0f + static_cast<float>(q)));
    all.estimates.push_back(e);
  }
  Features f;
  f.albedo = {colour(w, h, 0.1f), {colour(w, h, 0.2f), colour(w, h, 0.3f)}, colour(w, h, 0.4f)};
  f.normal = {colour(w, h, -1), {colour(w, h, -2), colour(w, h, -3)}, colour(w, h, -4)};
  f.depth = {plane(w, h, 5), {plane(w, h, 6), plane(w, h, 7)}, plane(w, h, 8)};
  f.visibility = {plane(w, h, 0.5f), {plane(w, h, 0.6f), plane(w, h, 0.7f)}, plane(w, h, 0.8f)};
  all.features = f;
  return all;
}

inline std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline std::string errorOf(const std::function<void()>& action, ExitCode code) {
  try {
    action();
  } catch (const Error& e) {
    CHECK(e.code() == code);
    const std::string text = e.what();
    CHECK(text.find('\n') == std::string::npos);
    return text;
  }
  FAIL("no error");
  return "";
}

}  // namespace braid::test::exr_files
