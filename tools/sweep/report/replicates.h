// SPDX-License-Identifier: Apache-2.0
// Squared bias and variance from runs with different seeds.
#pragma once

#include <string>
#include <vector>

namespace braid {

// Of a method on a scene at the last rung: relL2 taken apart.
struct ReplicateBias {
  std::string scene, method;
  int runs = 0;
  double squaredBias = 0, standardError = 0, variance = 0;
};

// Scenes × methods as Markdown and as an HTML table: squared bias, its share of the error.
std::string toMarkdown(const std::vector<ReplicateBias>& biases);
std::string toHtml(const std::vector<ReplicateBias>& biases);

}  // namespace braid
