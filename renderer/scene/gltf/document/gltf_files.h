// SPDX-License-Identifier: Apache-2.0
// The files that a scene names: found beside it, read whole, and kept out of everywhere else.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace braid::gltf {

// A regular file's bytes. On failure nothing, and why in `reason`, without the file's name.
std::optional<std::vector<uint8_t>> readFile(const std::filesystem::path& path, std::string& reason);

bool isDataUri(const std::string& uri);

class Files {
 public:
  Files() = default;
  // `external`: links, `..` and absolute paths may lead out of the folder.
  Files(std::string folder, bool external) : folder_(std::move(folder)), external_(external) {}

  // The bytes that a relative or data URI stands for. On failure nothing, and why in `reason`. `note` tells of a file
  // that was taken though its name is spelled otherwise.
  std::optional<std::vector<uint8_t>> read(const std::string& uri, std::string& reason, std::string& note) const;

 private:
  std::optional<std::vector<uint8_t>> readPath(const std::string& name, std::string& reason) const;
  std::string folder_;
  bool external_ = false;
};

}  // namespace braid::gltf
