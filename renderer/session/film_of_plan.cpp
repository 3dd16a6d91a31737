// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/film_of_plan.h"

#include <utility>

#include "renderer/session/integrator.h"

namespace braid {

PassPlanes passPlanes(const Plan& plan) {
  PassPlanes planes{
      .features = plan.kept.features, .coverage = plan.settings.transparent, .direct = plan.kept.directIndirect};
  for (const PlannedIntegrator& p : plan.integrators) {
    planes.splats |= p.integrator->splats();
    planes.bias |= p.integrator->estimatesBias();
  }
  return planes;
}

FilmState emptyFilm(const Plan& plan, int width, int height) {
  FilmState film;
  film.buckets = plan.buckets();
  for (const PlannedIntegrator& p : plan.integrators) {
    EstimateState e;
    e.name = p.integrator->name();
    e.unbiased = p.integrator->unbiased();
    e.correlation = p.integrator->correlation();
    e.lowDiscrepancy = p.integrator->lowDiscrepancy(plan.settings);
    e.passesPerRound = p.passesPerRound;
    const KeptSquares squares = plan.placesSamples ? KeptSquares::Halves : KeptSquares::Together;
    e.sums = Accumulator(width, height, plan.buckets(), p.integrator->estimatesBias(), squares);
    if (plan.kept.directIndirect && p.integrator->separatesDirectLight())
      e.parts.emplace(width, height, plan.buckets(), squares);
    film.estimates.push_back(std::move(e));
  }
  if (plan.kept.features) film.features.emplace(width, height);
  if (plan.settings.transparent) film.coverage.emplace(width, height);
  if (plan.placesSamples) film.placement.emplace(width, height);
  return film;
}

uint64_t filmBytesPerPixel(const Plan& plan) {
  FilmState film = emptyFilm(plan, 0, 0);
  RawSums sums = film.sharedSums();
  for (EstimateState& e : film.estimates) {
    const RawSums more = e.rawSums();
    sums.insert(sums.end(), more.begin(), more.end());
  }
  if (film.placement) film.placement->listMap(sums);
  uint64_t perPixel = 0, perTile = 0;
  for (const RawSum& s : sums) (s.tile == 1 ? perPixel : perTile) += sizeof(double);
  constexpr uint64_t kTilePixels = SamplePlacement::kTile * SamplePlacement::kTile;
  return perPixel + (perTile + kTilePixels - 1) / kTilePixels + passPlanes(plan).bytesPerPixel();
}

}  // namespace braid
