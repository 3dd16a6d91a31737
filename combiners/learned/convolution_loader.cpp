// SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "combiners/learned/convolution.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

// Beside the program where it was built, else where it is installed: relative to the program, which can be moved, or,
// for programs of others, where it was meant to be.
fs::path modulePath() {
  std::error_code ignored;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const fs::path& file :
       {folder / BRAID_CONVOLUTION_MODULE_FILE, folder / BRAID_MODULE_FOLDER / BRAID_CONVOLUTION_MODULE_FILE})
    if (!folder.empty() && fs::exists(file, ignored)) return file.lexically_normal();
  return fs::path(BRAID_INSTALLED_MODULES) / BRAID_CONVOLUTION_MODULE_FILE;
}

struct Opened {
  const ConvolutionLibrary* library = nullptr;
  std::string reason;
};

Opened openModule() {
  const fs::path path = modulePath();
  std::error_code ignored;
  if (!fs::exists(path, ignored))
    return {nullptr, path.string() + ", which runs networks, does not exist: build braid where oneDNN is installed"};
  void* module = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!module) return {nullptr, path.string() + ", which runs networks, cannot be opened: " + ::dlerror()};
  const auto entry = reinterpret_cast<ConvolutionModuleEntry>(::dlsym(module, kConvolutionModuleEntry));
  const ConvolutionLibrary* library = entry ? entry(BRAID_CONVOLUTION_MODULE_VERSION) : nullptr;
  return {library, library ? "" : path.string() + " belongs to another version of braid: install braid again"};
}

}  // namespace

const ConvolutionLibrary* openConvolutions(std::string& reason) {
  static const Opened opened = openModule();
  reason = opened.reason;
  return opened.library;
}

}  // namespace braid
