// SPDX-License-Identifier: Apache-2.0
// Where the modules lie that braid opens at run time.
#pragma once

#include <filesystem>
#include <string>
#include <system_error>

namespace braid {

// The file beside the program where it was built, else where it is installed, by a path relative to the program: both
// can be moved. Empty where /proc/self/exe, which tells where the program is, cannot be read.
inline std::filesystem::path modulePath(const std::string& file, const std::string& folderFromProgram) {
  std::error_code ignored;
  const std::filesystem::path folder = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  if (folder.empty() || std::filesystem::exists(folder / file, ignored)) return folder.empty() ? folder : folder / file;
  return (folder / folderFromProgram / file).lexically_normal();
}

}  // namespace braid
