// SPDX-License-Identifier: Apache-2.0
// The folder of a sweep: its rows, its record, the images of its last rungs, and the report of them.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_run.h"

namespace braid {

class SweepFolder {
 public:
  using Warn = std::function<void(const std::string&)>;

  // What it is handed must outlive this.
  SweepFolder(const SweepOptions& options, const Measurement& measurement, Warn warn);

  // Makes what is missing and reads the rows of earlier runs. Throws Error(Usage) where new ones cannot be added.
  void open(const Settings& settings, const std::vector<SweepMethod>& methods);

  std::string path(const std::string& name) const { return o_.output + "/" + name; }
  const SweepTable& table() const { return table_; }

  // Adds a row and, of the last rung, its image.
  void keep(const SweepRow& row, const Rgb<float>& image, bool lastRung);
  // Throws Error(Usage) where the scene's rows were measured with another file, camera or reference.
  void record(const SweepScene& scene, const ReferenceFrame& frame);
  // Sorts the rows by these orders, and writes table, record and report; the summary also to `out`. Rows of earlier
  // runs, of methods and scenes that this one did not ask for, are part of the summary too.
  void finish(const std::vector<std::string>& scenes, const std::vector<std::string>& methods, std::ostream& out);

 private:
  void readEarlierRows(const nlohmann::ordered_json& settings);
  void sortRows(const std::vector<std::string>& scenes, const std::vector<std::string>& methods);
  void writeRecord() const;

  const SweepOptions& o_;
  const Measurement& measurement_;
  const Warn warn_;
  SweepTable table_;
  nlohmann::ordered_json record_;
};

}  // namespace braid
