// SPDX-License-Identifier: Apache-2.0
// Pairs of pixels that add to the sums of both, and the filters that are made of them.
#include "combiners/pixels/pair_rows.h"

#include <doctest/doctest.h>

#include <map>
#include <random>
#include <tuple>

#include "combiners/uncorrelated/uncorrelated_filter.h"
#include "combiners/ensemble/weight_bilateral.h"

namespace braid::test_pair_rows {

namespace {

Rgb<float> randomImage(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.5f, 1.5f);
  Rgb<float> image(width, height);
  for (size_t c = 0; c < 3; ++c)
    for (float& v : image[c].data) v = uniform(random);
  return image;
}

constexpr int kLeft = 37, kTop = 5;

Plane<float> cropped(const Plane<float>& in, int width, int height) {
  Plane<float> out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) out.at(x, y) = in.at(x + kLeft, y + kTop);
  return out;
}

Rgb<float> cropped(const Rgb<float>& in, int width, int height) {
  Rgb<float> out(width, height);
  for (size_t c = 0; c < 3; ++c) out[c] = cropped(in[c], width, height);
  return out;
}

// Pixels of the crop that differ from the whole, of those whose windows lie within it.
int differences(const Plane<float>& whole, const Plane<float>& crop, int radius) {
  int count = 0;
  for (int y = radius; y < crop.height - radius; ++y)
    for (int x = radius; x < crop.width - radius; ++x) count += crop.at(x, y) != whole.at(x + kLeft, y + kTop);
  return count;
}

}  // namespace

TEST_CASE("Every pixel of a tile meets all pixels of its window but itself, once, and no others") {
  const PixelRect image = {-2, -1, 30, 21};
  for (const PixelRect& tile : {PixelRect{-2, -1, 6, 9}, {6, 9, 14, 12}, {28, 12, 30, 21}, {3, 3, 4, 4}})
    for (const int step : {1, 2, 3}) {
      using Pair = std::tuple<int, int, int, int>;  // a pixel of the tile, and where the other one is
      std::map<Pair, int> met;
      forPairRows(tile, image, 7, step, [&](const PairRow& row) {
        const Columns all = row.all();
        for (const Columns& part : {row.first, row.second}) {
          if (part.empty()) continue;
          CHECK(part.begin >= all.begin);
          CHECK(part.end <= all.end);
        }
        for (int x = row.first.begin; x < row.first.end; ++x) ++met[{x, row.y, row.dx, row.dy}];
        for (int x = row.second.begin; x < row.second.end; ++x) ++met[{x + row.dx, row.y + row.dy, -row.dx, -row.dy}];
      });
      const int reach = 7 / step * step;
      size_t expected = 0;
      for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x)
          for (int dy = -reach; dy <= reach; dy += step)
            for (int dx = -reach; dx <= reach; dx += step) {
              if ((dx == 0 && dy == 0) || intersection({x + dx, y + dy, x + dx + 1, y + dy + 1}, image).empty())
                continue;
              ++expected;
              CHECK(met[{x, y, dx, dy}] == 1);
            }
      CHECK(met.size() == expected);
    }
}

TEST_CASE("Where the tiles lie changes no bit of filtered weights, and weights that are 0 everywhere stay 0") {
  constexpr int kWidth = 190, kHeight = 80, kCropWidth = 110, kCropHeight = 60;
  WeightMaps raw = uniformWeights(3, 1, kWidth, kHeight);
  raw.planes[0] = randomImage(kWidth, kHeight, 1)[0];
  for (size_t i = 0; i < raw.planes[0].size(); ++i) {
    raw.planes[0][i] -= 0.5f;
    raw.planes[1][i] = 1 - raw.planes[0][i];
    raw.planes[2][i] = 0;
  }
  Estimate guide;
  guide.mean = randomImage(kWidth, kHeight, 2);
  for (size_t h = 0; h < 2; ++h) guide.half[h] = randomImage(kWidth, kHeight, 3 + static_cast<unsigned>(h));
  WeightMaps part = raw;
  for (Plane<float>& plane : part.planes) plane = cropped(plane, kCropWidth, kCropHeight);
  Estimate partGuide;
  partGuide.mean = cropped(guide.mean, kCropWidth, kCropHeight);
  for (size_t h = 0; h < 2; ++h) partGuide.half[h] = cropped(guide.half[h], kCropWidth, kCropHeight);
  for (const int step : {1, 2}) {
    const WeightMaps whole = filteredWeights(raw, guide, nullptr, step);
    const WeightMaps crop = filteredWeights(part, partGuide, nullptr, step);
    for (size_t b = 0; b < 3; ++b) CHECK(differences(whole.planes[b], crop.planes[b], 7) == 0);
    for (const float w : whole.planes[2].data) CHECK(w == 0);
    CHECK(whole.planes[0].data != raw.planes[0].data);
  }
}

TEST_CASE("Where the tiles lie changes no bit of an image of uncorrelated weights") {
  constexpr int kWidth = 320, kHeight = 80, kCropWidth = 240, kCropHeight = 60;
  std::vector<Rgb<float>> whole, part;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    whole.push_back(randomImage(kWidth, kHeight, seed));
    part.push_back(cropped(whole.back(), kCropWidth, kCropHeight));
  }
  const auto filtered = [](const std::vector<Rgb<float>>& in) {
    return uncorrelatedFiltered({&in[0], &in[1], &in[2], &in[3], 4, &in[4], 2}, 0.5);
  };
  const Rgb<float> ofWhole = filtered(whole), ofPart = filtered(part);
  for (size_t c = 0; c < 3; ++c) CHECK(differences(ofWhole[c], ofPart[c], 7) == 0);
  CHECK(ofWhole[0].data != whole[0][0].data);
}

}  // namespace braid::test_pair_rows
