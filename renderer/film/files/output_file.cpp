// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/output_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

std::string mendFor(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return "free some space, or write elsewhere";
    case ENOENT:
    case ENOTDIR:
      return "create the folder first, or write elsewhere";
    case EACCES:
    case EPERM:
    case EROFS:
      return "check the permissions of the folder, or write elsewhere";
    case EISDIR:
      return "give a file name, not a folder";
    default:
      return "check the disk, or write elsewhere";
  }
}

// The open descriptor that a path names, or -1.
int descriptorOf(const std::string& path) {
  if (path == kStandardOutput || path == "/dev/stdout") return STDOUT_FILENO;
  if (path == "/dev/stderr") return STDERR_FILENO;
  for (const std::string folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!path.starts_with(folder) || path.size() == folder.size()) continue;
    char* end = nullptr;
    const long number = std::strtol(path.c_str() + folder.size(), &end, 10);
    if (*end == '\0' && number >= 0 && number < 65536) return static_cast<int>(number);
  }
  return -1;
}

bool writeAll(int descriptor, const char* bytes, size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(descriptor, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes += written;
    size -= static_cast<size_t>(written);
  }
  return true;
}

// Makes a rename last; as good as the file system allows.
void synchroniseFolder(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  const int descriptor = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

bool isStream(const std::string& path) {
  if (descriptorOf(path) >= 0) return true;
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}

std::string behindLinks(const std::string& path) {
  std::error_code failure;
  std::filesystem::path target(path);
  for (int links = 0; links < 40 && std::filesystem::is_symlink(target, failure); ++links) {
    const std::filesystem::path next = std::filesystem::read_symlink(target, failure);
    if (failure) break;
    target = next.is_absolute() ? next : target.parent_path() / next;
  }
  return target.string();
}

void removeAbandoned(const std::string& path) {
  if (isStream(path)) return;
  const std::filesystem::path target(behindLinks(path));
  const std::string begin = target.filename().string() + ".tmp-";
  std::error_code ignored;
  const std::filesystem::path folder = target.parent_path().empty() ? "." : target.parent_path();
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, begin.size(), begin) != 0) continue;
    const int process = std::atoi(name.c_str() + begin.size());
    if (process > 0 && ::kill(process, 0) != 0 && errno == ESRCH) std::filesystem::remove(entry.path(), ignored);
  }
}

OutputFile::OutputFile(const std::string& path, const std::string& extension)
    : path_(path),
      stream_(isStream(path)),
      target_(stream_ ? path : behindLinks(path)),
      temporary_(stream_ ? "stream" + extension : target_ + ".tmp-" + std::to_string(::getpid()) + extension) {
  errno = 0;
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    error_ = EISDIR;
  else
    note((file_ = stream_ ? std::tmpfile() : std::fopen(temporary_.c_str(), "wb")) != nullptr);
  if (error_ != 0) fail("");
}

OutputFile::~OutputFile() {
  if (file_) std::fclose(file_);
  if (!stream_ && !temporary_.empty()) {
    std::error_code ignored;
    std::filesystem::remove(temporary_, ignored);
  }
}

void OutputFile::fail(const std::string& reason) const {
  std::string line = error_ != 0 ? std::strerror(error_) : reason;
  for (char& c : line)
    if (c == '\n' || c == '\r') c = ' ';
  const std::string name = path_ == kStandardOutput ? "standard output" : path_;
  throw Error(ExitCode::OutputFailed, name + ": cannot be written: " + line + "; " + mendFor(error_));
}

void OutputFile::note(bool ok) {
  if (!ok && error_ == 0) error_ = errno != 0 ? errno : EIO;
}

// Without this a power failure may leave the new name with the old file's place on the disk: an empty file.
bool OutputFile::synchronise() const {
  if (std::fflush(file_) != 0) return false;
  return ::fsync(::fileno(file_)) == 0 || errno == EINVAL || errno == ENOTSUP;  // not every file system can
}

// A FIFO waits here for whoever reads it.
void OutputFile::passOn() {
  errno = 0;
  note(std::fflush(file_) == 0 && std::fseek(file_, 0, SEEK_SET) == 0);
  const int open = descriptorOf(path_);
  if (open == STDOUT_FILENO) std::fflush(stdout);
  const int to = open >= 0 ? ::dup(open) : ::open(path_.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
  note(to >= 0);
  char bytes[65536];
  while (error_ == 0) {
    const size_t size = std::fread(bytes, 1, sizeof bytes, file_);
    if (size == 0) break;
    note(writeAll(to, bytes, size));
  }
  note(std::ferror(file_) == 0);
  if (to >= 0) note(::close(to) == 0);
  std::fclose(file_);
  file_ = nullptr;
  if (error_ != 0) fail("");
}

void OutputFile::finish() {
  if (stream_) return passOn();
  errno = 0;
  note(synchronise());
  errno = 0;
  const bool closed = std::fclose(file_) == 0;
  file_ = nullptr;
  note(closed);
  if (error_ == 0) note(std::rename(temporary_.c_str(), target_.c_str()) == 0);
  if (error_ != 0) fail("");
  temporary_.clear();
  synchroniseFolder(target_);
}

size_t OutputFile::write(const void* data, size_t size) {
  errno = 0;
  const size_t written = std::fwrite(data, 1, size, file_);
  note(written == size);
  position_ += static_cast<int64_t>(written);
  size_ = std::max(size_, position_);
  return written;
}

bool OutputFile::seek(int64_t offset) {
  if (offset == position_) return true;
  errno = 0;
  const bool ok = ::fseeko(file_, offset, SEEK_SET) == 0;
  note(ok);
  if (ok) position_ = offset;
  return ok;
}

}  // namespace braid
