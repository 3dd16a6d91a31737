// SPDX-License-Identifier: Apache-2.0
// Where the modules lie that braid opens at run time.
#pragma once

#include <dlfcn.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>

namespace braid {

// The folder of the library that this code is linked into, such as a module of Python, or else of the program. Empty
// where /proc/self/exe, which tells where the program is, cannot be read.
inline const std::filesystem::path& codeFolder() {
  // Asked once: the question waits for any module that is being opened.
  static const std::filesystem::path folder = [] {
    static const char here = 0;
    Dl_info info;
    if (dladdr(&here, &info) != 0 && info.dli_fname && std::string_view(info.dli_fname).ends_with(".so"))
      return std::filesystem::path(info.dli_fname).parent_path();
    std::error_code ignored;
    return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  }();
  return folder;
}

// The file beside the code where it was built, else where it is installed, by a path relative to the program: both can
// be moved. Empty where codeFolder() is.
inline std::filesystem::path modulePath(const std::string& file, const std::string& folderFromProgram) {
  std::error_code ignored;
  const std::filesystem::path& folder = codeFolder();
  if (folder.empty() || std::filesystem::exists(folder / file, ignored)) return folder.empty() ? folder : folder / file;
  return (folder / folderFromProgram / file).lexically_normal();
}

}  // namespace braid
