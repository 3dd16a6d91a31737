// SPDX-License-Identifier: Apache-2.0
// From radiance to what a display of 8 bits shows: exposure, a tone curve, and the display's encoding.
#pragma once

#include <optional>

#include "renderer/core/plane.h"

namespace braid {

enum class ToneCurve {
  Neutral,  // Khronos PBR Neutral: colours of materials stay as they are, highlights roll off to white
  Agx,      // AgX Base (Sobotka 2022)
  Aces,     // ACES by the fit of Hill (2016)
  None      // cut off at 1
};

// "neutral", "agx", "aces", "none".
const char* nameOf(ToneCurve curve);

// What a user asks for.
struct ToneChoice {
  ToneCurve curve = ToneCurve::Neutral;
  std::optional<double> exposure;  // stops; none: autoExposure()
};

// How one image is shown.
struct Tone {
  ToneCurve curve = ToneCurve::None;
  float exposureStops = 0;
};

// Encoded for an sRGB display, each channel in [0,1], of linear radiance that exposure has been applied to. What is
// negative or NaN counts as 0.
Vec3 toDisplay(ToneCurve curve, const Vec3& linear);

// Stops, to a hundredth, that bring the log-average of the luminances between their 5th and 95th percentile to 0.18, or
// up to four times that where most lie near the bright end, as things before a bright backdrop; less where more than a
// tenth of the image would exceed 0.8. What is black, not finite or (with `alpha`) mostly background does not count; 0
// where nothing does.
float autoExposure(const Rgb<float>& image, const Plane<float>* alpha = nullptr);

// The choice made for this image.
Tone toneFor(const ToneChoice& choice, const Rgb<float>& image, const Plane<float>* alpha = nullptr);

}  // namespace braid
