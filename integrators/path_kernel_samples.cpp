// SPDX-License-Identifier: Apache-2.0
// What a path samples: lights at its vertices, and directions where it is split.
#include "integrators/path_kernel.h"
#include "renderer/transport/mis.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

constexpr uint64_t kBranchKey = 0x6272616e6368;

}  // namespace

LightChoice lightChoice(const SampleBlock& block, int k, int count) {
  constexpr float kStepU = 0.7548777f, kStepV = 0.5698403f;  // of the plastic number (Roberts 2018, R2)
  const auto t = static_cast<float>(k), n = static_cast<float>(count);
  if (k == 0) return {block.u[slot::kLightSelect], {block.u[slot::kLightU], block.u[slot::kLightV]}, n};
  const auto shifted = [](float u, float by) { return u + by - std::floor(u + by); };
  return {shifted(block.u[slot::kLightSelect], t / n),
          {shifted(block.u[slot::kLightU], t * kStepU), shifted(block.u[slot::kLightV], t * kStepV)},
          n};
}

// For the vertices of all paths, those that will not ask for it included.
void PathKernel::pickLights() {
  picked_.clear();
  for (size_t ray = 0; ray < static_cast<size_t>(activeCount_); ++ray) {
    if (!(query_[ray].t < kInfinity)) continue;
    const Receiver receiver = receiverAt(hit_[ray], context_.summaryOf(hit_[ray]).transmits());
    const int count = lightSamplesOf(path_[static_cast<size_t>(active_[ray])]);
    firstPicked_[ray] = picked_.size();
    for (int k = 0; k < count; ++k)
      picked_.push_back(LightSampler::queryOf(receiver, lightChoice(block_[ray], k, count).select));
  }
  context_.lights.pick(picked_);
}

bool PathKernel::sampleLight(const PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided,
                             const LightChoice& choice, ShadowRay& shadow) const {
  LightSample light;
  if (!context_.lights.sample(receiverAt(hit, twoSided), choice.select, choice.place, light)) return false;
  light.pdfW *= choice.count;
  return connectLight(path, hit, bsdf, twoSided, light, shadow);
}

bool PathKernel::connectLight(const PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided,
                              const LightSample& light, ShadowRay& shadow) const {
  const Vec3 wi = hit.frame.toLocal(light.wi);
  const bool reflects = glm::dot(light.wi, hit.ng) > 0;
  // Light on the other side of the geometric surface than of the shading one would leak through it.
  if (reflects != (wi.z > 0) || (!reflects && !twoSided)) return false;
  const BsdfValue value = bsdf.evaluate(wi);
  if (isBlack(value.f)) return false;

  const float weight =
      light.delta ? 1.0f : powerHeuristic(light.pdfW, value.pdfW * static_cast<float>(path.directions));
  shadow.contribution = path.throughput * value.f * light.radiance * (weight / light.pdfW);
  setShadowRay(hit, light.wi, light.distance, mix32(path.salt ^ 0x51ed270bu) & ~kCameraRay, shadow.ray);
  const bool volume = context_.summaryOf(hit).volume;
  shadow.index = 1;
  if (!path.media.empty() || volume) {
    MediaStack media = path.media;
    if (!reflects && volume) media.cross(hit.mesh->material, hit.front);
    shadow.contribution *= mediaTransmittance(scene_, media, light.distance);
    shadow.index = mediumIndex(scene_, media);
  }
  return true;
}

void PathKernel::sampleLights(int p, size_t ray, const GuidedBsdf& bsdf, bool forFeatures) {
  PathState& path = path_[static_cast<size_t>(p)];
  const Hit& hit = hit_[ray];
  const bool twoSided = context_.summaryOf(hit).transmits(), isPicked = context_.lights.usesHierarchy();
  const Receiver receiver = receiverAt(hit, twoSided);
  const int count = lightSamplesOf(path);
  path.lastLightSamples = static_cast<float>(count);
  for (int k = 0; k < count; ++k) {
    if (shadowCount_ == kBatch) {
      traceShadows();
      shadowCount_ = 0;
    }
    const LightChoice choice = lightChoice(block_[ray], k, count);
    LightSample light;
    const LightSampler& lights = context_.lights;
    if (!(isPicked ? lights.sample(receiver, picked_[firstPicked_[ray] + static_cast<size_t>(k)], choice.place, light)
                   : lights.sample(receiver, choice.select, choice.place, light)))
      continue;
    light.pdfW *= choice.count;
    ShadowRay& shadow = shadow_[static_cast<size_t>(shadowCount_)];
    if (!connectLight(path, hit, bsdf, twoSided, light, shadow)) continue;
    shadow.forFeatures = forFeatures && k == 0;
    shadow.direct = path.bounces == 0;
    shadowRays_.set(shadowCount_, shadow.ray, shadow.index);
    shadowPath_[static_cast<size_t>(shadowCount_++)] = path.sample;
  }
}

void PathKernel::use(const PathAids& aids) {
  aids_ = aids;
  const auto branches = static_cast<size_t>(kBatch * aids.splits);
  if (aids.splits > 1 && sample_.size() < kBatch + branches) {
    path_.resize(branches * static_cast<size_t>(coloursOf(scene_)));
    sample_.resize(kBatch + branches);
  }
}

// Every branch carries its share of the path. Branch k takes point n i + k of a sequence where the path took point i,
// so that the directions of all passes together are spread as those of n times as many passes would be. Those that go
// on wait for room in the batch; true when the last of them, which takes the path's place, goes on.
bool PathKernel::split(int p, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided) {
  PathState& path = path_[static_cast<size_t>(p)];
  const auto first = static_cast<size_t>(kBatch + path.sample * aids_.splits);
  const bool isFirstColour = !isSplit_[static_cast<size_t>(path.sample)];
  isSplit_[static_cast<size_t>(path.sample)] = true;
  const float share = 1 / static_cast<float>(aids_.splits);
  path.throughput *= share;
  path.rouletteScale *= share;
  path.isBranch = true;
  const PathState whole = path;
  for (int k = 0; k < aids_.splits; ++k) {
    const bool last = k == aids_.splits - 1;
    const int place = last ? p : free_.back();
    PathState& branch = path_[static_cast<size_t>(place)];
    branch = whole;
    branch.sample = static_cast<int>(first) + k;
    if (isFirstColour) std::construct_at(&sample_[first + static_cast<size_t>(k)]);
    branch.key = hashCombine(whole.key, kBranchKey + static_cast<uint64_t>(k));
    if (aids_.branches.empty()) {
      branch.pointsKey = branch.key;
    } else {
      branch.points = &aids_.branches[static_cast<size_t>(k)];
      branch.pointsKey = hashCombine(whole.pointsKey, kBranchKey);
    }
    const bool goesOn = scatter(branch, hit, bsdf, twoSided, branch.points->block(branch.pointsKey, branch.block()));
    if (last) return goesOn;
    if (!goesOn) continue;
    free_.pop_back();
    waiting_.push_back(place);
  }
  return false;
}

// The path goes on once in each colour, all with the same points. They add to one sample, each to a channel of its own,
// and the one that is drawn finds the features. Those that go on wait for room in the batch; true when the last of
// them, which takes the path's place, goes on.
bool PathKernel::shadeColours(int p, size_t ray) {
  const PathState whole = path_[static_cast<size_t>(p)];
  for (uint8_t colour = 0; colour < 3; ++colour) {
    const int place = colour == 2 ? p : free_.back();
    PathState& path = path_[static_cast<size_t>(place)];
    path = whole;
    path.featuresDone = whole.featuresDone || colour != whole.channel.index;
    followOne(colour, 1, path.channel, path.throughput);
    if (colour < 2) free_.pop_back();
    const bool goesOn = shadeSurface(place, ray);
    if (colour == 2) return goesOn;
    (goesOn ? waiting_ : free_).push_back(place);
  }
  return false;
}

void PathKernel::addBranches() {
  if (aids_.splits == 1) return;
  for (int i = 0; i < count_; ++i) {
    const auto path = static_cast<size_t>(i);
    if (!isSplit_[path]) continue;
    for (int k = 0; k < aids_.splits; ++k) {
      const PathSample& branch = sample_[static_cast<size_t>(kBatch + i * aids_.splits + k)];
      sample_[path].radiance += branch.radiance;
      sample_[path].direct += branch.direct;
    }
  }
}

}  // namespace braid
