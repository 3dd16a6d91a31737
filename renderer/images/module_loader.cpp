// SPDX-License-Identifier: Apache-2.0
// imageCodecs() of a program that opens the image module; linked in place of oiio_codecs.cpp.
#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "renderer/core/error.h"
#include "renderer/core/module_path.h"
#include "renderer/images/image_module.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const std::string& reason) {
  throw Error(ExitCode::OutputFailed, path.string() + ": reads and writes images, and cannot be opened: " + reason +
                                          "; install braid again, or put this file of its build beside the program");
}

const ImageCodecs& openModule() {
  const fs::path path = modulePath(BRAID_IMAGE_MODULE_FILE, BRAID_IMAGE_MODULE_FOLDER);
  if (path.empty()) fail(BRAID_IMAGE_MODULE_FILE, "it lies relative to /proc/self/exe, which cannot be read");
  std::error_code ignored;
  if (!fs::exists(path, ignored)) fail(path, "there is no such file");
  // What is missing in its libraries shows now, not when hours have been rendered.
  void* module = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!module) fail(path, ::dlerror());
  const auto entry = reinterpret_cast<ImageModuleEntry>(::dlsym(module, kImageModuleEntry));
  const ImageCodecs* codecs = entry ? entry(BRAID_IMAGE_MODULE_VERSION) : nullptr;
  if (!codecs) fail(path, "it belongs to another version of braid");
  return *codecs;
}

}  // namespace

const ImageCodecs& imageCodecs() {
  static const ImageCodecs& codecs = openModule();
  return codecs;
}

}  // namespace braid
