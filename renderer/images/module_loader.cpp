// SPDX-License-Identifier: Apache-2.0
// imageCodecs() of a program that opens the image module; linked in place of oiio_codecs.cpp.
#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "renderer/core/error.h"
#include "renderer/images/image_module.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const std::string& reason) {
  throw Error(ExitCode::OutputFailed, path.string() + ": reads and writes images, and cannot be opened: " + reason +
                                          "; install braid again, or put this file of its build beside the program");
}

// Beside the program where it was built, else where it is installed, relative to the program: both can be moved.
fs::path modulePath() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (program.empty()) fail(BRAID_IMAGE_MODULE_FILE, "it lies relative to /proc/self/exe, which cannot be read");
  const fs::path folder = program.parent_path();
  const fs::path beside = folder / BRAID_IMAGE_MODULE_FILE;
  if (fs::exists(beside, ignored)) return beside;
  return (folder / BRAID_IMAGE_MODULE_FOLDER / BRAID_IMAGE_MODULE_FILE).lexically_normal();
}

const ImageCodecs& openModule() {
  const fs::path path = modulePath();
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
