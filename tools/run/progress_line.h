// SPDX-License-Identifier: Apache-2.0
// Progress on standard error: one line rewritten on a terminal, a plain line now and then elsewhere, and JSON records
// for machines.
#pragma once

#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "renderer/session/session.h"

namespace braid {

// "1h02m", "3m20s" or "12.3s".
std::string formatSeconds(double seconds);
// "1h02m03.45s", "3m20.12s" or "12.34s": parts that are read add up to their sum.
std::string formatHundredths(double seconds);

class ProgressLine {
 public:
  explicit ProgressLine(bool quiet);
  void update(const Progress& progress);
  void finish();

 private:
  bool quiet_, terminal_;
  double lastPrinted_ = -1e9;
  double interval_;
};

// One JSON object a line, each with "schema": 1 and an "event". "-" is standard output, empty writes nothing.
class JsonLog {
 public:
  explicit JsonLog(const std::string& path);
  ~JsonLog();
  JsonLog(const JsonLog&) = delete;
  JsonLog& operator=(const JsonLog&) = delete;
  void write(const char* event, nlohmann::json record);
  // After the last record. Throws Error(OutputFailed) if any of them was not written; that of standard output is told
  // at the end of the program.
  void finish();

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace braid
