// SPDX-License-Identifier: Apache-2.0
#include "tools/manual/documents.h"

#include <filesystem>
#include <fstream>

#include "renderer/core/error.h"
#include "tools/manual/completion.h"
#include "tools/manual/manual_pages.h"

namespace braid {

namespace {

void write(const std::filesystem::path& path, const std::string& text) {
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  std::ofstream out(path, std::ios::binary);
  if (!(out << text).flush()) throw Error(ExitCode::OutputFailed, path.string() + ": cannot be written");
}

}  // namespace

void writeDocuments(const CLI::App& app, const std::string& folder) {
  const std::filesystem::path to(folder);
  for (const auto& [name, text] : manualPages(app)) write(to / "man" / name, text);
  write(to / "bash" / "braid", bashCompletion(app));
  write(to / "zsh" / "_braid", zshCompletion(app));
}

}  // namespace braid
