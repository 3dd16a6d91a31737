// SPDX-License-Identifier: Apache-2.0
// Fresnel reflectances. Every cosine is the absolute value of the angle at the interface.
#pragma once

#include "renderer/core/vec.h"

namespace braid {

inline float pow5(float x) {
  const float x2 = x * x;
  return x2 * x2 * x;
}

// Schlick 1994, "An Inexpensive BRDF Model": the weight of F90 against F0.
inline float schlickWeight(float cosine) { return pow5(cosine < 1 ? 1 - cosine : 0.0f); }

// Reflectance at normal incidence between two refractive indices. KHR_materials_ior: index 0 means full reflection,
// which the formula gives by itself.
inline float fresnelF0(float etaA, float etaB) {
  const float sum = etaA + etaB;
  return sum > 0 ? sqr((etaA - etaB) / sum) : 1.0f;
}

// Cosine on the transmitted side by Snell's law; negative: total internal reflection. eta = transmitted / incident
// index.
float refractedCosine(float cosine, float eta);

// Exact unpolarised reflectance of a dielectric (Walter et al. 2007 eq. 22). 1 on total internal reflection.
float fresnelDielectric(float cosine, float eta);

// Parameters of a thin film in the sense of KHR_materials_iridescence.
struct ThinFilm {
  float outsideIor;
  float filmIor;
  float thickness;  // nanometres
};

// Reflectance of film and base together at the outer cosine, each channel in [0, 1]
// (Belcour & Barla 2017, in the approximation of KHR_materials_iridescence).
Spectrum fresnelThinFilm(const ThinFilm& film, const Spectrum& baseF0, float cosine);

}  // namespace braid
