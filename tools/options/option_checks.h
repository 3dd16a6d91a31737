// SPDX-License-Identifier: Apache-2.0
// What numbers options take. Every option whose value holds numbers has one of these checks, so that what is no number,
// not finite, followed by anything else or out of its range ends in exit code 1 with the range, before any work.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "combiners/method.h"

namespace braid {

// The name of all these checks, by which the test that walks over all options knows those of numbers.
inline constexpr const char* kNumberCheck = "numbers";

enum class Ends { Included, LeastExcluded, MostExcluded, Excluded };

// Bounds that mean no more than that floats hold the number and what is made of it.
inline constexpr double kLargeNumber = 1e20;
inline constexpr uint64_t kMostSamples = uint64_t(1) << 40;

CLI::Validator wholeNumber(uint64_t least, uint64_t most);
CLI::Validator anySeed();
CLI::Validator number(double least, double most, Ends ends = Ends::Included);
CLI::Validator numberOf(const OptionInfo& option);
// The texts of tools/options/option_texts.h and others that a parser reads: it throws Error with what it expects.
template <class Parser>
CLI::Validator readBy(Parser parser);
// 90, 90s, 2m, 1h30m; more than nothing unless `orZero`.
CLI::Validator duration(bool orZero = false);

// --threads, which many subcommands have.
CLI::Option* addThreads(CLI::App& command, int& threads);

// What the parser says when it throws; nothing if it does not.
std::string complaint(const std::function<void(const std::string&)>& parser, const std::string& text);

template <class Parser>
CLI::Validator readBy(Parser parser) {
  return {[parser](std::string& text) { return complaint([&](const std::string& t) { (void)parser(t); }, text); }, "",
          kNumberCheck};
}

}  // namespace braid
