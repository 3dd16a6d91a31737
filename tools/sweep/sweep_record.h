// SPDX-License-Identifier: Apache-2.0
// sweep.json: what a sweep was made with, so that a later run adds to it only what can be compared.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_run.h"

namespace braid {

// Everything that a row's numbers depend on besides the scene and its reference. Ladders, methods, seeds and scenes are
// not among it: a sweep may grow.
nlohmann::ordered_json sweepSettings(const SweepOptions& options, const Settings& settings,
                                     const Measurement& measurement);

// Processor, threads, memory and system.
nlohmann::ordered_json machineRecord();

nlohmann::ordered_json sceneRecord(const SweepScene& scene, const ReferenceFrame& frame);

// Reads DIR/sweep.json. Throws Error(Usage) when it is missing or no JSON: rows without it cannot be added to.
nlohmann::ordered_json readRecord(const std::string& path);

// Throws Error(Usage), naming the first setting that differs and both values.
void requireSameSettings(const std::string& path, const nlohmann::ordered_json& before,
                         const nlohmann::ordered_json& now);
// The same for a scene: its file and its reference.
void requireSameScene(const std::string& path, const nlohmann::ordered_json& before, const nlohmann::ordered_json& now);

}  // namespace braid
