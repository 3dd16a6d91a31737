// SPDX-License-Identifier: Apache-2.0
// Environments of EXT_lights_image_based: cube maps, or the irradiance that they give, as latitude-longitude images.
#pragma once

#include <array>
#include <memory>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// The faces +X, -X, +Y, -Y, +Z, -Z of one level: squares of one size, at least a pixel wide.
using CubeFaces = std::array<std::shared_ptr<const Image>, 6>;

// How the faces lie. The first is what the specification says: each mirrored against OpenGL's, so that who stands
// within sees +Z right of +X. The others are what files have besides: each upside down against OpenGL's, or as OpenGL
// has them; the file's +X then lies in -X, for what is seen is no mirror image.
enum class CubeLayout { Mirrored, UpsideDown, OpenGl };

// The layout in which the faces meet at their edges. The specification's, unless another fits far better.
CubeLayout layoutOf(const CubeFaces& faces);

// Radiance as a latitude-longitude image (EnvironmentData), of RGB floats, four times as wide as a face and at most
// 4096 pixels, each the mean over its area. `rotation` turns the cube in the world. Pixels of 8 or 16 bits are sRGB;
// with alpha they are RGBD: the linear colour is divided by alpha, one of 0 counting as the least that is not.
std::shared_ptr<const Image> cubeEnvironment(const CubeFaces& faces, CubeLayout layout, const glm::dmat3& rotation);

// Coefficients of irradiance in the real spherical harmonics of bands 0 to 2, in the order L00 L1-1 L10 L11 L2-2 L2-1
// L20 L21 L22, all of positive sign (Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment
// Maps, 2001).
using IrradianceCoefficients = std::array<Spectrum, 9>;

// The radiance of these bands, which gives this irradiance where it is nowhere negative; it is cut off at 0.
std::shared_ptr<const Image> irradianceEnvironment(const IrradianceCoefficients& irradiance,
                                                   const glm::dmat3& rotation);

}  // namespace braid
