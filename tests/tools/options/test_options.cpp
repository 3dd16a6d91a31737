// SPDX-License-Identifier: Apache-2.0
// Numbers out of their range are refused with the range, by every option of every subcommand.
#include <set>
#include <utility>

#include <CLI/CLI.hpp>
#include <doctest/doctest.h>
#include <fmt/format.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/combine_plan.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/command_line.h"
#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/old_spellings.h"
#include "tools/options/syntax/option_checks.h"

namespace braid::test_options {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Run;

namespace {

const std::vector<std::string> kWrong = {
    "nan", "inf", "-inf", "1e999", "-1e999", "-1e30",         "1e300", "99999999999999999999999x",
    "5x",  "5 ",  " 5",   "0x10",  "five",   "1,2,3,4,5,6,7", "--5"};

// What options that take no numbers say of themselves. A new option says one of these, or gets a check of
// tools/options/syntax/option_checks.h.
const std::set<std::string> kTexts = {"FILE", "FILES", "FOLDER", "NAME", "NAMES", "OPTIONS", "SET"};

// What the command line says of a value that it refuses; empty if it takes it.
std::string complaintOf(CLI::App& app, const std::vector<std::string>& words) {
  std::vector<std::string> reversed(words.rbegin(), words.rend());
  try {
    app.parse(reversed);
  } catch (const CLI::ValidationError& e) {
    return e.what();
  } catch (const CLI::ParseError&) {
  }
  return "";
}

// By a command line of its own: options keep the values that they take.
std::string complaintOf(const std::vector<std::string>& words) {
  CLI::App app;
  MainOptions options;
  Action action;
  addCommands(app, options, action);
  return complaintOf(app, words);
}

bool takesValues(const CLI::Option& o) { return o.get_items_expected_max() > 0; }

bool takesNumbers(CLI::Option& o) {
  try {
    return o.get_validator(kNumberCheck) != nullptr;
  } catch (const CLI::OptionNotFound&) {
    return false;
  }
}

void taken(const std::string& option, const std::string& value) {
  CAPTURE(option);
  CAPTURE(value);
  CHECK(complaintOf({"render", option + "=" + value}) == "");
}

void refused(const std::string& option, const std::string& value, const std::string& range) {
  CAPTURE(option);
  CAPTURE(value);
  const std::string complaint = complaintOf({"render", option + "=" + value});
  CHECK(contains(complaint, "'" + value + "'"));
  CHECK(contains(complaint, range));
}

}  // namespace

TEST_CASE("Every option of every subcommand refuses what is no number of its range, and says the range") {
  CLI::App app;
  MainOptions mainOptions;
  Action action;
  addCommands(app, mainOptions, action);
  std::vector<CLI::App*> commands = app.get_subcommands(nullptr);
  REQUIRE(commands.size() >= 10);
  commands.push_back(&app);
  size_t numbers = 0, texts = 0;
  for (CLI::App* command : commands)
    for (CLI::Option* option : command->get_options()) {
      if (!takesValues(*option) || option->get_lnames().empty()) continue;
      const std::string name = "--" + option->get_lnames().front();
      const std::string commandName = command->get_name();
      CAPTURE(commandName);
      CAPTURE(name);
      if (!takesNumbers(*option)) {
        CHECK_MESSAGE(
            kTexts.count(option->get_type_name()) == 1, name, " of ", command->get_name(),
            ": give it a check of tools/options/syntax/option_checks.h, or a type_name() that says what text it is");
        ++texts;
        continue;
      }
      ++numbers;
      std::vector<std::string> words;
      if (command != &app) words.push_back(command->get_name());
      const std::string type = option->get_type_name();
      for (std::string wrong : kWrong) {
        if (type == "LADDER" && contains(wrong, ",")) continue;  // a list like any other
        if (type == "HOST:PORT") wrong = "localhost:" + wrong;
        CAPTURE(wrong);
        std::vector<std::string> all = words;
        all.push_back(name + "=" + wrong);
        const std::string complaint = complaintOf(app, all);  // all are refused, so that one serves for all
        CHECK_MESSAGE(contains(complaint, "expected "), name, "=", wrong, " of ", command->get_name(), ": ", complaint);
        CHECK(contains(complaint, name));
      }
    }
  MESSAGE(numbers << " options of numbers, " << texts << " of texts");
  CHECK(numbers > 250);
  CHECK(texts > 50);
}

TEST_CASE("Numbers within their ranges pass, with the ends that belong to them") {
  taken("--spp", "1");
  taken("--spp", "0016");  // not octal
  refused("--spp", "0", "a whole number from 1 to ");
  refused("--spp", "-3", "from 1");
  refused("--spp", "1.5", "a whole number");
  refused("--spp", "1099511627777", "1099511627776");
  taken("--seed", "18446744073709551615");
  refused("--seed", "18446744073709551616", "from 0 to 18446744073709551615");
  taken("--yfov", "179.9");
  refused("--yfov", "180", "a number above 0 to below 180");
  refused("--yfov", "0", "above 0");
  taken("--frame-time", "0");
  refused("--frame-time", "-0.5", "from 0 to 1e+09");
  taken("--env-rotate", "-90");
  taken("--exposure", "-3.5");
  refused("--exposure", "65", "from -64 to 64");
  refused("--error", "0", "above 0");
  taken("--threads", "0");
  refused("--threads", "5000", "from 0 to 4096");
  refused("--clamp", "-1", "from 0");
  taken("--point-radius", "0.001");
  for (const char* wrong : {"0", "-1", "nan"}) refused("--point-radius", wrong, "from 1e-12 to 1e+09");
  refused("--photon-radius", "0", "from 0.01 to 1000");
  refused("--photons", "0", "from 1 to 268435456");
  taken("--js-constant", "1.25");
  refused("--js-constant", "-1", "from 0 to 100");
  refused("--nlm-window", "2.5", "a whole number from 0 to 100");
  refused("--auto-fuse", "2", "from 0 to 1");
}

TEST_CASE("The default and both ends of every method's option are in its range") {
  for (const OptionInfo& o : allMethodOptions()) {
    CHECK_MESSAGE(o.least < o.most, o.name);
    for (const double value : {o.fallback, o.least, o.most}) taken("--" + o.name, fmt::format("{:.17g}", value));
  }
  taken("--pw-threshold", "1.6");
  refused("--pw-threshold", "11", "a number from 0.1 to 10");
  taken("--external-command-timeout", "0.5");
}

TEST_CASE("Sizes, lists of numbers, durations and addresses are checked part by part") {
  taken("--size", "65536x1");
  for (const char* size : {"0x5", "5x0", "-5x5", "65537x1", "65536x65536", "5", "5x", "x5", "5x5x5", "5.5x5", "5X5"})
    refused("--size", size, "WIDTHxHEIGHT such as 1280x720, from 1 to 65536");
  taken("--crop", "0,0,1,1");
  for (const char* crop : {"0,0,0,1", "3,0,1,1", "-1,0,1,1", "0,0,1", "0,0,1,1,1", "0,0,1,70000", "0,0,1,nan"})
    refused("--crop", crop, "x0,y0,x1,y1: 4 numbers from 0 to 65536");
  taken("--look-at", "-1e6,0,0.5,1,1,1");
  refused("--look-at", "1,2,3", "6 numbers");
  taken("--background", "0,0.5,1e3");
  refused("--background", "0,0,-1", "3 numbers from 0 to ");
  taken("--time", "1h30m");
  for (const char* time : {"0", "0s", "-5", "nan", "1e400", "5d", "5 s", "2e9"}) refused("--time", time, "duration");
  taken("--save-every", "0");
  refused("--save-every", "-1", "duration");
  taken("--tev", "localhost:14158");
  refused("--tev", "localhost:70000", "the port from 1 to 65535");
  taken("--passes", "0:256");
  refused("--passes", "5:5", "FIRST:END");
  taken("--memory-limit", "1.5G");
  refused("--memory-limit", "1M", "at least 192 MiB");
}

TEST_CASE("The program tells a wrong number in one line with exit code 1, before it reads anything") {
  const Folder folder;
  for (const char* command :
       {"render none.glb -o a.exr --spp nan", "preview none.glb --http 65536", "plan none.glb --size 0x0",
        "info none.glb --yfov inf", "compare a.exr b.exr --max nan",
        "combine --unbiased a.exr --method box -o b.exr --spp 0", "merge a.state -o b.exr --threads -1",
        "sweep none.glb -o out --seeds 0", "sweep none.glb -o out --spp 0:8", "replay none.glb --pixel 1,nan",
        "bench --repeats 0", "info none.glb --memory-limit 5"}) {
    const Run run = braidRun(folder, command);
    INFO(command, ": ", run.err);
    CHECK(run.code == 1);
    CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
    CHECK(contains(run.err, "expected "));
  }
}

TEST_CASE("Options by their old names mean what the present ones do, up to a lone --") {
  const char* const line[] = {"braid", "render", "--light-parts", "--auto-despike=0", "x", "--", "--light-parts"};
  const std::vector<std::string> expected{"braid", "render", "--direct-indirect", "--auto-remove-fireflies=0",
                                          "x",     "--",     "--light-parts"};
  CHECK(presentSpellings(7, line) == expected);
  test::Folder folder;
  const Run run = braidRun(folder, "plan '" BRAID_SOURCE_DIR "/scenes/cornell.glb' --light-parts --auto-second-pass 0");
  CHECK(run.code == 0);
}

namespace {

std::string helpOf(const std::vector<std::string>& arguments) {
  CLI::App app;
  app.set_help_flag("-h,--help", "Help");
  MainOptions options;
  Action action;
  addCommands(app, options, action);
  const std::optional<HelpRequest> request = findHelp(app, arguments);
  return request ? helpText(app, *request) : "";
}

// Codepoints of the longest line.
size_t longestLine(const std::string& text) {
  size_t longest = 0, length = 0;
  for (const char c : text) {
    if ((static_cast<unsigned char>(c) & 0xc0) != 0x80) ++length;
    if (c == '\n') longest = std::max(longest, std::exchange(length, 0) - 1);
  }
  return longest;
}

}  // namespace

TEST_CASE("The help of a command is one screen; that of everything names every option") {
  CLI::App app;
  MainOptions mainOptions;
  Action action;
  addCommands(app, mainOptions, action);
  for (CLI::App* command : app.get_subcommands(nullptr)) {
    const std::string name = command->get_name();
    CAPTURE(name);
    const std::string help = helpOf({name, "-h"});
    CHECK(std::count(help.begin(), help.end(), '\n') <= 50);
    CHECK(longestLine(help) <= 100);
    CHECK(contains(help, "Usage: braid " + name));
    CHECK(contains(help, command->get_footer()));
    CHECK(help == helpOf({name, "x.glb", "--help"}));
    const std::string all = helpOf({name, "--help-all"});
    for (const CLI::Option* option : command->get_options()) CHECK(contains(all, option->get_name(false, true)));
  }
  CHECK(contains(helpOf({"-h"}), "  render "));
  CHECK(helpOf({"-h", "render"}) == helpOf({"render", "-h"}));
  CHECK(helpOf({"render", "x.glb"}).empty());
  CHECK(helpOf({"render", "--", "-h"}).empty());
}

TEST_CASE("The help of a method has its options and no others") {
  const std::string box = helpOf({"render", "-h", "box"}), all = helpOf({"combine", "--help-methods"});
  CHECK(contains(box, "--box-radius"));
  CHECK_FALSE(contains(box, "--nlm-window"));
  CHECK(contains(helpOf({"render", "-h", "oidn"}), "--oidn-weights FOLDER"));
  CHECK(helpOf({"render", "x.glb", "--help", "js@box"}) == helpOf({"render", "-h", "js"}));
  for (const OptionInfo& info : allMethodOptions()) CHECK(contains(all, "--" + info.name));
  for (const auto& m : makeMethods()) CHECK(contains(all, std::string(m->name()) + ": "));
  // What is no method's name may be the scene that was to be rendered.
  CHECK(helpOf({"render", "-h", "x.glb"}) == helpOf({"render", "-h"}));
  test::Folder folder;
  const Run run = braidRun(folder, "render -h boxx");
  CHECK(run.code == 1);
  CHECK(contains(run.err, "-h boxx: no denoiser or combiner of this name: known are "));
  CHECK(braidRun(folder, "render none.glb --spp 0 -h").code == 0);
}

}  // namespace braid::test_options
