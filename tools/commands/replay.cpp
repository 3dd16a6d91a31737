// SPDX-License-Identifier: Apache-2.0
// `braid replay`: follows one camera path and prints what happens at every vertex. A pass is a pure function of the
// scene, the seed and its index, so any sample of any render can be looked at again.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "integrators/path_preparation.h"
#include "integrators/path_kernel.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"
#include "integrators/bidirectional/strategies.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/picture.h"
#include "tools/options/cli.h"
#include "tools/options/file_uses.h"
#include "tools/options/syntax/help.h"
#include "tools/options/open_scene.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/output_options.h"

namespace braid {

namespace {

struct ReplayOptions {
  SceneChoice scene;
  SampleChoice samples;
  uint64_t pass = 0;
  std::optional<std::pair<int, int>> pixel;
  std::string strategies;
};

std::string show(const glm::dvec3& v) { return fmt::format("({:.13g} {:.13g} {:.13g})", v.x, v.y, v.z); }
std::string show(const Vec3& v) { return fmt::format("({:.6g} {:.6g} {:.6g})", v.x, v.y, v.z); }

// A point in the coordinates of the file.
std::string place(const Vec3& p, const glm::dvec3& origin) {
  return origin == glm::dvec3(0) ? show(p) : show(glm::dvec3(p) + origin);
}

class PrintingObserver final : public PathObserver {
 public:
  explicit PrintingObserver(const Scene& scene) : scene_(scene) {}
  void onRay(const PathState& path) override {
    fmt::print("{}: ray from {} along {}, throughput {}\n", path.segments, place(path.origin, scene_.data().origin),
               show(path.direction), show(path.throughput));
  }
  void onMiss() override { fmt::print("   leaves the scene\n"); }
  void onHit(const Hit& hit) override {
    fmt::print("   hits mesh {} '{}', triangle {}, material '{}' at {}, {:.6g} m away, {} side, shading normal {}\n",
               hit.meshIndex, hit.mesh->name, hit.triangle, hit.material->name,
               place(hit.position, scene_.data().origin), hit.distance, hit.front ? "front" : "back",
               show(hit.frame.n));
  }
  void onScattering(const PathState& path) override {
    fmt::print("   is scattered within '{}', {:.6g} m away\n", path.walk.medium->name, path.walk.flight);
  }
  void onLight(const ShadowRay& ray, bool visible) override {
    fmt::print("   light sample along {}: {} {}\n", show(ray.ray.direction), visible ? "adds" : "hidden, would add",
               show(ray.contribution));
  }

 private:
  const Scene& scene_;
};

class PrintingStrategies final : public StrategyObserver {
 public:
  explicit PrintingStrategies(const glm::dvec3& origin) : origin_(origin) {}
  void onVertex(const SubpathVertex& v, Transport transport) override {
    fmt::print("{} vertex {}: mesh {} '{}', triangle {}, material '{}' at {}, throughput {}\n",
               transport == Transport::Power ? "light" : "eye", v.segments, v.hit.meshIndex, v.hit.mesh->name,
               v.hit.triangle, v.hit.material->name, place(v.hit.position, origin_), show(v.throughput));
  }
  void onContribution(int s, int t, int x, int y, const Spectrum& value) override {
    fmt::print("   s={} t={} adds {} to pixel {},{}\n", s, t, show(value), x, y);
  }

 private:
  glm::dvec3 origin_;
};

// One EXR with the image of every strategy as a layer "s<s>t<t>" and their sum as the headline.
void writeStrategies(const TransportContext& context, const Plan& plan, const std::string& path) {
  const uint64_t passes = std::max<uint64_t>(plan.settings.spp, 1);
  const std::vector<StrategyImage> images = renderStrategies(context, plan, passes);
  std::FILE* to = path == kStandardOutput ? stderr : stdout;
  Rgb<float> sum(plan.window.width(), plan.window.height());
  ExrOptions options;
  for (const StrategyImage& image : images) {
    options.layers.push_back({fmt::format("s{}t{}", image.s, image.t), &image.mean});
    double total = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < sum.size(); ++i) {
        sum[c][i] += image.mean[c][i];
        total += static_cast<double>(image.mean[c][i]);
      }
    fmt::print(to, "s={} t={}: mean {:.6g}\n", image.s, image.t, total / static_cast<double>(3 * sum.size()));
  }
  Estimates estimates;
  estimates.width = sum.width();
  estimates.height = sum.height();
  estimates.window = plan.window;
  estimates.fullWidth = plan.settings.width;
  estimates.fullHeight = plan.settings.height;
  writeExr(path, estimates, sum, nullptr, options);
  fmt::print(to, "Saved: {}\n", path);
}

void checkStrategies(const ReplayOptions& o) {
  FileUses uses;
  uses.scene(o.scene.file, o.scene.environment);
  uses.output("--strategies", o.strategies);
  uses.check();
  if (imageFormat(o.strategies) != ImageFormat::Exr)
    throw Error(ExitCode::Usage,
                fmt::format("--strategies {}: only EXR has layers: name a file that ends in .exr", o.strategies));
  prepareOutput(o.strategies);
}

int runReplay(const ReplayOptions& o) {
  const Settings settings = makeSettings(o.scene, o.samples);
  const bool bidirectional = settings.integrators.front() == "bdpt";
  if (o.strategies.empty() == !o.pixel || (!o.strategies.empty() && !bidirectional))
    throw Error(ExitCode::Usage, "give --pixel X,Y, or --integrator bdpt --strategies FILE");
  const auto [x, y] = o.pixel.value_or(std::pair(0, 0));
  if (x >= settings.width || y >= settings.height)
    throw Error(ExitCode::Usage, fmt::format("--pixel '{},{}': expected X,Y inside the {}x{} frame", x, y,
                                             settings.width, settings.height));
  if (!o.strategies.empty()) checkStrategies(o);
  const OpenedScene opened = openScene(o.scene);
  const Scene& scene = *opened.scene;
  const auto integrators = makeIntegrators();
  const Plan plan = makePlan(scene, opened.camera, settings, pointersTo(integrators));
  const TransportContext context(scene, settings.lightStrategy);
  const Integrator& integrator = *plan.integrators.front().integrator;
  if (!o.strategies.empty()) {
    writeStrategies(context, plan, o.strategies);
    return 0;
  }
  if (bidirectional) {
    fmt::print("bdpt pass {} pixel {},{} of {}x{}\n", o.pass, x, y, settings.width, settings.height);
    PrintingStrategies printer(scene.data().origin);
    replayBidirectionalPixel({context, plan, o.pass}, x, y, printer);
    return 0;
  }
  const auto sampler = integrator.pixelSampler(plan, o.pass);
  if (!sampler)
    throw Error(ExitCode::Usage, fmt::format("integrator '{}' has no camera paths to replay", integrator.name()));

  std::optional<PathPoints> points;
  PrintingObserver observer(scene);
  PathKernel kernel(context, plan, *sampler, nullptr, integrator.roulette());
  kernel.observe(&observer);
  const auto preparation = integrator.prepare(context, plan);
  if (const auto* paths = dynamic_cast<const PathPreparation*>(preparation.get())) {
    points.emplace(integrator, plan, o.pass, paths->aids().splits);
    kernel.use(points->with(paths->aids()));
  }
  fmt::print("{} pass {} pixel {},{} of {}x{}\n", integrator.name(), o.pass, x, y, settings.width, settings.height);
  kernel.start(x, y, integrator.pixelKey(*sampler, plan, x, y));
  kernel.run();
  fmt::print("radiance {}\n", show(kernel.sample(0).radiance));
  return 0;
}

}  // namespace

void addReplay(CLI::App& app, Action& action) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command = app.add_subcommand("replay", "Follow one path of a render, vertex by vertex");
  command->footer(
      "Examples:\n"
      "  braid replay scene.glb --pass 17 --pixel 200,131\n"
      "  braid replay scene.glb --integrator bdpt --spp 64 --strategies ways.exr");
  addSceneOptions(*command, options->scene);
  addSampleOptions(*command, options->samples);
  command->add_option("--pass", options->pass, "Index of the pass")
      ->capture_default_str()
      ->check(wholeNumber(0, kMaxPass));
  addParsed(*command, "--pixel", options->pixel, parsePixel, "Pixel of the full frame")->type_name("X,Y");
  command
      ->add_option("--strategies", options->strategies,
                   "EXR with the image of every way (s, t) of bdpt to find light, over --spp passes")
      ->type_name("FILE");
  showFirst(*command, "Path", {"--pass", "--pixel", "--strategies"});
  command->callback([options, &action] { action = [options] { return runReplay(*options); }; });
}

}  // namespace braid
