// SPDX-License-Identifier: Apache-2.0
// A picture within --time where one pass over all pixels takes longer: an image of fewer pixels is rendered, and each
// of them stands for several. Copies are no samples of their own, so such a picture has no statistics that combiners
// could read, and never becomes a state.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "renderer/session/session.h"

namespace braid {

// Of `coarse` pixels that lie as `full` ones do: the one below pixel x of those.
inline int coarsePixel(int x, int full, int coarse) {
  return static_cast<int>((2 * int64_t{x} + 1) * coarse / (2 * int64_t{full}));
}

// The same view with 1/divisor of the pixels each way, and without what only combiners read.
Plan coarsePlan(const Plan& plan, const CameraData& camera, int divisor);

// Means and features of the first estimate in a state of coarsePlan(), enlarged to `plan`'s window; nothing else.
Estimates enlargedEstimates(const FilmState& coarse, const Plan& plan);
// Of a transparent background.
std::optional<Plane<float>> enlargedAlpha(const FilmState& coarse, const Plan& plan);

class CoarseRender {
 public:
  static constexpr int kCoarsest = 8;

  // Renders two rounds of the coarsest image, or one where the time is up by then: a picture to fall back on, and the
  // measure of all finer ones. `timeLeft`: seconds until a picture has to be there. Scene and plan must outlive this.
  CoarseRender(const Scene& scene, const CameraData& camera, const Plan& plan, std::function<double()> timeLeft,
               const std::atomic<bool>* cancel = nullptr);

  // Whether a round over all pixels is expected to be done in time.
  bool fullRoundFits() const { return roundSeconds(1) <= timeLeft_(); }

  // Takes the place of the coarsest image by the finest one that is expected to be done in time. One that is not done
  // `grace` seconds later is given up.
  void refine(double grace);

  const RunReport& report() const { return report_; }
  const FilmState& state() const { return session_->state(); }

 private:
  // What the first round takes, `divisor` times coarser than the image.
  double roundSeconds(int divisor) const;
  std::unique_ptr<Session> makeSession(Plan plan) const;

  const Scene& scene_;
  const CameraData camera_;
  const Plan& plan_;
  const std::function<double()> timeLeft_;
  const std::atomic<bool>* cancel_;
  std::unique_ptr<Session> session_;
  RunReport report_;
  double preparing_ = 0, round_ = 0;  // seconds of the coarsest image: once, and for each round
  double headlineShare_ = 1;          // of the rounds' seconds, that of the only integrator that refine() runs
};

}  // namespace braid
