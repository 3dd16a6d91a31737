// SPDX-License-Identifier: Apache-2.0
// Runs what a scheduler would, with a program that writes down its arguments.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "tests/support/command_line.h"
#include "tools/commands/farm_job.h"

namespace braid::test::farm_jobs {

using Words = std::vector<std::string>;
using Calls = std::map<std::string, Words>;  // by passes, or "merge"

inline const std::string kUgly = "o'hara \"$HOME\" `id` \\n #LAYER# #IFRAME# 100% ;&|<>()*?[]{}~!, größe 漢字 😀";

inline void write(const std::filesystem::path& path, const std::string& text, bool program = false) {
  std::ofstream(path, std::ios::binary) << text;
  if (program) std::filesystem::permissions(path, std::filesystem::perms::owner_all);
}

// Exit code of a shell command in the folder.
inline int shell(const Folder& folder, const std::string& command) {
  const int status =
      std::system(("cd '" + folder.path.string() + "' && { " + command + "\n} >log 2>&1 </dev/null").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

inline void must(const Folder& folder, const std::string& command) {
  INFO(command);
  const int code = shell(folder, command);
  INFO(readText(folder.path / "log"));
  REQUIRE(code == 0);
}

// A job whose names and values are as bad as they get; its program writes down where and how it was called.
struct UglyJob {
  Folder folder;
  FarmJob job;
  UglyJob() {
    const std::filesystem::path inner = folder.path / ("-in " + kUgly);
    std::filesystem::create_directory(inner);
    job.program = folder.path / "-pro gram's";
    job.folder = inner;
    job.scene = "-scene " + kUgly + ".glb";
    job.output = "-out " + kUgly + ".exr";
    job.render = {{"--size", "26x17"}, {"--env", "-sky " + kUgly}, {"--full", std::nullopt}, {"--variant", ""}};
    job.merge = {{"--png", "-" + kUgly + ".png"}, {"--float", std::nullopt}};
    job.spp = 18;
    job.tasks = 3;
    write(job.program,
          "#!/bin/bash\nset -C\nfor ((i = 0;; ++i)); do { : > '" + folder.path.string() +
              "'/call$i; } 2>/dev/null && break; done\n"
              "printf '%s\\n' \"$PWD\" \"$@\" >| '" +
              folder.path.string() + "'/call$i\n",
          true);
  }
  void print(FarmFormat format, const std::string& name) const { write(folder.path / name, farmJobText(job, format)); }

  Calls calls() const {
    Calls all;
    for (int i = 0; std::filesystem::exists(folder.path / ("call" + std::to_string(i))); ++i) {
      std::ifstream in(folder.path / ("call" + std::to_string(i)));
      Words words;
      for (std::string word; std::getline(in, word);) words.push_back(word);
      REQUIRE(words.size() > 2);
      CHECK(words[0] == job.folder);
      words.erase(words.begin());
      std::string key = words[0];
      for (const std::string& w : words)
        if (w.starts_with("--passes=")) key = w.substr(9);
      CHECK(all.count(key) == 0);
      all[key] = words;
    }
    return all;
  }

  // The calls were those of the job, `threads` being what a farm gives where the user said nothing.
  void check(const Calls& calls, const std::string& threads) const {
    const auto sorted = [&](Words words) {
      if (!threads.empty()) words.push_back("--threads=" + threads);
      std::sort(words.begin(), words.end());
      return words;
    };
    const auto sortedCall = [&](const std::string& key) {
      REQUIRE_MESSAGE(calls.count(key) == 1, key);
      Words words = calls.at(key);
      std::sort(words.begin(), words.end());
      return words;
    };
    CHECK(calls.size() == 4);
    const char* passes[] = {"0:8", "8:12", "12:18"};
    Words parts;
    for (int k = 0; k < 3; ++k) {
      const std::string state = "-out " + kUgly + ".shard" + std::to_string(k) + ".state";
      parts.push_back("./" + state);
      CHECK(sortedCall(passes[k]) ==
            sorted({"render", "./-scene " + kUgly + ".glb", "--size=26x17", "--env=-sky " + kUgly, "--full",
                    "--variant=", "--resume", std::string("--passes=") + passes[k], "--checkpoint=" + state}));
      CHECK(calls.at(passes[k])[0] == "render");
    }
    parts.insert(parts.end(), {"merge", "--output=-out " + kUgly + ".exr", "--png=-" + kUgly + ".png", "--float"});
    CHECK(sortedCall("merge") == sorted(parts));
    CHECK(calls.at("merge")[0] == "merge");
  }
};

}  // namespace braid::test::farm_jobs
