// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/kpn/kpn_network.h"

#include <algorithm>

#include <fmt/format.h>

#include "combiners/learned/network_file.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

NetworkFile readKpn(const std::string& path) {
  NetworkFile file = readNetworkFile(path);
  const int outputs = file.network.layers.back().outputs;
  if (file.network.inputs != 4 * kKpnPlanes || outputs != kKpnOutputs)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {} channels become {}, but kpn has {} and {}: train it again (tools/train)", path,
                            file.network.inputs, outputs, 4 * kKpnPlanes, kKpnOutputs));
  return file;
}

std::array<float, kKpnLevels> constants(const NetworkFile& file, const std::string& name, const std::string& path) {
  const auto found = file.constants.find(name);
  if (found == file.constants.end() || found->second.size() != kKpnLevels)
    throw Error(ExitCode::BadInput, fmt::format("{}: {} is no list of {} numbers", path, name, kKpnLevels));
  std::array<float, kKpnLevels> out;
  // Steepness and tolerance of less than nothing would prefer what differs.
  std::transform(found->second.begin(), found->second.end(), out.begin(), [](float v) { return std::max(v, 0.0f); });
  return out;
}

// Four pixels of each plane become four channels of one.
void packRow(const KpnPlanes& planes, int y, int x0, int x1, float* row) {
  const int width = planes.width(), height = planes.height();
  for (int x = x0; x < x1; ++x)
    for (const Plane<float>& plane : planes.input)
      for (int k = 0; k < 4; ++k) {
        const int u = 2 * x + k % 2, v = 2 * y + k / 2;
        *row++ = u < width && v < height ? plane.at(u, v) : 0.0f;
      }
}

void unpackRow(const float* row, int y, int x0, int x1, KpnFeatures& out) {
  const int width = out.level[0][0].width, height = out.level[0][0].height;
  for (int x = x0; x < x1; ++x) {
    for (Plane<float>& plane : out.level[0])
      for (int k = 0; k < 4; ++k, ++row) {
        const int u = 2 * x + k % 2, v = 2 * y + k / 2;
        if (u < width && v < height) plane.at(u, v) = *row;
      }
    for (size_t l = 1; l < kKpnLevels; ++l)
      for (Plane<float>& plane : out.level[l]) plane.at(x, y) = *row++;
  }
}

}  // namespace

KpnNetwork::KpnNetwork(const std::string& path, const ConvolutionLibrary& library)
    : network_([&] {
        NetworkFile file = readKpn(path);
        tests_.steepness = constants(file, "steepness", path);
        tests_.tolerance = constants(file, "tolerance", path);
        tests_.gateSteepness = constants(file, "gateSteepness", path);
        tests_.gateTolerance = constants(file, "gateTolerance", path);
        return TiledNetwork(std::move(file.network), library);
      }()) {}

KpnFeatures KpnNetwork::describe(const KpnPlanes& planes, const std::atomic<bool>* cancel) {
  KpnFeatures out = kpnFeatures(planes.width(), planes.height());
  NetworkImage image;
  image.width = out.level[1][0].width;
  image.height = out.level[1][0].height;
  image.cancel = cancel;
  image.read = [&](int y, int x0, int x1, float* row) { packRow(planes, y, x0, x1, row); };
  image.write = [&](int y, int x0, int x1, const float* row) { unpackRow(row, y, x0, x1, out); };
  network_.run(image);
  shrinkToLevels(out);
  return out;
}

Rgb<float> KpnNetwork::denoise(KpnPlanes planes, const std::atomic<bool>* cancel) {
  const KpnFeatures features = describe(planes, cancel);
  planes.input = {};
  Rgb<float> out = kpnFiltered(planes.irradiance, planes.variance, features, tests_);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] *= planes.divisor[c][i];
    });
  return out;
}

}  // namespace braid
