// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "tools/sweep/report/html.h"
#include "tools/sweep/report/papers.h"

namespace braid {

namespace {

const char* verdict(const PaperClaim& c) { return !c.holds ? "–" : *c.holds ? "yes" : "no"; }

}  // namespace

std::string toMarkdown(const std::vector<PaperSection>& sections) {
  std::string text;
  for (const PaperSection& s : sections) {
    text += fmt::format("### {}\n\n| claim | measured | holds |\n|---|---|---|\n", s.title);
    for (const PaperClaim& c : s.claims) text += fmt::format("| {} | {} | {} |\n", c.claim, c.measured, verdict(c));
    text += "\n";
  }
  return text;
}

std::string toHtml(const std::vector<PaperSection>& sections) {
  std::string text;
  for (const PaperSection& s : sections) {
    text += fmt::format(
        "<h3>{}</h3>\n<div class=wide><table class=claims>\n<tr><th>claim</th><th>measured</th><th>holds</th></tr>\n",
        escaped(s.title));
    for (const PaperClaim& c : s.claims)
      text += fmt::format("<tr><td>{}</td><td>{}</td><td{}>{}</td></tr>\n", escaped(c.claim), escaped(c.measured),
                          c.holds && *c.holds ? " class=best" : "", verdict(c));
    text += "</table></div>\n";
  }
  return text;
}

}  // namespace braid
