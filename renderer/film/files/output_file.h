// SPDX-License-Identifier: Apache-2.0
// A file that appears under its name only when it is complete.
#pragma once

#include <cstdio>
#include <string>

#include "renderer/images/byte_sink.h"

namespace braid {

// "-" is standard output.
inline constexpr const char* kStandardOutput = "-";

// Standard output, an open descriptor (/dev/stdout, /dev/fd/3), a device, a FIFO or a socket: what is written there
// goes through, once, and nothing can take its place.
bool isStream(const std::string& path);

// Where a file of this name comes to lie: the target of a symbolic link, also one that does not exist yet. Without
// links the path itself.
std::string behindLinks(const std::string& path);

// Writes to "path.tmp-PID.EXT" in the same folder; finish() waits for the disk and renames it to `path`, or to what
// `path` is a symbolic link to. Without finish() the temporary file is removed and a previous file stays intact.
// Streams get everything in finish(). Writers of images do not check every write, so the first failure is
// remembered here and reported by finish(), a full disk included.
class OutputFile : public ByteSink {
 public:
  // `extension` with its dot. Throws Error(OutputFailed).
  OutputFile(const std::string& path, const std::string& extension);
  ~OutputFile() override;
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  // Throws Error(OutputFailed) with one line: file, reason, mend.
  void finish();
  [[noreturn]] void fail(const std::string& reason) const;
  const std::string& temporaryPath() const { return temporary_; }

  size_t write(const void* data, size_t size) override;
  bool seek(int64_t offset) override;
  int64_t tell() const override { return position_; }
  size_t size() const override { return static_cast<size_t>(size_); }

 private:
  void note(bool ok);
  bool synchronise() const;
  void passOn();

  const std::string path_;
  const bool stream_;
  std::string target_, temporary_;
  std::FILE* file_ = nullptr;
  int64_t position_ = 0, size_ = 0;
  int error_ = 0;  // errno of the first failure
};

// Removes temporary files of `path` that processes of this machine left behind when they were killed.
void removeAbandoned(const std::string& path);

}  // namespace braid
