// SPDX-License-Identifier: Apache-2.0
// What documents and comments say about the repository is there: links lead to files, citations to headings, and
// comments stay short.
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace braid::test_documents {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kTopFolders = {"renderer", "integrators", "combiners", "braid",
                                              "tools",    "tests",       "scenes"};
constexpr size_t kLongestComment = 12;

struct Text {
  std::string path;  // relative to the repository
  std::string content;
};

std::string read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The files of the repository with one of these endings; "" is a name without one. Builds are none of its files.
std::vector<Text> filesOf(const std::set<std::string>& endings) {
  const fs::path root = BRAID_SOURCE_DIR;
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(root))
    if (entry.is_regular_file()) paths.push_back(entry.path());
  for (const std::string& top : kTopFolders)
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / top))
      if (entry.is_regular_file()) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<Text> files;
  for (const fs::path& path : paths)
    if (endings.count(path.extension().string()))
      files.push_back({fs::relative(path, root).generic_string(), read(path)});
  return files;
}

std::vector<Text> sources() { return filesOf({".h", ".cpp", ".def", ".cmake"}); }

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> findAll(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator i(text.begin(), text.end(), regex), end; i != end; ++i) found.push_back((*i)[1]);
  return found;
}

// The headings of a document, without their marks.
std::set<std::string> headingsOf(const std::string& markdown) {
  std::set<std::string> headings;
  for (const std::string& line : linesOf(markdown)) {
    const size_t level = line.find_first_not_of('#');
    if (level > 0 && level != std::string::npos && line[level] == ' ') headings.insert(line.substr(level + 1));
  }
  return headings;
}

// The anchor that GitHub gives a heading.
std::string anchorOf(const std::string& heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto u = static_cast<unsigned char>(c);
    if (c == ' ') anchor += '-';
    if (std::isalnum(u) || c == '-' || c == '_' || u >= 128) anchor += static_cast<char>(std::tolower(u));
  }
  return anchor;
}

// Where the links of a document lead that stay in the repository, e.g. "../tools/README.md#exit-codes".
std::vector<std::string> linksOf(const std::string& markdown) {
  std::vector<std::string> links = findAll(markdown, R"(\]\(([^)\s]+)\))");
  links.erase(std::remove_if(links.begin(), links.end(),
                             [](const std::string& l) { return l.find("://") != std::string::npos; }),
              links.end());
  return links;
}

// Whether a link of the document at `path` leads anywhere.
bool leads(const Text& document, const std::string& link) {
  const size_t hash = link.find('#');
  const fs::path here = fs::path(BRAID_SOURCE_DIR) / document.path;
  const fs::path file = hash == 0 ? here : here.parent_path() / link.substr(0, hash);
  if (!fs::exists(file)) return false;
  if (hash == std::string::npos) return true;
  for (const std::string& heading : headingsOf(read(file)))
    if (anchorOf(heading) == link.substr(hash + 1)) return true;
  return false;
}

// The comments of a source in the order of its lines: each is the lines of comment that stand together. `trailing`:
// also what stands behind code.
std::vector<std::vector<std::string>> commentsOf(const Text& source, bool trailing) {
  const std::string mark = fs::path(source.path).extension() == ".cmake" ? "#" : "//";
  std::vector<std::vector<std::string>> comments;
  bool inside = false;
  for (const std::string& line : linesOf(source.content)) {
    const size_t at = line.find(mark);
    const bool comment = at != std::string::npos && (trailing || at == line.find_first_not_of(" \t")) &&
                         line.find("SPDX-License-Identifier") == std::string::npos;
    if (comment && !inside) comments.emplace_back();
    if (comment) comments.back().push_back(line.substr(at + mark.size()));
    inside = comment;
  }
  return comments;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line;
  return std::regex_replace(text, std::regex("\\s+"), " ");
}

// A citation of a section: "integrators/README.md, Photon mapping". What follows the name may be anything but a letter
// or digit, so a cited heading is the longest one that the text begins with.
struct Citation {
  std::string document, text;
};

std::vector<Citation> citationsOf(const std::string& comment) {
  static const std::regex regex(R"(([\w./]*\b(README|EXPERIMENTS|auto)\.md), ([^\n]*))");
  std::vector<Citation> citations;
  for (std::sregex_iterator i(comment.begin(), comment.end(), regex), end; i != end; ++i) {
    citations.push_back({(*i)[1], (*i)[3]});
    // More of them in what this one took for its text.
    for (Citation& c : citationsOf((*i)[3])) citations.push_back(std::move(c));
  }
  return citations;
}

bool names(const std::string& text, const std::string& heading) {
  if (text.compare(0, heading.size(), heading) != 0) return false;
  return text.size() == heading.size() || !std::isalnum(static_cast<unsigned char>(text[heading.size()]));
}

bool resolves(const Citation& citation, const std::set<std::string>& headings) {
  return std::any_of(headings.begin(), headings.end(),
                     [&](const std::string& heading) { return names(citation.text, heading); });
}

// The files that a text names by their way from the top of the repository, e.g. "renderer/film/film.h".
std::vector<std::string> namedFiles(const std::string& text) {
  return findAll(text,
                 "(?:^|[^\\w/.])((?:braid|renderer|integrators|combiners|tools|tests|scenes)/[\\w./-]+\\."
                 "(?:h|cpp|def|md|py|sh|txt|csv|png|glb|cmake))\\b");
}

// A line with three numbers and more that stand in columns.
bool isTableRow(const std::string& line) {
  static const std::regex number(R"((^|\s{2,}|\|)\s*[-+<>~]?\d[\d.,]*(e-?\d+)?\s*[x%]?(?=\s{2,}|\s*\||\s*$))");
  return std::distance(std::sregex_iterator(line.begin(), line.end(), number), {}) >= 3;
}

// What speaks of documents that are not in the repository. In two parts, so that this file does not.
const std::vector<std::string> kForbidden = {
    "ALGO"
    "RITHMS",
    "DESIGN"
    ".md",
    "ECO"
    "SYSTEM.md"};

size_t charactersOf(const std::string& line) {
  return static_cast<size_t>(
      std::count_if(line.begin(), line.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

}  // namespace

TEST_CASE("Links of documents lead to files and headings of the repository") {
  size_t links = 0;
  for (const Text& document : filesOf({".md"}))
    for (const std::string& link : linksOf(document.content)) {
      ++links;
      CHECK_MESSAGE(leads(document, link), document.path, " links to ", link, ", which is not there");
    }
  CHECK(links > 20);
}

TEST_CASE("Every section that code cites exists") {
  size_t citations = 0;
  for (const Text& source : sources())
    for (const std::vector<std::string>& comment : commentsOf(source, true))
      for (const Citation& c : citationsOf(joined(comment))) {
        ++citations;
        const fs::path file = fs::path(BRAID_SOURCE_DIR) / c.document;
        const bool found = fs::exists(file) && resolves(c, headingsOf(read(file)));
        CHECK_MESSAGE(found, source.path, " cites ", c.document, ", ", c.text.substr(0, 60), ": no such heading");
      }
  CHECK(citations > 3);
}

TEST_CASE("Files that documents and comments name are there") {
  const auto check = [](const std::string& where, const std::string& text) {
    for (const std::string& file : namedFiles(text))
      CHECK_MESSAGE(fs::exists(fs::path(BRAID_SOURCE_DIR) / file), where, " names ", file, ", which is not there");
  };
  for (const Text& document : filesOf({".md"})) check(document.path, document.content);
  for (const Text& source : sources())
    for (const std::vector<std::string>& comment : commentsOf(source, true)) check(source.path, joined(comment));
}

TEST_CASE("Nothing cites what is not in the repository") {
  for (const Text& file : filesOf({".h", ".cpp", ".def", ".cmake", ".md", ".py", ".sh", ".txt", ""}))
    for (const std::string& word : kForbidden)
      CHECK_MESSAGE(file.content.find(word) == std::string::npos, file.path, " mentions ", word);
}

TEST_CASE("The front page is short, and every folder says what it is for") {
  const std::vector<std::string> lines = linesOf(read(fs::path(BRAID_SOURCE_DIR) / "README.md"));
  CHECK(lines.size() <= 150);
  for (const std::string& line : lines) CHECK_MESSAGE(charactersOf(line) <= 120, "README.md: ", line);
  for (const std::string& folder : kTopFolders)
    CHECK_MESSAGE(fs::exists(fs::path(BRAID_SOURCE_DIR) / folder / "README.md"), folder, " has no README.md");
}

TEST_CASE("Comments say why in a few lines, and hold no tables of results") {
  for (const Text& source : sources())
    for (const std::vector<std::string>& comment : commentsOf(source, false)) {
      CHECK_MESSAGE(comment.size() <= kLongestComment, source.path, ": a comment of ", comment.size(),
                    " lines, which begins ", comment.front());
      for (const std::string& line : comment)
        CHECK_MESSAGE(!isTableRow(line), source.path, ": a table in a comment: ", line);
    }
}

TEST_CASE("The checks of documents see faults") {
  const Text document{"tools/README.md", ""};
  CHECK(linksOf("[a](b.md) ![c](d/e.png) [f](https://g) [h\ni](#j)") ==
        std::vector<std::string>{"b.md", "d/e.png", "#j"});
  CHECK(leads(document, "../LICENSE"));
  CHECK_FALSE(leads(document, "../no such file.md"));
  CHECK(leads(document, "#exit-codes"));
  CHECK_FALSE(leads(document, "#no-such-heading"));
  CHECK(anchorOf("What is in the EXR") == "what-is-in-the-exr");
  CHECK(anchorOf("Graph, file & co") == "graph-file--co");
  CHECK(headingsOf("# A\ntext\n## B c\n#no\n") == std::set<std::string>{"A", "B c"});

  const std::vector<Citation> cited = citationsOf("as (x/README.md, Photon mapping) and y/README.md, Bias.");
  REQUIRE(cited.size() == 2);
  CHECK(cited[0].document == "x/README.md");
  CHECK(resolves(cited[0], {"Photon mapping"}));
  CHECK_FALSE(resolves(cited[0], {"Photon maps", "Photon mapping of the sun"}));
  CHECK(resolves(cited[1], {"Bias"}));
  CHECK_FALSE(resolves(cited[1], {"Bia"}));
  CHECK(citationsOf("see the README.md of the folder").empty());

  const Text source{"a.h", "// SPDX-License-Identifier: x\n// a\n//   b\nint c;  // d\n  // e\n"};
  CHECK(commentsOf(source, false).size() == 2);
  CHECK(commentsOf(source, true).at(0).size() == 4);
  CHECK(commentsOf({"a.cmake", "# a\n# b\nset(c)\n"}, false).at(0).size() == 2);
  CHECK(namedFiles("(renderer/film/film.h), `tools/x.cpp` and ../tools/y.md; tests/z") ==
        std::vector<std::string>{"renderer/film/film.h", "tools/x.cpp"});
  CHECK(isTableRow("  box   0.12  0.33   1.5x"));
  CHECK(isTableRow(" | 4 spp | 0.1 | 0.2 | 3 % |"));
  CHECK_FALSE(isTableRow(" 0.5 to 0.8 of the error at 16, 64 and 256 samples"));
  CHECK(charactersOf("1 − α") == 5);
}

}  // namespace braid::test_documents
