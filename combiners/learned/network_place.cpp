// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/network_place.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <system_error>

#include "combiners/learned/convolution.h"
#include "renderer/core/module_path.h"

namespace braid {

namespace {

std::map<std::string, std::string>& namedNetworks() {
  static std::map<std::string, std::string> files;
  return files;
}

std::string withUnderscores(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

}  // namespace

std::string networkVariable(const std::string& method) {
  std::string name = withUnderscores(method);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return "BRAID_" + name + "_NETWORK";
}

std::string findNetwork(const std::string& method) {
  if (const auto named = namedNetworks().find(method); named != namedNetworks().end()) return named->second;
  if (const char* named = std::getenv(networkVariable(method).c_str()); named && *named) return named;
  const std::string file = "braid_" + withUnderscores(method) + ".network";
  std::error_code ignored;
  const std::filesystem::path path = modulePath(file, BRAID_MODULE_FOLDER);
  return std::filesystem::exists(path, ignored) ? path.string() : BRAID_INSTALLED_MODULES "/" + file;
}

void nameNetwork(const std::string& method, const std::string& file) {
  if (file.empty())
    namedNetworks().erase(method);
  else
    namedNetworks()[method] = file;
}

std::string networkSkipReason(const std::string& method) {
  const std::string file = findNetwork(method);
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return file + ": there is no such network";
  std::string reason;
  return convolutionsInstalled(reason) ? "" : reason;
}

}  // namespace braid
