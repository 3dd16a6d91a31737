// SPDX-License-Identifier: Apache-2.0
#include "integrators/bidirectional/strategies.h"

#include <map>
#include <memory>
#include <mutex>

#include "integrators/light_preparation.h"

namespace braid {

namespace {

// Splats every contribution into the image of its strategy: fixed-point sums do not depend on the order of threads.
class StrategyFilms final : public StrategyObserver {
 public:
  StrategyFilms(const PixelWindow& window, int fractionBits) : window_(window), fractionBits_(fractionBits) {}

  void onContribution(int s, int t, int x, int y, const Spectrum& value) override {
    film(s, t).target.splat(x - window_.x0, y - window_.y0, value);
  }
  void commit(uint64_t pass) {
    for (auto& [key, film] : films_) {
      film->sum.commit(pass, film->target);
      film->target.clear();
    }
  }
  std::vector<StrategyImage> images(uint64_t passes) const {
    std::vector<StrategyImage> images;
    for (const auto& [key, film] : films_) {
      Rgb<float> mean = film->sum.mean();
      const float share = static_cast<float>(film->sum.passes()) / static_cast<float>(passes);
      for (size_t c = 0; c < 3; ++c)
        for (float& v : mean[c].data) v *= share;
      images.push_back({key.first, key.second, std::move(mean)});
    }
    return images;
  }

 private:
  struct Film {
    Film(int width, int height) : target(width, height, {.splats = true}), sum(width, height, 2) {}
    PassTarget target;
    Accumulator sum;
  };
  Film& film(int s, int t) {
    const std::lock_guard lock(mutex_);
    std::unique_ptr<Film>& film = films_[{s, t}];
    if (!film) {
      film = std::make_unique<Film>(window_.width(), window_.height());
      film->target.setSplatFractionBits(fractionBits_);
    }
    return *film;
  }

  const PixelWindow window_;
  const int fractionBits_;
  std::mutex mutex_;
  std::map<std::pair<int, int>, std::unique_ptr<Film>> films_;
};

}  // namespace

std::vector<StrategyImage> renderStrategies(const TransportContext& context, const Plan& plan, uint64_t passes) {
  const LightPreparation preparation(context);
  StrategyFilms films(plan.window, preparation.splatFractionBits);
  PassTarget target(plan.window.width(), plan.window.height(),
                    {.splats = true, .features = plan.kept.features, .coverage = plan.settings.transparent});
  for (uint64_t pass = 0; pass < passes; ++pass) {
    target.clear();
    PassRequest request{context, plan, pass};
    request.preparation = &preparation;
    renderBidirectionalPass(request, target, &films);
    films.commit(pass);
  }
  return films.images(passes);
}

}  // namespace braid
