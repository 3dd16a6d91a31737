// SPDX-License-Identifier: Apache-2.0
// How the bidirectional kernel joins its subpaths: with the camera, with lights, with each other, and by merging.
#include <algorithm>

#include "integrators/bidirectional/bidirectional.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

// Connections that promise less than this share of what the path's connections have promised so far are decided by
// Russian roulette: their shadow rays would cost more than they tell (Veach 1997, section 10.3.3).
constexpr float kVisibilityThreshold = 0.1f;

double square(float x) { return sqr(static_cast<double>(x)); }

float hashToUnit(uint64_t key, uint32_t a, uint32_t b) {
  const uint32_t h = mix32(mix32(static_cast<uint32_t>(key >> 32) ^ (a * 0x9e3779b9u)) ^
                           mix32(static_cast<uint32_t>(key) + b * 0x85ebca6bu));
  return static_cast<float>(h >> 8) * 0x1p-24f;
}

}  // namespace

void BidirectionalKernel::connectToCamera(const SubpathVertex& vertex) {
  const CameraAt cameraNow(plan_.camera, vertex.hit.time);
  const Camera& camera = *cameraNow;
  const Vec3& position = vertex.hit.position;
  const auto segments = static_cast<uint32_t>(vertex.segments);
  // A point of the lens of its own; its density is that of camera rays, so that it leaves values and weights.
  const Vec3 lens = camera.lensRadius() > 0
                        ? camera.lensPoint({hashToUnit(vertex.key, segments, 13), hashToUnit(vertex.key, segments, 14)})
                        : camera.position();
  const std::optional<Vec2> projected = camera.projectFrom(lens, position);
  if (!projected) return;
  Vec2 raster = *projected;
  if (plan_.settings.filter != PixelFilter::Box) {
    raster += Vec2(sampleFilter(plan_.settings.filter, hashToUnit(vertex.key, segments, 11)),
                   sampleFilter(plan_.settings.filter, hashToUnit(vertex.key, segments, 12)));
  }
  const PixelWindow& w = plan_.window;
  // TRAP: compared as floats; a point near the camera's plane projects beyond the range of integers.
  if (!(raster.x >= static_cast<float>(w.x0) && raster.x < static_cast<float>(w.x1) &&
        raster.y >= static_cast<float>(w.y0) && raster.y < static_cast<float>(w.y1)))
    return;
  const Camera::CameraRay ray = camera.rayFrom(lens, *projected);
  const float distance =
      camera.orthographic() ? glm::dot(position - ray.origin, ray.direction) : glm::length(position - ray.origin);
  if (!(distance > 0)) return;
  const Vec3 wi = camera.orthographic() ? -ray.direction : (ray.origin - position) / distance;
  const VertexValue v = evaluateVertex(context_, vertex, Transport::Power, wi);
  if (isBlack(v.f)) return;
  const double spread = camera.orthographic() ? 1.0 : square(distance);
  const double pixelPdf = camera.pixelPdf(-wi);
  const double cameraPdfA = pixelPdf * static_cast<double>(v.cosGeometric) / spread;
  const double wLight =  // (46)
      sqr(cameraPdfA / lights_.count) * (mergeWeight_ + vertex.mis.vcm + vertex.mis.vc * square(v.pdfRevW));
  const double factor = pixelPdf / (spread * lights_.count * (1 + wLight));
  const Spectrum value =
      vertex.throughput * v.f * static_cast<float>(factor) * mediaTransmittance(scene_, v.media, distance);
  if (isBlack(value)) return;
  // From the camera, so that culled back faces let it pass as they do camera rays.
  const Vec3 end = offsetOrigin(vertex.hit, wi);
  const uint32_t salt = lights_.sampler.salt(vertex.key, 0x10000u + static_cast<uint32_t>(vertex.segments));
  queue_.add(connectionRay(ray.origin, end, salt | kCameraRay, vertex.hit.time), mediumIndex(scene_, v.media),
             {value, vertex.segments + 1, 1, -1, static_cast<int>(raster.x), static_cast<int>(raster.y)});
}

void BidirectionalKernel::sampleLight(int index, const SubpathVertex& vertex, bool forFeatures) {
  const Hit& hit = vertex.hit;
  const SampleBlock block = eyeSampler_.block(vertex.key, vertex.block);
  LightSample light;
  if (!context_.lights.sample(vertex.receiver(), block.u[slot::kLightSelect],
                              {block.u[slot::kLightU], block.u[slot::kLightV]}, light))
    return;
  const VertexValue v = evaluateVertex(context_, vertex, Transport::Radiance, light.wi);
  if (isBlack(v.f)) return;
  float cosLight = 1, directPdf = light.pdfW;
  EmissiveTriangle moved;
  if (light.light < context_.lights.firstPositional())
    cosLight = std::abs(glm::dot(light.wi, scene_.emitterAt(light.light, hit.time, moved).normal));
  else if (light.light < context_.lights.firstDirectional())
    directPdf *= sqr(light.distance);
  // A surface that glows and transmits may pick a light in its own plane.
  if (!(cosLight > 0)) return;
  const double wLight = light.delta ? 0.0 : square(v.pdfW / directPdf);  // (44)
  const float emit = lights_.emission.pdfEmit(light.light, -light.wi, cosLight, hit.time);
  const double wCamera =  // (45)
      sqr(static_cast<double>(emit) * static_cast<double>(v.cosGeometric) /
          (static_cast<double>(directPdf) * static_cast<double>(cosLight))) *
      (mergeWeight_ + vertex.mis.vcm + vertex.mis.vc * square(v.pdfRevW));
  const auto weight = static_cast<float>(1 / (1 + wLight + wCamera));
  const Spectrum value = vertex.throughput * v.f * light.radiance * (weight / light.pdfW) *
                         mediaTransmittance(scene_, v.media, light.distance);
  if (isBlack(value)) return;
  const uint32_t salt = eyeSampler_.salt(vertex.key, 0x10000u + static_cast<uint32_t>(vertex.segments)) & ~kCameraRay;
  queue_.add(shadowRay(hit, light.wi, light.distance, salt), mediumIndex(scene_, v.media),
             {value, 1, vertex.segments + 1, index, 0, 0, forFeatures});
}

void BidirectionalKernel::connect(int index, const SubpathVertex& eye) {
  const std::vector<SubpathVertex>& stored = stored_[static_cast<size_t>(index)];
  candidate_.clear();
  float& total = candidates_[static_cast<size_t>(index)];
  for (size_t k = 0; k < stored.size(); ++k) {
    const SubpathVertex& light = stored[k];
    if (eye.segments + light.segments + 1 > plan_.settings.maxDepth) break;
    const Vec3 d = light.hit.position - eye.hit.position;
    const float distance2 = glm::dot(d, d);
    if (!(distance2 > 0)) continue;
    const float distance = std::sqrt(distance2);
    const Vec3 wi = d / distance;
    const VertexValue e = evaluateVertex(context_, eye, Transport::Radiance, wi);
    if (isBlack(e.f)) continue;
    const VertexValue l = evaluateVertex(context_, light, Transport::Power, -wi);
    if (isBlack(l.f)) continue;
    const double inverse2 = 1 / static_cast<double>(distance2);
    const double eyePdfA = static_cast<double>(e.pdfW * l.cosGeometric) * inverse2;
    const double lightPdfA = static_cast<double>(l.pdfW * e.cosGeometric) * inverse2;
    const double wLight = sqr(eyePdfA) * (mergeWeight_ + light.mis.vcm + light.mis.vc * square(l.pdfRevW));  // (40)
    const double wCamera = sqr(lightPdfA) * (mergeWeight_ + eye.mis.vcm + eye.mis.vc * square(e.pdfRevW));   // (41)
    const Spectrum value = eye.throughput * e.f * (light.throughput * l.f) *
                           static_cast<float>(inverse2 / (1 + wLight + wCamera)) *
                           mediaTransmittance(scene_, e.media, distance);
    const float size = maxComponent(value);
    if (!(size > 0)) continue;
    total += size;
    candidate_.push_back({k, value, size, wi, mediumIndex(scene_, e.media)});
  }
  for (const Candidate& c : candidate_) {
    const SubpathVertex& light = stored[c.vertex];
    Spectrum value = c.value;
    const float keep = c.size / (kVisibilityThreshold * total);
    if (keep < 1) {
      if (hashToUnit(eye.key, static_cast<uint32_t>(eye.segments), static_cast<uint32_t>(c.vertex) + 100) >= keep)
        continue;
      value /= keep;
    }
    const Vec3 origin = offsetOrigin(eye.hit, c.direction);
    const Vec3 end = offsetOrigin(light.hit, -c.direction);
    const uint32_t salt = eyeSampler_.salt(
        eye.key, 0x20000u + static_cast<uint32_t>(eye.segments) * 64u + static_cast<uint32_t>(c.vertex));
    queue_.add(connectionRay(origin, end, salt & ~kCameraRay, eye.hit.time), c.index,
               {value, light.segments + 1, eye.segments + 1, index});
  }
}

void BidirectionalKernel::merge(int index, const SubpathVertex& eye) {
  Spectrum sum(0);
  merging_->grid->query(eye.hit.position, [&](const MergeVertex& light) {
    if (eye.segments + light.segments > plan_.settings.maxDepth) return;
    const VertexValue e = evaluateVertex(context_, eye, Transport::Radiance, light.wo);
    if (isBlack(e.f) || !(light.cosGeometric > 0)) return;
    const double wLight =  // (38)
        light.mis.vcm * merging_->connectWeight + light.mis.vm * square(e.pdfW);
    const double wCamera = eye.mis.vcm * merging_->connectWeight + eye.mis.vm * square(e.pdfRevW);  // (39)
    // Flux per area becomes radiance by the cosine at the surface that it crossed.
    sum += e.f * light.throughput * static_cast<float>(1 / (1 + wLight + wCamera)) / light.cosGeometric;
  });
  if (!isBlack(sum)) add(index, -1, eye.segments + 1, eye.throughput * sum * merging_->normalization);
}

}  // namespace braid
