// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_record.h"

#include <cmath>
#include <fstream>
#include <thread>

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/session/rendering_revision.h"
#include "tools/options/scene_options.h"
#include "tools/prepare/scene_identity.h"

namespace braid {

namespace {

using Json = nlohmann::ordered_json;

std::string processorName() {
  std::ifstream info("/proc/cpuinfo");
  std::string line;
  while (std::getline(info, line))
    if (line.rfind("model name", 0) == 0) {
      const size_t colon = line.find(": ");
      return colon == std::string::npos ? "" : line.substr(colon + 2);
    }
  return "unknown";
}

[[noreturn]] void refuse(const std::string& path, const std::string& what, const Json& before, const Json& now) {
  throw Error(ExitCode::Usage,
              fmt::format("{}: the sweep in this folder was made with {} {}, not {}: its rows cannot be compared with "
                          "new ones; give the same options or another folder (-o)",
                          path, what, before.dump(), now.dump()));
}

// What the options choose of every scene, as they were given.
std::string optionsText(const SceneChoice& c) {
  std::string text = changedOptions(c, {});
  const auto add = [&](const std::string& option) { text += (text.empty() ? "" : ", ") + option; };
  if (!c.environment.empty()) add("--env " + c.environment);
  if (!c.camera.empty()) add("--camera " + c.camera);
  if (c.yfovDegrees > 0) add(fmt::format("--yfov {}", c.yfovDegrees));
  if (c.lookAt) {
    const glm::dvec3 &eye = c.lookAt->eye, &target = c.lookAt->target;
    add(fmt::format("--look-at {},{},{},{},{},{}", eye.x, eye.y, eye.z, target.x, target.y, target.z));
  }
  return text;
}

Json finiteOrNull(double v) { return std::isfinite(v) ? Json(v) : Json(); }

}  // namespace

Json sweepSettings(const SweepOptions& options, const Settings& settings, const Measurement& measurement) {
  Json metrics = Json::array();
  for (const Metric* m : measurement.metrics) metrics.push_back(m->name);
  return {{"renderingRevision", kRenderingRevision},
          {"size", fmt::format("{}x{}", settings.width, settings.height)},
          {"maxDepth", settings.maxDepth},
          {"sampler", toString(options.sampler)},
          {"threads", options.threads},
          {"isa", options.view.isa},
          {"options", optionsText(options.view)},
          {"cropWorst", options.cropWorst},
          {"metrics", metrics}};
}

Json machineRecord() {
  utsname system{};
  uname(&system);
  const double memory = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)) /
                        (1024.0 * 1024 * 1024);
  return {{"processor", processorName()},
          {"threads", std::thread::hardware_concurrency()},
          {"memoryGiB", std::round(10 * memory) / 10},
          {"system", fmt::format("{} {} {}", system.sysname, system.release, system.machine)}};
}

Json sceneRecord(const SweepScene& scene, const ReferenceFrame& frame) {
  const SweepReference& r = scene.reference;
  Json reference = {{"file", r.file},
                    {"integrator", r.integrator},
                    {"spp", r.spp},
                    {"seconds", r.seconds},
                    {"hash", hexString(r.contentHash)},
                    {"relL2OfItsNoise", finiteOrNull(referenceNoise(r.image))}};
  return {{"name", scene.name},
          {"file", scene.file},
          {"hash", hexString(frame.sceneHash)},
          {"frame", referenceName(frame)},
          {"options", frame.options},
          {"planned", scene.planned},
          {"seconds",
           {{"load", scene.loadSeconds},
            {"prepare", scene.scene->buildTimes().prepare},
            {"hierarchy", scene.scene->buildTimes().hierarchy}}},
          {"reference", reference}};
}

Json readRecord(const std::string& path) {
  std::ifstream in(path);
  Json record = Json::parse(in, nullptr, false);
  if (!in || !record.is_object() || !record.contains("settings") || !record.contains("scenes"))
    throw Error(ExitCode::Usage, fmt::format("{}: is missing or damaged, so the rows beside it cannot be added to: "
                                             "choose another folder (-o) or delete the old sweep.csv",
                                             path));
  return record;
}

void requireSameSettings(const std::string& path, const Json& before, const Json& now) {
  for (const auto& [name, value] : now.items()) {
    // Older folders know nothing of options that came later, and used none.
    const Json old = before.contains(name) ? before[name] : value.is_string() ? Json("") : Json();
    if (old != value) refuse(path, name, old, value);
  }
}

void requireSameScene(const std::string& path, const Json& before, const Json& now) {
  const std::string name = now["name"];
  if (before["frame"] != now["frame"])
    refuse(path, "another file, camera or light of the scene " + name + ":", before["frame"], now["frame"]);
  if (before["reference"]["hash"] != now["reference"]["hash"])
    refuse(path, "another reference of the scene " + name + ":", before["reference"], now["reference"]);
}

}  // namespace braid
