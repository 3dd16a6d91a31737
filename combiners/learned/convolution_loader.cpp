// SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "combiners/learned/convolution.h"
#include "renderer/core/module_path.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

// For programs of others, where it was meant to be installed.
fs::path convolutionModule() {
  std::error_code ignored;
  const fs::path path = modulePath(BRAID_CONVOLUTION_MODULE_FILE, BRAID_MODULE_FOLDER);
  return fs::exists(path, ignored) ? path : fs::path(BRAID_INSTALLED_MODULES) / BRAID_CONVOLUTION_MODULE_FILE;
}

struct Opened {
  const ConvolutionLibrary* library = nullptr;
  std::string reason;
};

Opened openModule() {
  const fs::path path = convolutionModule();
  if (std::string reason; !convolutionsInstalled(reason)) return {nullptr, reason};
  void* module = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!module) return {nullptr, path.string() + ", which runs networks, cannot be opened: " + ::dlerror()};
  const auto entry = reinterpret_cast<ConvolutionModuleEntry>(::dlsym(module, kConvolutionModuleEntry));
  const ConvolutionLibrary* library = entry ? entry(BRAID_CONVOLUTION_MODULE_VERSION) : nullptr;
  return {library, library ? "" : path.string() + " belongs to another version of braid: install braid again"};
}

}  // namespace

bool convolutionsInstalled(std::string& reason) {
  const fs::path path = convolutionModule();
  std::error_code ignored;
  if (fs::exists(path, ignored)) return true;
  reason = path.string() + ", which runs networks, does not exist: build braid where oneDNN is installed";
  return false;
}

const ConvolutionLibrary* openConvolutions(std::string& reason) {
  static const Opened opened = openModule();
  reason = opened.reason;
  return opened.library;
}

}  // namespace braid
