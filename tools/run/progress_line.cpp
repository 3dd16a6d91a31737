// SPDX-License-Identifier: Apache-2.0
#include "tools/run/progress_line.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <sys/ioctl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

std::string formatSeconds(double s) {
  if (s < 0) return "?";
  const auto whole = static_cast<long long>(s);
  if (s < 60) return fmt::format("{:.1f}s", s);
  if (s < 3600) return fmt::format("{}m{:02}s", whole / 60, whole % 60);
  return fmt::format("{}h{:02}m", whole / 3600, whole / 60 % 60);
}

std::string formatHundredths(double s) {
  const auto all = static_cast<long long>(std::llround(100 * std::max(0.0, s)));
  const double rest = static_cast<double>(all % 6000) / 100;
  if (all < 6000) return fmt::format("{:.2f}s", rest);
  if (all < 360000) return fmt::format("{}m{:05.2f}s", all / 6000, rest);
  return fmt::format("{}h{:02}m{:05.2f}s", all / 360000, all / 6000 % 60, rest);
}

ProgressLine::ProgressLine(bool quiet)
    : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0), interval_(terminal_ ? 0.25 : 5.0) {}

void ProgressLine::update(const Progress& p) {
  const bool last = p.rounds > 0 && p.round == p.rounds;
  if (quiet_ || (p.seconds - lastPrinted_ < interval_ && !last)) return;
  lastPrinted_ = p.seconds;
  // A log of an hour's render should not have thousands of lines.
  if (!terminal_) interval_ = std::min(60.0, interval_ * 1.3);
  const std::string total = p.rounds > 0 ? fmt::format("/{}", p.rounds) : "";
  std::string text =
      fmt::format("{}{} spp  {}  ETA {}", p.round, total, formatSeconds(p.seconds), formatSeconds(p.secondsLeft));
  if (p.mostSamples > p.fewestSamples) text += fmt::format("  {} to {} a pixel", p.fewestSamples, p.mostSamples);
  if (p.rejected > 0) text += fmt::format("  {} samples rejected", p.rejected);
  if (!terminal_) {
    fmt::print(stderr, "rendering: {}\n", text);
    return;
  }
  winsize size{};
  const int columns = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
  const double done = p.rounds > 0         ? static_cast<double>(p.round) / static_cast<double>(p.rounds)
                      : p.secondsLeft >= 0 ? p.seconds / std::max(1e-9, p.seconds + p.secondsLeft)
                                           : 0;
  const int width = std::max(0, columns - static_cast<int>(text.size()) - 6);
  const int filled = static_cast<int>(done * width);
  fmt::print(stderr, "\r[{}{}] {}\x1b[K", std::string(static_cast<size_t>(filled), '='),
             std::string(static_cast<size_t>(width - filled), ' '), text);
  std::fflush(stderr);
}

void ProgressLine::finish() {
  if (!quiet_ && terminal_) fmt::print(stderr, "\n");
}

JsonLog::JsonLog(const std::string& path) : path_(path) {
  if (path.empty()) return;
  file_ = path == "-" ? stdout : std::fopen(path.c_str(), "w");
  if (!file_)
    throw Error(ExitCode::OutputFailed, fmt::format("{}: cannot write the log: {}", path, std::strerror(errno)));
}

JsonLog::~JsonLog() {
  if (file_ && file_ != stdout) std::fclose(file_);
}

void JsonLog::finish() {
  if (!file_ || file_ == stdout) return;
  const bool written = std::ferror(file_) == 0;
  const bool closed = std::fclose(file_) == 0;
  file_ = nullptr;
  if (!written || !closed)
    throw Error(ExitCode::OutputFailed, fmt::format("{}: the log could not be written: free some space, or write "
                                                    "elsewhere",
                                                    path_));
}

void JsonLog::write(const char* event, nlohmann::json record) {
  if (!file_) return;
  record["schema"] = 1;
  record["event"] = event;
  const std::string line = record.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  std::fputs(line.c_str(), file_);
  std::fflush(file_);
}

}  // namespace braid
