// SPDX-License-Identifier: Apache-2.0
// The part of the C interface of Open Image Denoise that braid calls, as a table of functions: filled from the library
// when it is found at run time, or by a test.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "combiners/method.h"

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
// `reason` says why then. Loaded once a file and never unloaded.
const OidnApi* loadOidn(const std::string& file, std::string& reason);

// The denoiser by these functions; null: it cannot run for `reason`.
std::unique_ptr<Method> makeOidn(const OidnApi* api, const std::string& reason);

}  // namespace braid
