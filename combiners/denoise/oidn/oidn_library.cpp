// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/oidn/oidn_library.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include <dlfcn.h>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

template <class Function>
bool find(void* library, std::initializer_list<const char*> names, Function& function) {
  for (const char* name : names)
    if (void* address = dlsym(library, name)) {
      function = reinterpret_cast<Function>(address);
      return true;
    }
  return false;
}

// The names of version 2, then those of version 1.
bool findAll(void* library, OidnApi& api) {
  return find(library, {"oidnNewDevice"}, api.newDevice) && find(library, {"oidnCommitDevice"}, api.commitDevice) &&
         find(library, {"oidnGetDeviceError"}, api.getDeviceError) &&
         find(library, {"oidnReleaseDevice"}, api.releaseDevice) && find(library, {"oidnNewFilter"}, api.newFilter) &&
         find(library, {"oidnSetSharedFilterImage"}, api.setSharedFilterImage) &&
         find(library, {"oidnSetFilterBool", "oidnSetFilter1b"}, api.setFilterBool) &&
         find(library, {"oidnSetFilterFloat", "oidnSetFilter1f"}, api.setFilterFloat) &&
         find(library, {"oidnCommitFilter"}, api.commitFilter) &&
         find(library, {"oidnExecuteFilter"}, api.executeFilter) &&
         find(library, {"oidnReleaseFilter"}, api.releaseFilter);
}

std::vector<float> interleaved(const Rgb<float>& planes, float lo, float hi) {
  std::vector<float> out(3 * planes.size());
  parallelChunks(planes.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t c = 0; c < 3; ++c) out[3 * i + c] = std::clamp(planes[c][i], lo, hi);
  });
  return out;
}

}  // namespace

OidnDevice::OidnDevice(const OidnApi& api) : api_(api), device_(api.newDevice(kOidnCpuDevice)) {
  if (device_) api_.commitDevice(device_);
  try {
    check();
  } catch (...) {
    if (device_) api_.releaseDevice(device_);
    throw;
  }
}

OidnDevice::~OidnDevice() { api_.releaseDevice(device_); }

void OidnDevice::check() const {
  const char* message = nullptr;
  const int code = api_.getDeviceError(device_, &message);
  if (code != 0 || !device_)
    throw Error(ExitCode::Internal,
                fmt::format("Open Image Denoise reports error {}: {}", code, message ? message : "it made no device"));
}

Rgb<float> OidnDevice::denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal) const {
  const auto width = static_cast<size_t>(colour.width()), height = static_cast<size_t>(colour.height());
  constexpr float kLargest = 3e38f;
  std::vector<std::pair<const char*, std::vector<float>>> images;
  images.emplace_back("color", interleaved(colour, 0, kLargest));
  if (albedo) images.emplace_back("albedo", interleaved(*albedo, 0, 1));
  if (albedo && normal) images.emplace_back("normal", interleaved(*normal, -1, 1));
  images.emplace_back("output", std::vector<float>(3 * colour.size()));

  const OidnApi::Handle filter = api_.newFilter(device_, "RT");
  check();
  for (auto& [name, pixels] : images)
    api_.setSharedFilterImage(filter, name, pixels.data(), kOidnFloat3, width, height, 0, 0, 0);
  api_.setFilterBool(filter, "hdr", true);
  api_.setFilterFloat(filter, "inputScale", 1.0f);
  api_.commitFilter(filter);
  api_.executeFilter(filter);
  api_.releaseFilter(filter);
  check();

  Rgb<float> out(colour.width(), colour.height());
  const std::vector<float>& pixels = images.back().second;
  for (size_t i = 0; i < out.size(); ++i) out.set(i, {pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]});
  return out;
}

namespace {

struct Search {
  std::optional<OidnApi> api;
  std::string reason;
};

Search search(const std::string& file) {
  std::vector<std::string> names{file};
  if (file.empty())
    names = {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0",
             "libOpenImageDenoise.so"};
  Search result;
  result.reason = "Open Image Denoise is not installed: no " + names[0] + " that the loader finds";
  for (const std::string& name : names) {
    void* library = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    OidnApi api;
    if (library && findAll(library, api)) {
      result.api = api;
      return result;
    }
    if (library) result.reason = name + " lacks functions of Open Image Denoise 1 or 2";
  }
  return result;
}

}  // namespace

const OidnApi* loadOidn(const std::string& file, std::string& reason) {
  static std::mutex mutex;
  static std::map<std::string, Search> searches;
  const std::lock_guard lock(mutex);
  const auto found = searches.find(file);
  const Search& of = found != searches.end() ? found->second : searches.emplace(file, search(file)).first->second;
  reason = of.reason;
  return of.api ? &*of.api : nullptr;
}

}  // namespace braid
