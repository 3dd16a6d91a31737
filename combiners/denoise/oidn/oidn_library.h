// SPDX-License-Identifier: Apache-2.0
// The library of Open Image Denoise (https://www.openimagedenoise.org), where it is installed: the part of its C
// interface that braid calls, as a table of functions, filled from the library at run time, or by a test.
#pragma once

#include <cstddef>
#include <string>

#include "renderer/core/plane.h"

namespace braid {

struct OidnApi {
  using Handle = void*;
  Handle (*newDevice)(int type) = nullptr;
  void (*commitDevice)(Handle device) = nullptr;
  int (*getDeviceError)(Handle device, const char** message) = nullptr;
  void (*releaseDevice)(Handle device) = nullptr;
  Handle (*newFilter)(Handle device, const char* type) = nullptr;
  // Pixels owned by the caller; strides of 0 mean tightly packed.
  void (*setSharedFilterImage)(Handle filter, const char* name, void* pixels, int format, size_t width, size_t height,
                               size_t byteOffset, size_t bytePixelStride, size_t byteRowStride) = nullptr;
  void (*setFilterBool)(Handle filter, const char* name, bool value) = nullptr;
  void (*setFilterFloat)(Handle filter, const char* name, float value) = nullptr;
  void (*commitFilter)(Handle filter) = nullptr;
  void (*executeFilter)(Handle filter) = nullptr;
  void (*releaseFilter)(Handle filter) = nullptr;
};

inline constexpr int kOidnCpuDevice = 1;
inline constexpr int kOidnFloat3 = 3;

// The functions of the library `file`, or of the installed one when empty, versions 1 and 2. Null when there is none;
// `reason` says why then. Looked for once a file and never unloaded.
const OidnApi* loadOidn(const std::string& file, std::string& reason);

// A device of the library, released at the end of the scope.
class OidnDevice {
 public:
  explicit OidnDevice(const OidnApi& api);
  ~OidnDevice();
  OidnDevice(const OidnDevice&) = delete;
  OidnDevice& operator=(const OidnDevice&) = delete;

  // `albedo` and `normal` may be null. Throws Error(Internal) with what the library says.
  Rgb<float> denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal) const;

 private:
  void check() const;

  const OidnApi& api_;
  OidnApi::Handle device_;
};

}  // namespace braid
