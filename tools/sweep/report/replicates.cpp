// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/replicates.h"

#include <fmt/format.h>

#include "tools/sweep/report/html.h"
#include "tools/sweep/table/sweep_summary.h"

namespace braid {

namespace {

constexpr const char* kColumns[] = {"scene",    "method",    "runs", "squared bias", "± standard error",
                                    "variance", "bias share"};

std::vector<std::string> cellsOf(const ReplicateBias& b) {
  const double error = b.squaredBias + b.variance;
  return {b.scene,
          b.method,
          fmt::format("{}", b.runs),
          shortNumber(b.squaredBias),
          shortNumber(b.standardError),
          shortNumber(b.variance),
          error > 0 ? fmt::format("{:.1f} %", 100 * b.squaredBias / error) : "–"};
}

}  // namespace

std::string toMarkdown(const std::vector<ReplicateBias>& biases) {
  std::string head = "|", rule = "|", rows;
  for (const char* name : kColumns) {
    head += fmt::format(" {} |", name);
    rule += "---|";
  }
  for (const ReplicateBias& b : biases) {
    rows += "|";
    for (const std::string& text : cellsOf(b)) rows += fmt::format(" {} |", text);
    rows += "\n";
  }
  return head + "\n" + rule + "\n" + rows;
}

std::string toHtml(const std::vector<ReplicateBias>& biases) {
  std::string text = "<table>\n<tr>";
  for (const char* name : kColumns) text += fmt::format("<th>{}</th>", name);
  text += "</tr>\n";
  for (const ReplicateBias& b : biases) {
    text += "<tr>";
    for (const std::string& cell : cellsOf(b)) text += "<td>" + escaped(cell) + "</td>";
    text += "</tr>\n";
  }
  return text + "</table>\n";
}

}  // namespace braid
