// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/plan.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/scene/file_parts.h"
#include "renderer/session/film_of_plan.h"
#include "renderer/session/integrator.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/session/placement_map.h"
#include "renderer/transport/light_kinds.h"

namespace braid {

namespace {

// Solids that scatter light behind a smooth surface: a delta chain leads in, nothing connects within, another leads
// out.
void planSmoothSolids(const Scene& scene, Plan& plan) {
  const SceneTraits& t = scene.traits();
  if (!t.has(kTraitScattering) || !t.has(kTraitPointLights | kTraitDirectionalLights)) return;
  for (const Material& m : scene.materials())
    if (m.scatters() && m.diffuseTransmission == 0 && sqr(m.roughness) < kSmoothAlpha)
      return plan.lines.push_back({false, "lights without size in '" + m.name + "'",
                                   "its smooth surface lets none of them be found within: give it roughness, or "
                                   "KHR_materials_diffuse_transmission"});
}

// The scene's parts that cost something, kept or left out.
void planSceneParts(const Scene& scene, const Settings& settings, Plan& plan) {
  const SceneTraits& t = scene.traits();
  const auto line = [&](bool has, const char* subject, const char* kept, const char* left) {
    plan.lines.push_back({has || settings.full, subject, has ? kept : settings.full ? "kept by --full" : left});
  };
  const auto part = [&](uint32_t flag, const char* subject, const char* kept, const char* left) {
    line(t.has(flag), subject, kept, left);
  };
  part(kTraitAlphaMask | kTraitAlphaBlend | kTraitCulledFaces, "any-hit filter",
       "alpha or open single-sided surfaces let rays pass", "no alpha mode and no open single-sided surface");
  part(kTraitTextures, "texture lookups", "materials read textures", "no material reads a texture");
  part(kTraitTextureTransforms, "texture transforms", "KHR_texture_transform is used", "no transformed texture");
  part(kTraitNormalMaps, "normal maps and tangents", "normal-mapped materials",
       "no normal map and no anisotropy reads them");
  part(kTraitVertexColors, "vertex colours", "COLOR_0 multiplies base colours", "no mesh has vertex colours");
  for (const LobeEntry& e : kLobeTable)
    if (e.part) line(t.hasLobe(e.lobe), e.part, e.kept, e.left);
  part(kTraitPanes, "shadow rays through panes", "thin smooth transmissive surfaces let light straight through",
       "no thin smooth transmissive surface");
  part(kTraitVolume, "media tracking", "closed solids refract or attenuate", "no solid with a volume");
  part(kTraitScattering, "volume scattering", "paths walk through closed solids; nothing connects to their events",
       "no solid scatters light within");
  part(kTraitDispersion, "dispersion",
       "from the first dispersive surface on, paths go on once a colour (pt, crn) or in one",
       "no solid disperses light");
  part(kTraitInstances, "instance transforms",
       scene.moves() ? "meshes placed several times, or moved" : "meshes placed several times",
       "every mesh is placed once and lies in world space");
  part(kTraitEnvironmentImage, "environment sampling", "an environment image, sampled by luminance",
       t.has(kTraitEnvironment) ? "the environment is constant" : "no environment");
  const auto positional =
      static_cast<uint64_t>(std::count_if(scene.lights().begin(), scene.lights().end(),
                                          [](const PunctualLight& l) { return l.kind != PunctualKind::Directional; }));
  const uint64_t finite = t.emissiveTriangles + positional;
  const bool hierarchy =
      settings.lightStrategy == LightStrategy::Hierarchy ||
      (settings.lightStrategy == LightStrategy::Automatic && hierarchyPays(t.emissiveTriangles, positional));
  plan.lines.push_back({hierarchy, "light hierarchy",
                        hierarchy ? fmt::format("{} finite lights", finite)
                        : settings.lightStrategy == LightStrategy::Power
                            ? "lights are chosen by power on request"
                            : fmt::format("{} finite lights: chosen by power", finite)});
}

PlanLine planLightKinds(const Scene& scene, Plan& plan) {
  if (lightKinds(scene) < 2) return {false, "kinds of lights", "one at most"};
  const TransportContext context(scene, plan.settings.lightStrategy);
  const LightKinds kinds = measureLightKinds(context, plan.camera, plan.settings.width, plan.settings.height);
  plan.lightKinds = kinds;
  return {true, "kinds of lights",
          fmt::format("{:.2g} of the light samples for finite ones, {:.2g} for directional ones, {:.2g} for the "
                      "environment, by what they bring to 4096 camera paths",
                      kinds[0], kinds[1], kinds[2])};
}

// What the loader had to do, or was spared.
void planFileParts(const SceneTraits& traits, Plan& plan) {
  for (size_t i = 0; i < kFileParts; ++i) {
    const FilePartEntry& e = kFilePartTable[i];
    const uint64_t count = traits.parts[i];
    plan.lines.push_back({count > 0, e.part, count > 0 ? fmt::format("{}: {}", e.kept, count) : e.left});
  }
}

void requireShadowAlpha(const Scene& scene, const Settings& settings) {
  if (scene.data().ground && settings.transparent && isBlack(*scene.data().ground))
    throw Error(
        ExitCode::Usage,
        "--ground --transparent: only lamps light the ground, which cannot tell shadow from distance: give --env");
}

// Why all pixels get as many samples; empty: they need not.
std::string evenBecause(const Plan& plan) {
  const Settings& s = plan.settings;
  if (s.placement.empty()) return "all pixels get as many samples (--place-samples)";
  if (s.firstRound > 0) return "a share of a render does not know the sums of the others (--passes)";
  if (plan.integrators.size() != 1) return "several integrators share the samples: all pixels get as many";
  const Integrator& only = *plan.integrators.front().integrator;
  if (!only.placesSamples()) return fmt::format("{} renders pixels together: all get as many samples", only.name());
  if (s.transparent) return "alpha is of as many samples in all pixels (--transparent)";
  return {};
}

void planPlacement(Plan& plan) {
  const std::string even = evenBecause(plan);
  plan.placesSamples = even.empty();
  plan.lines.push_back(
      {plan.placesSamples, "placement of samples",
       plan.placesSamples
           ? fmt::format("from sample {} on where the image errs most for its cost, --spp on average", kPilotRounds)
           : even});
}

// What happens while the shutter is open, where one is asked for.
void planMotion(const Scene& scene, Plan& plan) {
  const SceneMotion& motion = scene.data().motion;
  if (!(motion.seconds > 0)) return;
  if (!scene.moves()) {
    plan.lines.push_back(
        {false, "motion blur", fmt::format("nothing moves within {:.4g} s of the shutter's opening", motion.seconds)});
    return;
  }
  const size_t pieces = motion.times.size() - 1;
  plan.lines.push_back(
      {true, "motion blur",
       fmt::format("the shutter is open for {:.4g} s; {} straight piece{} of motion, off by at most {:.2g} % of a way",
                   motion.seconds, pieces, pieces == 1 ? "" : "s", 100 * motion.error)});
  for (const PlannedIntegrator& p : plan.integrators)
    if (p.integrator->passesAreInstants())
      plan.lines.push_back(
          {true, std::string(p.integrator->name()) + " instants",
           "all paths of a pass are at one instant, as they meet: 4 samples show 4 instants over each other"});
}

// What the view has that the file has not, and the lens.
void planView(const Scene& scene, Plan& plan) {
  const SceneData& data = scene.data();
  if (data.defaultLight)
    plan.lines.push_back({true, data.backdrop ? "studio" : "grey dome",
                          "made up, as the file's own light shows next to nothing (--default-light)"});
  if (data.ground) plan.lines.push_back({true, "ground", "under the scene, of the colour of the backdrop (--ground)"});
  if (data.defaultCamera) plan.lines.push_back({true, "camera", "made up, as the file has none (--look-at)"});
  if (const Camera& camera = plan.camera; camera.lensRadius() > 0)
    plan.lines.push_back(
        {true, "lens",
         fmt::format("{:.4g} m wide, sharp at {:.4g} m", 2 * camera.lensRadius(), camera.focusDistance())});
}

bool anySeparatesDirectLight(const Plan& plan) {
  return std::any_of(plan.integrators.begin(), plan.integrators.end(),
                     [](const auto& p) { return p.integrator->separatesDirectLight(); });
}

// What the film keeps, and what a pixel of it takes.
void planBuffers(Plan& plan) {
  const Settings& settings = plan.settings;
  const bool separable = anySeparatesDirectLight(plan);
  KeptBuffers& kept = plan.kept;
  kept = settings.keep;
  kept.quarters |= settings.full || plan.placesSamples;
  kept.features |= settings.full;
  kept.featureNoise = kept.features;
  kept.directIndirect = separable && (kept.directIndirect || settings.full);

  plan.filmBytesPerPixel = filmBytesPerPixel(plan);
}

std::string featureNames() {
  std::string names;
  for (const FeaturePlane& f : kFeaturePlanes) names += fmt::format("{}{}", names.empty() ? "" : ", ", f.name);
  return names;
}

void listBuffers(Plan& plan) {
  const KeptBuffers& kept = plan.kept;
  const bool separable = anySeparatesDirectLight(plan);
  const auto line = [&](bool isKept, const char* subject, const std::string& reason) {
    plan.lines.push_back({isKept, subject, reason});
  };
  line(kept.quarters, "quarter buckets",
       plan.placesSamples ? "for the placement of samples"
       : kept.quarters    ? "for outputs or combiners"
                          : "no output or combiner reads quarters: two half buffers");
  line(kept.features, "features",
       kept.features ? featureNames() + " for outputs or combiners" : "no output or combiner reads them");
  line(kept.directIndirect, "direct light by itself",
       kept.directIndirect ? "for outputs or combiners"
       : separable         ? "no output or combiner reads it"
                           : "no integrator tells it from the rest");
  line(kept.history, "history",
       kept.history
           ? fmt::format("variances after rounds 1, 2, 4, ...: {} bytes a pixel each", 12 * plan.integrators.size())
           : "no combiner looks at convergence");
  if (!kept.stops.empty())
    line(true, "stop of denoising",
         fmt::format("the image after {} passes: 36 bytes a pixel each", fmt::join(kept.stops, ", ")));
}

void planFilm(Plan& plan) {
  plan.lines.resize(plan.filmLine);
  planBuffers(plan);
  listBuffers(plan);
  plan.lines.push_back({true, "film",
                        fmt::format("{} bytes a pixel, {:.1f} MiB", plan.filmBytesPerPixel,
                                    static_cast<double>(plan.filmBytesPerPixel) * plan.window.width() *
                                        plan.window.height() / 1048576.0)});
  for (const PlannedIntegrator& p : plan.integrators) {
    const WorkingMemory memory = p.integrator->workingMemory(plan);
    if (memory.bytes == 0) continue;
    plan.lines.push_back(
        {true, std::string(p.integrator->name()) + " memory",
         fmt::format("at most {:.1f} MiB {}", static_cast<double>(memory.bytes) / 1048576.0, memory.use)});
  }
}

}  // namespace

Plan makePlan(const Scene& scene, const CameraData& camera, const Settings& settings,
              const std::vector<const Integrator*>& available) {
  Plan plan;
  plan.settings = settings;
  if (!plan.settings.background) plan.settings.background = scene.data().backdrop;
  plan.camera = Camera(camera, settings.width, settings.height);
  plan.window = settings.crop.value_or(PixelWindow{0, 0, settings.width, settings.height});
  const PixelWindow& w = plan.window;
  if (w.x0 < 0 || w.y0 < 0 || w.x1 > settings.width || w.y1 > settings.height || w.width() <= 0 || w.height() <= 0)
    throw Error(ExitCode::Usage, fmt::format("the crop {},{},{},{} is empty or outside the {}x{} frame", w.x0, w.y0,
                                             w.x1, w.y1, settings.width, settings.height));
  requireShadowAlpha(scene, settings);
  const PlanLine lightKinds = planLightKinds(scene, plan);
  planIntegrators(scene, camera, available, plan);
  for (const PlannedIntegrator& p : plan.integrators)
    for (PlanLine& line : p.integrator->planLines(plan)) plan.lines.push_back(std::move(line));
  planSceneParts(scene, settings, plan);
  plan.lines.push_back(lightKinds);
  planFileParts(scene.traits(), plan);
  planSmoothSolids(scene, plan);
  planMotion(scene, plan);
  planView(scene, plan);
  planPlacement(plan);
  plan.filmLine = plan.lines.size();
  planFilm(plan);
  return plan;
}

void keepAlso(const KeptBuffers& more, Plan& plan) {
  plan.settings.keep |= more;
  planFilm(plan);
}

std::string Plan::text() const {
  std::string text;
  for (const PlanLine& line : lines)
    text += fmt::format("{} {}: {}\n", line.kept ? '+' : '-', line.subject, line.reason);
  return text;
}

uint64_t Plan::hash() const {
  ContentHash h;
  h.add(text());
  h.add(fmt::format("{} {} {} {} {} {} {} {}", settings.width, settings.height, settings.maxDepth, settings.seed,
                    static_cast<int>(settings.sampler), toString(settings.filter), settings.clamp,
                    settings.transparent));
  h.add(fmt::format("{} {} {}", static_cast<int>(settings.guiding), settings.lightSamples, settings.pathSplits));
  h.add(fmt::format("{} {} {} {}", settings.photons, settings.photonRadius, settings.photonDirect,
                    settings.photonAiming));
  return h.value();
}

}  // namespace braid
