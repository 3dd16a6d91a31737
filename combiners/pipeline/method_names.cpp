// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/method_names.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include <fmt/format.h>

#include "combiners/pipeline/denoise_cutoff.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"

namespace braid {

namespace {

// The method for what follows the colon.
std::unique_ptr<Method> withStop(const StoppingMethod& method, const std::string& full, size_t begin) {
  uint64_t passes = 0;
  const char *at = full.data() + begin, *end = full.data() + full.size();
  const auto [next, error] = std::from_chars(at, end, passes);
  if (at == end || error != std::errc() || next != end || passes == 0)
    throw Error(ExitCode::Usage, fmt::format("{}: expected {}:PASSES, after which denoising stops, such as {}:128",
                                             full, method.name(), method.name()));
  return method.stoppedAfter(passes);
}

std::string knownMethods() {
  std::string known;
  for (const auto& m : makeMethods()) known += fmt::format("{}{}", known.empty() ? "" : ", ", m->name());
  return known;
}

}  // namespace

std::pair<std::string, std::string> splitChain(const std::string& name) {
  const size_t at = name.find('@'), colon = name.find(':');
  if (at == std::string::npos) return {name, ""};
  if (colon < at && name.find_first_not_of("0123456789", colon + 1) != at) return {name, ""};
  return {name.substr(0, at), name.substr(at + 1)};
}

bool isMethod(const std::string& name) {
  const auto methods = makeMethods();
  return std::any_of(methods.begin(), methods.end(), [&](const auto& m) { return name == m->name(); });
}

std::shared_ptr<const Method> findMethod(const std::string& full) {
  const size_t colon = full.find(':');
  const std::string name = full.substr(0, colon);
  for (auto& m : makeMethods()) {
    if (name != m->name()) continue;
    if (colon == std::string::npos) return std::shared_ptr<const Method>(std::move(m));
    const auto* external = dynamic_cast<const ExternalMethod*>(m.get());
    const auto* stopping = dynamic_cast<const StoppingMethod*>(m.get());
    auto made = external   ? external->with(full.substr(colon + 1))
                : stopping ? withStop(*stopping, full, colon + 1)
                           : nullptr;
    if (!made) throw Error(ExitCode::Usage, fmt::format("{}: {} takes no parameter after a colon", full, name));
    return std::shared_ptr<const Method>(std::move(made));
  }
  throw Error(ExitCode::Usage, fmt::format("unknown method '{}': known are {}", name, knownMethods()));
}

std::vector<OptionInfo> allMethodOptions() {
  std::vector<OptionInfo> all;
  for (const auto& m : makeMethods())
    for (const OptionInfo& option : m->options())
      if (std::none_of(all.begin(), all.end(), [&](const OptionInfo& o) { return o.name == option.name; }))
        all.push_back(option);
  return all;
}

std::string layerName(const std::string& name) {
  const size_t colon = name.find(':');
  std::string text = name.substr(0, colon);
  if (colon != std::string::npos) {
    std::string file = name.substr(colon + 1, name.find(':', colon + 1) - colon - 1), more;
    if (text.ends_with("external-command")) {  // the program, and what distinguishes commands of one program
      ContentHash hash;
      hash.add(name);
      file = file.substr(file.find_first_not_of("' "));
      file = file.substr(0, file.find_first_of("' "));
      more.append("-").append(hexString(hash.value()), 0, 4);
    }
    text.append("-").append(std::filesystem::path(file).stem().string()).append(more);
  }
  std::replace(text.begin(), text.end(), '.', '-');
  return text;
}

}  // namespace braid
