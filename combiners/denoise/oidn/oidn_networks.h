// SPDX-License-Identifier: Apache-2.0
// The published networks of Open Image Denoise, run by braid: which of them, and what they are given.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>

#include "combiners/learned/tiled_network.h"
#include "renderer/core/plane.h"

namespace braid {

enum class OidnSize { Small, Base, Large };

struct OidnChoice {
  OidnSize size = OidnSize::Base;
  bool prefilter = false;  // albedo and normals, each by a network of its own; the large one was trained with no others
  const std::atomic<bool>* cancel = nullptr;
};

// The network, and file of weights, for the features that there are; normals alone are not read.
std::string oidnNetworkName(const OidnChoice& choice, bool albedo, bool normal);

class OidnNetworks {
 public:
  // `folder` holds the weights. The library must outlive this.
  OidnNetworks(std::string folder, const OidnChoice& choice, const ConvolutionLibrary& library);

  // Either feature may be null. Throws Error(BadInput) naming a file that is not there or is none.
  Rgb<float> denoise(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal);

 private:
  // What one network reads, three channels each, and how.
  enum class Encoding { AsItIs, Albedo, Normal };
  struct Input {
    const Rgb<float>* image;
    Encoding encoding;
  };

  TiledNetwork& network(const std::string& name);
  Rgb<float> filtered(const std::string& name, const std::vector<Input>& inputs, bool radiance);
  static void encodeRow(const Input& input, int y, int x0, int x1, float* row, size_t step);

  std::string folder_;
  OidnChoice choice_;
  const ConvolutionLibrary& library_;
  std::map<std::string, std::unique_ptr<TiledNetwork>> networks_;
};

// Where the weights lie.
struct OidnWeights {
  std::string folder;  // empty: nowhere
  bool named = false;  // by the user, so that they are preferred to an installed library
};

// What nameOidnWeights() or else the environment variable BRAID_OIDN_WEIGHTS says, else the folder braid/oidn of the
// user's data where `tools/setup oidn` puts them.
OidnWeights findOidnWeights();
// For the rest of the process.
void nameOidnWeights(const std::string& folder);

}  // namespace braid
