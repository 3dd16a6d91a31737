// SPDX-License-Identifier: Apache-2.0
// The words of a line of a state file: written escaped, read with the line's number in every failure.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/film_state.h"

namespace braid {

// A word without spaces; the empty one is "%".
inline std::string escapedWord(const std::string& text) {
  if (text.empty()) return "%";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte <= 0x20 || byte == '%' || byte == 0x7f)
      out += fmt::format("%{:02x}", byte);
    else
      out += c;
  }
  return out;
}

// The words of one line, taken one after the other; every failure names the line.
class Line {
 public:
  Line(const std::string& file, size_t number, const std::string& text) : file_(file), number_(number) {
    size_t begin = 0;
    while (begin <= text.size()) {
      const size_t end = std::min(text.find(' ', begin), text.size());
      words_.push_back(text.substr(begin, end - begin));
      begin = end + 1;
    }
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: header line {}: {}: use another copy, or render again", file_, number_, what));
  }
  bool done() const { return next_ == words_.size(); }
  size_t left() const { return words_.size() - next_; }
  void end() const {
    if (!done()) fail(fmt::format("'{}' is more than expected", words_[next_]));
  }
  const std::string& raw() {
    if (done()) fail("ends too early");
    return words_[next_++];
  }
  std::string text() {
    const std::string& word = raw();
    if (word == "%") return {};
    std::string out;
    for (size_t i = 0; i < word.size(); ++i) {
      if (word[i] != '%') {
        out += word[i];
        continue;
      }
      unsigned byte = 0;
      const char* at = word.data() + i + 1;
      if (i + 2 >= word.size() || std::from_chars(at, at + 2, byte, 16).ptr != at + 2)
        fail("a broken escape in '" + word + "'");
      out += static_cast<char>(byte);
      i += 2;
    }
    return out;
  }
  uint64_t count(uint64_t most, int base = 10) { return parsed(raw(), most, base); }
  int integer(int least, int most) {
    const std::string& word = raw();
    int value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || value < least || value > most)
      fail(fmt::format("'{}' is not a number from {} to {}", word, least, most));
    return value;
  }
  bool flag() { return integer(0, 1) == 1; }
  double number() {
    const std::string& word = raw();
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != 0) fail(fmt::format("'{}' is not a number", word));
    return value;
  }
  double seconds() {
    const double value = number();
    if (!(value >= 0) || !std::isfinite(value)) fail("seconds are negative or not finite");
    return value;
  }
  PassInterval interval() {
    const std::string& word = raw();
    const size_t colon = word.find(':');
    if (colon == std::string::npos) fail(fmt::format("'{}' is not BEGIN:END", word));
    const PassInterval i{parsed(word.substr(0, colon), kMaxPass, 10), parsed(word.substr(colon + 1), kMaxPass, 10)};
    if (i.begin >= i.end) fail(fmt::format("the passes {} are none", word));
    return i;
  }

 private:
  uint64_t parsed(const std::string& word, uint64_t most, int base) const {
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value, base);
    if (error != std::errc() || end != word.data() + word.size() || value > most)
      fail(fmt::format("'{}' is not a number of at most {}", word, most));
    return value;
  }

  const std::string& file_;
  size_t number_;
  std::vector<std::string> words_;
  size_t next_ = 0;
};

}  // namespace braid
