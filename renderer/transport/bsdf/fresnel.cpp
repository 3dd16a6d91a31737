// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/bsdf/fresnel.h"

#include <algorithm>
#include <cmath>

namespace braid {

float refractedCosine(float cosine, float eta) {
  // 1 - cos² as a product: exact for cosines near 1.
  const float sin2 = (1 - cosine) * (1 + cosine) / sqr(eta);
  return sin2 < 1 ? std::sqrt(1 - sin2) : -1.0f;
}

float fresnelDielectric(float cosine, float eta) {
  if (eta == 1) return 0;  // TRAP: at grazing incidence the formula would give 0/0
  const float cosT = refractedCosine(cosine, eta);
  if (cosT < 0) return 1;
  const float s = (cosine - eta * cosT) / (cosine + eta * cosT);
  const float p = (eta * cosine - cosT) / (eta * cosine + cosT);
  return 0.5f * (sqr(s) + sqr(p));
}

namespace {

// Response of the eye to a fringe of the given optical path difference and phase, as linear Rec. 709: Gaussian fits to
// the Fourier transforms of the CIE matching functions (Belcour & Barla 2017, section 4), normalised to 1 at D = 0.
// Each channel of XYZ has its own phase in the extension, that of the same-numbered RGB channel.
Spectrum fringeSensitivity(float pathDifference, const Vec3& shift) {
  constexpr float kScale = 1 / 1.0685e-7f;
  const float phase = 6.28318531e-9f * pathDifference;
  const float phase2 = phase * phase;
  const auto lobe = [&](float value, float position, float variance, float s) {
    return kScale * value * std::sqrt(6.28318531f * variance) * std::cos(position * phase + s) *
           std::exp(-variance * phase2);
  };
  const float x = lobe(5.4856e-13f, 1.6810e6f, 4.3278e9f, shift.x) + lobe(9.7470e-14f, 2.2399e6f, 4.5282e9f, shift.x);
  const float y = lobe(4.4201e-13f, 1.7953e6f, 9.3046e9f, shift.y);
  const float z = lobe(5.2481e-13f, 2.2084e6f, 6.6121e9f, shift.z);
  // TRAP: the extension prints this matrix by columns; transposed it still looks colourful.
  return Spectrum(3.2404542f * x - 1.5371385f * y - 0.4985314f * z,  //
                  -0.9692660f * x + 1.8760108f * y + 0.0415560f * z, 0.0556434f * x - 0.2040259f * y + 1.0572252f * z);
}

float smoothStep(float edge, float x) {
  const float t = glm::clamp(x / edge, 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

}  // namespace

Spectrum fresnelThinFilm(const ThinFilm& film, const Spectrum& baseF0, float cosine) {
  // A film of no thickness is no film: its index fades to that outside, and then the result is plain Schlick.
  const float filmIor = glm::mix(film.outsideIor, film.filmIor, smoothStep(0.03f, film.thickness));
  const float cos2 = refractedCosine(cosine, filmIor / film.outsideIor);
  if (cos2 < 0) return Spectrum(1);

  // TRAP: the extension takes Schlick here too, which reflects at grazing angles even between equal indices: a film
  // that is none would show. The exact reflectance vanishes with the step.
  const float r12 = fresnelDielectric(cosine, filmIor / film.outsideIor);
  const float t121 = 1 - r12;

  // TRAP: F0 = 1 would be an infinite index.
  const Spectrum root = glm::sqrt(glm::clamp(baseF0, Spectrum(0), Spectrum(0.9999f)));
  const Spectrum baseIor = film.outsideIor * (1.0f + root) / (1.0f - root);
  const Spectrum ratio = (baseIor - filmIor) / (baseIor + filmIor);
  const Spectrum r1 = ratio * ratio;
  const Spectrum r23 = r1 + (1.0f - r1) * schlickWeight(cos2);

  // Half a wave is lost at a step to a higher index; seen from inside the film the first interface steps the other way.
  const float phi21 = filmIor < film.outsideIor ? 0.0f : kPi;
  const Spectrum phi = phi21 + kPi * Spectrum(glm::lessThan(baseIor, Spectrum(filmIor)));
  // TRAP: older prints of the extension use the outer cosine here; the path lies inside the film.
  const float pathDifference = 2 * filmIor * film.thickness * cos2;

  const Spectrum r123 = glm::min(r12 * r23, Spectrum(0.9999f));
  const Spectrum amplitude = glm::sqrt(r123);
  const Spectrum rs = sqr(t121) * r23 / (1.0f - r123);
  Spectrum sum = r12 + rs;
  Spectrum c = rs - t121;
  for (int m = 1; m <= 2; ++m) {
    const float order = static_cast<float>(m);
    c *= amplitude;
    sum += c * 2.0f * fringeSensitivity(order * pathDifference, order * phi);
  }
  return glm::clamp(sum, Spectrum(0), Spectrum(1));
}

}  // namespace braid
