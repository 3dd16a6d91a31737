// SPDX-License-Identifier: Apache-2.0
// Textures: wrapping, filtering and transfer function.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "renderer/scene/data/textures/texture.h"

namespace braid::test_texture {

namespace {

std::shared_ptr<Image> byteImage(int width, int height, int channels, std::vector<uint8_t> bytes) {
  auto image = std::make_shared<Image>();
  image->width = width;
  image->height = height;
  image->channels = channels;
  image->bytes = std::move(bytes);
  return image;
}

// A row of grey values.
Texture row(std::vector<uint8_t> values, Wrap wrap, Filter filter = Filter::Linear) {
  const auto width = static_cast<int>(values.size());
  return Texture(byteImage(width, 1, 1, std::move(values)), false, wrap, wrap, filter);
}

float grey(const Texture& texture, float u) { return texture.sample(Vec2(u, 0.5f)).x * 255; }

float fromSrgb(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

}  // namespace

TEST_CASE("texture: row 0 is the top of the image and uv (0,0) its corner") {
  const Texture t(byteImage(2, 2, 1, {10, 20, 30, 40}), false, Wrap::Clamp, Wrap::Clamp, Filter::Nearest);
  CHECK(t.sample({0.25f, 0.25f}).x * 255 == doctest::Approx(10));
  CHECK(t.sample({0.75f, 0.25f}).x * 255 == doctest::Approx(20));
  CHECK(t.sample({0.25f, 0.75f}).x * 255 == doctest::Approx(30));
  CHECK(t.sample({1.0f, 1.0f}).x * 255 == doctest::Approx(40));
}

TEST_CASE("texture: repeat") {
  const Texture t = row({0, 90, 180}, Wrap::Repeat);
  CHECK(grey(t, 0.5f) == doctest::Approx(90));
  CHECK(grey(t, 0.5f - 2) == doctest::Approx(90));
  CHECK(grey(t, 0.5f + 7) == doctest::Approx(90));
  CHECK(grey(t, 0) == doctest::Approx(90));  // between the last texel and the first
  CHECK(grey(t, 1) == doctest::Approx(90));
  CHECK(grey(t, -1e-9f) == doctest::Approx(90));
  CHECK(grey(row({0, 90, 180}, Wrap::Repeat, Filter::Nearest), -0.1f) == doctest::Approx(180));
}

TEST_CASE("texture: mirrored repeat") {
  const Texture t = row({0, 90, 180}, Wrap::Mirror);
  for (const float u : {0.1f, 0.3f, 0.45f, 0.8f, 0.99f}) {
    CHECK(grey(t, u) == doctest::Approx(grey(t, -u)));
    CHECK(grey(t, u) == doctest::Approx(grey(t, 2 - u)));
    CHECK(grey(t, u) == doctest::Approx(grey(t, u + 4)).epsilon(1e-4));
  }
  CHECK(grey(t, 1) == doctest::Approx(180));
  CHECK(grey(t, 0) == doctest::Approx(0));
}

TEST_CASE("texture: clamp to edge") {
  const Texture t = row({0, 90, 180}, Wrap::Clamp);
  CHECK(grey(t, -5) == doctest::Approx(0));
  CHECK(grey(t, 5) == doctest::Approx(180));
  CHECK(grey(t, 1.0f / 3) == doctest::Approx(45));
}

TEST_CASE("texture: nearest does not blend") {
  const Texture t = row({0, 90, 180}, Wrap::Repeat, Filter::Nearest);
  CHECK(grey(t, 0.32f) == doctest::Approx(0));
  CHECK(grey(t, 0.34f) == doctest::Approx(90));
}

TEST_CASE("texture: one texel is constant whatever the coordinates") {
  for (const Wrap wrap : {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp}) {
    const Texture t = row({77}, wrap);
    for (const float u : {-3.3f, 0.0f, 0.5f, 0.999f, 1.0f, 12345.6f}) CHECK(grey(t, u) == doctest::Approx(77));
  }
}

TEST_CASE("texture: coordinates that are not finite are safe") {
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(),
                       -std::numeric_limits<float>::infinity(),
                       std::numeric_limits<float>::max(),
                       -1e30f,
                       3e9f};
  for (const Wrap wrap : {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp}) {
    for (const Filter filter : {Filter::Linear, Filter::Nearest}) {
      for (const float u : bad) {
        for (const float v : bad) CHECK(std::isfinite(row({1, 2, 3}, wrap, filter).sample({u, v}).x));
      }
    }
  }
}

TEST_CASE("texture: sRGB is decoded before filtering, alpha never") {
  const Texture t(byteImage(2, 1, 4, {0, 128, 255, 128, 255, 128, 0, 128}), true, Wrap::Clamp, Wrap::Clamp,
                  Filter::Linear);
  const Vec4 middle = t.sample({0.5f, 0.5f});
  CHECK(middle.x == doctest::Approx(0.5));
  CHECK(middle.y == doctest::Approx(fromSrgb(128 / 255.0f)));
  CHECK(middle.w == doctest::Approx(128 / 255.0));
}

TEST_CASE("texture: grey is replicated and missing alpha is 1") {
  CHECK(Texture(byteImage(1, 1, 1, {51}), false, Wrap::Repeat, Wrap::Repeat, Filter::Linear).sample({0, 0}) ==
        Vec4(0.2f, 0.2f, 0.2f, 1));
  const Vec4 pair =
      Texture(byteImage(1, 1, 2, {51, 102}), false, Wrap::Repeat, Wrap::Repeat, Filter::Linear).sample({0, 0});
  CHECK(pair.z == 0.2f);
  CHECK(pair.w == doctest::Approx(0.4));
  CHECK(Texture(byteImage(1, 1, 3, {51, 0, 255}), false, Wrap::Repeat, Wrap::Repeat, Filter::Linear).sample({0, 0}) ==
        Vec4(0.2f, 0, 1, 1));
  CHECK(Texture().sample({0, 0}) == Vec4(1));
}

TEST_CASE("texture: floating-point images are linear") {
  auto image = std::make_shared<Image>();
  image->width = 2;
  image->height = 1;
  image->channels = 3;
  image->floats = {0, 0, 0, 20, 2, 4};
  const Texture t(image, true, Wrap::Clamp, Wrap::Clamp, Filter::Linear);
  CHECK(t.sample({0.5f, 0.5f}) == Vec4(10, 1, 2, 1));
  CHECK(t.bytes() == 6 * sizeof(float));
}

}  // namespace braid::test_texture
