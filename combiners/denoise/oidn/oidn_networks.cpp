// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/oidn/oidn_networks.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <fmt/format.h>

#include "combiners/denoise/oidn/oidn_transfer.h"
#include "combiners/denoise/oidn/oidn_unet.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

// A number that is none becomes the least.
float within(float value, float least, float most) { return value > least ? std::min(value, most) : least; }

std::string& namedFolder() {
  static std::string folder;
  return folder;
}

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

bool hasLight(const Rgb<float>& colour) {
  for (const Plane<float>& plane : colour.channel)
    if (std::any_of(plane.data.begin(), plane.data.end(), [](float v) { return v > 0; })) return true;
  return false;
}

Rgb<float> encodedRadiance(const Rgb<float>& colour) {
  Rgb<float> encoded(colour.width(), colour.height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(colour.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) encoded[c][i] = oidnEncoded(colour[c][i]);
    });
  return encoded;
}

Network readNetwork(const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored))
    throw Error(ExitCode::BadInput,
                file.string() + ": there are no such weights: fetch them with tools/setup oidn, or name their folder");
  WeightTensors weights = readTza(file.string());
  try {
    Network network = oidnUnet(std::move(weights));
    graphOf(network);
    if (network.inputs % 3 != 0 || network.layers.back().outputs != 3)
      throw Error(ExitCode::BadInput, fmt::format("{} channels become {}, which is no network of Open Image Denoise",
                                                  network.inputs, network.layers.back().outputs));
    return network;
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", file.string(), e.what()));
  }
}

}  // namespace

OidnNetworks::OidnNetworks(std::string folder, const OidnChoice& choice, const ConvolutionLibrary& library)
    : folder_(std::move(folder)), choice_(choice), library_(library) {}

TiledNetwork& OidnNetworks::network(const std::string& name) {
  std::unique_ptr<TiledNetwork>& made = networks_[name];
  if (!made) made = std::make_unique<TiledNetwork>(readNetwork(fs::path(folder_) / (name + ".tza")), library_);
  return *made;
}

void OidnNetworks::encodeRow(const Input& input, int y, int x0, int x1, float* row, size_t step) {
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float>& plane = (*input.image)[c];
    const float* from = &plane.at(x0, y);
    float* to = row + c;
    for (int x = x0; x < x1; ++x, ++from, to += step) switch (input.encoding) {
        case Encoding::Albedo:
          *to = within(*from, 0, 1);
          break;
        case Encoding::Normal:
          *to = 0.5f * within(*from, -1, 1) + 0.5f;
          break;
        case Encoding::AsItIs:
          *to = *from;
          break;
      }
  }
}

Rgb<float> OidnNetworks::filtered(const std::string& name, const std::vector<Input>& inputs, bool radiance) {
  TiledNetwork& network = this->network(name);
  const size_t channels = 3 * inputs.size();
  if (static_cast<size_t>(network.inputs()) != channels)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: it reads {} channels instead of {}: take the file from where it "
                            "is published again",
                            (fs::path(folder_) / (name + ".tza")).string(), network.inputs(), channels));
  NetworkImage image;
  image.width = inputs[0].image->width();
  image.height = inputs[0].image->height();
  image.cancel = choice_.cancel;
  image.read = [&](int y, int x0, int x1, float* row) {
    for (size_t k = 0; k < inputs.size(); ++k) encodeRow(inputs[k], y, x0, x1, row + 3 * k, channels);
  };
  Rgb<float> out(image.width, image.height);
  image.write = [&](int y, int x0, int x1, const float* row) {
    for (size_t c = 0; c < 3; ++c)
      for (int x = x0; x < x1; ++x) {
        const float value = row[3 * static_cast<size_t>(x - x0) + c];
        out[c].at(x, y) = radiance ? oidnDecoded(value) : within(value, 0, 1);
      }
  };
  network.run(image);
  return out;
}

std::string oidnNetworkName(const OidnChoice& choice, bool albedo, bool normal) {
  const bool large = choice.size == OidnSize::Large;
  const std::string size = choice.size == OidnSize::Small ? "_small" : "";
  if (!albedo) return "rt_hdr" + size;
  if (!normal) return "rt_hdr_alb" + size;
  if (!large && !choice.prefilter) return "rt_hdr_alb_nrm" + size;
  return "rt_hdr_calb_cnrm" + (large ? "_large" : size);
}

Rgb<float> OidnNetworks::denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal) {
  // Networks add a little to black.
  if (!hasLight(colour)) return {colour.width(), colour.height()};
  // Once, not in every tile that reads a pixel.
  const Rgb<float> radiance = encodedRadiance(colour);
  std::vector<Input> inputs{{&radiance, Encoding::AsItIs}};
  if (albedo) inputs.push_back({albedo, Encoding::Albedo});
  if (albedo && normal) inputs.push_back({normal, Encoding::Normal});
  const std::string name = oidnNetworkName(choice_, albedo, normal);
  Rgb<float> cleanAlbedo, cleanNormal;
  if (name.starts_with("rt_hdr_calb_cnrm")) {
    const std::string size = choice_.size == OidnSize::Large ? "_large" : "";
    cleanAlbedo = filtered("rt_alb" + size, {inputs[1]}, false);
    cleanNormal = filtered("rt_nrm" + size, {inputs[2]}, false);
    inputs[1] = {&cleanAlbedo, Encoding::AsItIs};
    inputs[2] = {&cleanNormal, Encoding::AsItIs};
  }
  return filtered(name, inputs, true);
}

OidnWeights findOidnWeights() {
  for (const std::string& named : {namedFolder(), variable("BRAID_OIDN_WEIGHTS")})
    if (!named.empty()) return {named, true};
  fs::path data = variable("XDG_DATA_HOME");
  if (data.empty() && !variable("HOME").empty()) data = fs::path(variable("HOME")) / ".local/share";
  const fs::path folder = data / "braid/oidn";
  std::error_code ignored;
  if (data.empty() || !fs::is_directory(folder, ignored)) return {};
  return {folder.string(), false};
}

void nameOidnWeights(const std::string& folder) { namedFolder() = folder; }

}  // namespace braid
