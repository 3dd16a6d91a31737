// SPDX-License-Identifier: Apache-2.0
// Open Image Denoise, Intel's learned denoiser (https://www.openimagedenoise.org), where it is installed.
//
// Its own automatic exposure would couple all pixels and differ between the image, its halves and the perturbed images
// of SURE; the inputs are exposure-normalised by the same rule already, so its scale is fixed at 1.
#include "combiners/denoise/oidn.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <vector>

#include <dlfcn.h>
#include <fmt/format.h>

#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/registry.h"
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

// A device that is released at the end of the scope.
class Device {
 public:
  explicit Device(const OidnApi& api) : api_(api), device_(api.newDevice(kOidnCpuDevice)) {
    if (device_) api_.commitDevice(device_);
  }
  ~Device() {
    if (device_) api_.releaseDevice(device_);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void check() const {
    const char* message = nullptr;
    const int code = api_.getDeviceError(device_, &message);
    if (code != 0 || !device_)
      throw Error(ExitCode::Internal, fmt::format("Open Image Denoise reports error {}: {}", code,
                                                  message ? message : "it made no device"));
  }

  // `albedo` and `normal` may be null.
  Rgb<float> denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal) const;

 private:
  const OidnApi& api_;
  OidnApi::Handle device_;
};

Rgb<float> Device::denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal) const {
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

class Oidn : public ExternalMethod {
 public:
  Oidn(const OidnApi* api, std::string reason) : api_(api), reason_(std::move(reason)) {}
  const char* name() const override { return "oidn"; }
  const char* description() const override { return "Open Image Denoise, a learned denoiser, where it is installed"; }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.halves = needs.variance = false;
    return needs;
  }
  // The library's own memory is not known.
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {96, 36}; }
  std::string skipReason() const override { return api_ ? "" : reason_; }

  // A half is denoised with that half of the features, so that it stays independent of the other one.
  MethodResult run(const MethodInputs& in) const override {
    if (!api_) throw Error(ExitCode::Usage, reason_);
    const Device device(*api_);
    device.check();
    const FeaturePlanes<Rgb<float>>* albedo = in.features ? &in.features->albedo : nullptr;
    const FeaturePlanes<Rgb<float>>* normal = in.features ? &in.features->normal : nullptr;
    MethodResult result;
    result.image.mean =
        device.denoise(in.unbiased->mean, albedo ? &albedo->mean : nullptr, normal ? &normal->mean : nullptr);
    for (int h = 0; h < 2; ++h)
      if (!in.meanOnly && !in.unbiased->half[h].empty())
        result.image.half[h] = device.denoise(in.unbiased->half[h], albedo ? &albedo->half[h] : nullptr,
                                              normal ? &normal->half[h] : nullptr);
    return result;
  }

 private:
  const OidnApi* api_;
  std::string reason_;
};

}  // namespace

const OidnApi* loadOidn(const std::string& file, std::string& reason) {
  static std::mutex mutex;
  static std::map<std::string, OidnApi> loaded;
  const std::lock_guard lock(mutex);
  if (const auto found = loaded.find(file); found != loaded.end()) return &found->second;
  std::vector<std::string> names{file};
  if (file.empty())
    names = {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0",
             "libOpenImageDenoise.so"};
  reason = "Open Image Denoise is not installed: no " + names[0] + " that the loader finds";
  for (const std::string& name : names) {
    void* library = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    OidnApi api;
    if (library && findAll(library, api)) return &(loaded[file] = api);
    if (library) reason = name + " lacks functions of Open Image Denoise 1 or 2";
  }
  return nullptr;
}

std::unique_ptr<Method> makeOidn(const OidnApi* api, const std::string& reason) {
  return std::make_unique<Oidn>(api, reason);
}

std::unique_ptr<Method> make_oidn() {
  std::string reason;
  const OidnApi* api = loadOidn("", reason);
  return makeOidn(api, reason);
}

}  // namespace braid
