// SPDX-License-Identifier: Apache-2.0
// The module _braid, on which the package braid stands (tools/python/braid/__init__.py).
#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "combiners/pipeline/registry.h"
#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "tools/images/estimates_file.h"
#include "tools/metrics/metrics.h"
#include "tools/prepare/scene_record.h"
#include "tools/python/arrays.h"
#include "tools/python/run.h"
#include "version.h"

namespace braid::python {

namespace {

// Calls Python after each round: its False or exception ends the passes, as does an interrupt, which is raised again.
class Callback {
 public:
  explicit Callback(py::object call) : call_(std::move(call)) {}

  bool operator()(const Progress& p) {
    const py::gil_scoped_acquire lock;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (call_.is_none()) return true;
      py::dict progress;
      progress["spp"] = p.round;
      progress["of"] = p.rounds;
      progress["seconds"] = p.seconds;
      progress["seconds_left"] = p.secondsLeft < 0 ? py::object(py::none()) : py::float_(p.secondsLeft);
      const py::object answer = call_(progress);
      return answer.is_none() || answer.cast<bool>();
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  py::object call_;
  std::exception_ptr failure_;
};

template <class Passes>
void withoutLock(py::object call, const Passes& passes) {
  Callback callback(std::move(call));
  {
    const py::gil_scoped_release released;
    passes([&](const Progress& p) { return callback(p); });
  }
  callback.rethrow();
}

std::shared_ptr<const Made> combineArrays(const py::list& given, const py::dict& features, const Words& words,
                                          int threads) {
  const CombineChoice choice = combineChoice(words);
  Estimates all;
  for (const py::handle& of : given) all.estimates.push_back(estimateOf(of.cast<py::dict>()));
  if (all.estimates.empty()) throw Error(ExitCode::Usage, "combine: no image");
  const Rgb<float>& first = all.estimates.front().mean;
  all.width = all.fullWidth = first.width();
  all.height = all.fullHeight = first.height();
  all.window = {0, 0, all.width, all.height};
  all.features = featuresOf(features, all.width, all.height);
  const py::gil_scoped_release released;
  if (all.estimates.front().unbiased) deriveStatistics(all, "the image", nullptr);
  return std::make_shared<const Made>(std::move(all), std::nullopt, choice, threads);
}

py::dict compareImages(const py::array& image, const py::array& reference, const std::vector<std::string>& names) {
  const Rgb<float> a = imageOf(image, "the image"), b = imageOf(reference, "the reference");
  if (a.width() != b.width() || a.height() != b.height())
    throw Error(ExitCode::BadInput, "compare: the images are not of one size");
  py::dict values;
  for (const Metric& metric : metricRegistry()) {
    if (!names.empty() && !std::count(names.begin(), names.end(), metric.name)) continue;
    const py::gil_scoped_release released;
    const double value = evaluate(metric, a, b).value;
    const py::gil_scoped_acquire lock;
    values[metric.name] = value;
  }
  for (const std::string& name : names)
    if (!findMetric(name)) throw Error(ExitCode::Usage, name + ": no such metric: braid.metrics lists them");
  return values;
}

template <class List>
std::vector<std::string> namesOf(const List& list) {
  std::vector<std::string> names;
  for (const auto& item : list) names.push_back(item->name());
  return names;
}

void bindMade(py::module_& m) {
  py::class_<Made, std::shared_ptr<Made>>(m, "Made")
      .def_property_readonly("planes", [](const std::shared_ptr<Made>& made) { return planesOf(made); })
      .def_property_readonly("image", [](const Made& made) { return arrayOf(made.image()); })
      .def_property_readonly("method", &Made::method)
      .def_property_readonly("error", &Made::error)
      .def_property_readonly("combine_seconds", &Made::combineSeconds)
      .def_property_readonly("warnings", &Made::warnings)
      .def("address",
           [](const Made& made, const std::string& name) {
             for (const ExrChannel& channel : made.planes())
               if (channel.name == name) return reinterpret_cast<uintptr_t>(channel.plane->data.data());
             throw py::key_error(name);
           })
      .def("save", &Made::save, py::call_guard<py::gil_scoped_release>());
}

void bindRun(py::module_& m) {
  py::class_<Run>(m, "Run")
      .def(py::init([](const std::shared_ptr<SceneHolder>& scene, const Words& words) {
        const py::gil_scoped_release released;
        return std::make_unique<Run>(scene, words);
      }))
      .def_property_readonly("plan", &Run::planText)
      .def_property_readonly("memory_bytes", [](const Run& run) { return run.planned().memory.total(); })
      .def("advance",
           [](Run& run, py::object call) {
             withoutLock(std::move(call), [&](const auto& progress) { run.advance(progress); });
           })
      .def("resume",
           [](Run& run, uint64_t spp, double seconds, py::object call) {
             withoutLock(std::move(call), [&](const auto& progress) { run.resume(spp, seconds, progress); });
           })
      .def(
          "made", [](Run& run) { return std::const_pointer_cast<Made>(run.made()); },
          py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("threads", &Run::threads)
      .def_property_readonly("spp", [](const Run& run) { return run.report().spp; })
      .def_property_readonly("seconds", [](const Run& run) { return run.report().seconds; })
      .def_property_readonly("reason", [](const Run& run) { return toString(run.report().reason); });
}

}  // namespace

PYBIND11_MODULE(_braid, m) {
  static py::exception<Error> error(m, "BraidError", PyExc_RuntimeError);
  error.attr("__module__") = "braid";
  error.attr("__doc__") =
      "What braid refuses, in one sentence; its number in .code is the exit code of the command line.";
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const Error& e) {
      const py::object instance = py::object(error)(e.what());
      instance.attr("code") = static_cast<int>(e.code());
      PyErr_SetObject(error.ptr(), instance.ptr());
    } catch (const std::bad_alloc&) {
      PyErr_SetString(PyExc_MemoryError, "not enough memory");
    }
  });
  m.attr("version") = BRAID_VERSION;
  py::class_<SceneHolder, std::shared_ptr<SceneHolder>>(m, "Scene")
      .def(py::init([](const std::string& file, const Words& words) {
        const py::gil_scoped_release released;
        return std::make_shared<SceneHolder>(file, words);
      }))
      .def_property_readonly("record", [](const SceneHolder& s) {
        return sceneRecord(*s.opened.scene).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
      });
  bindMade(m);
  bindRun(m);
  m.def("combine", [](const py::list& given, const py::dict& features, const Words& words, int threads) {
    return std::const_pointer_cast<Made>(combineArrays(given, features, words, threads));
  });
  m.def("compare", compareImages);
  m.def("integrators", [] { return namesOf(makeIntegrators()); });
  m.def("methods", [] { return namesOf(makeMethods()); });
  m.def("metrics", [] {
    std::vector<std::string> names;
    for (const Metric& metric : metricRegistry()) names.push_back(metric.name);
    return names;
  });
}

}  // namespace braid::python
