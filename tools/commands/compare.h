// SPDX-License-Identifier: Apache-2.0
// `braid compare`: metrics of an image against a reference.
#pragma once

#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace braid {

struct CompareOptions {
  std::string image, reference;
  std::vector<std::string> metrics;  // empty: all
  bool json = false;
  bool identical = false;          // compare bits instead of measuring
  std::optional<double> max, min;  // limits for the first metric
  double trimPercent = 0;
  std::string layer, referenceLayer;  // empty: R G B
};

// Prints one line a metric, or one JSON object. Returns the exit code: 0, or 6 when the first metric is beyond its
// limit or, with `identical`, a bit differs. Throws Error.
int runCompare(const CompareOptions& options, std::ostream& out, std::ostream& warnings);

// Adds the subcommand; `action` is set when it is chosen.
void addCompare(CLI::App& app, std::function<int()>& action);

}  // namespace braid
