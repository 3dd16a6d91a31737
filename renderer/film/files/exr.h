// SPDX-License-Identifier: Apache-2.0
// OpenEXR files with the channel names of the field (Nuke, Blender, tev, oiiotool read them); written to a temporary
// file, then renamed.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "renderer/core/plane.h"
#include "renderer/film/estimates.h"

namespace braid {

// Layers beside the image. Features: their means, as half floats but for the depth, and the image's error.
enum class AovSet { None, Features, All };

// One more layer to write beside the estimates: colours, such as "combined.js", or a single plane as channel Y, such as
// "Error".
struct ExrLayer {
  std::string name;
  const Rgb<float>* planes = nullptr;
  const Plane<float>* plane = nullptr;
};

struct ExrOptions {
  AovSet aovs = AovSet::All;
  bool quarters = false;         // also <estimate>.q0 … q3
  bool directIndirect = false;   // also <estimate>.direct, directA, directB, directVariance, indirectVariance
  bool history = false;          // also <estimate>.variance1, variance2, variance4, …: after so many passes,
                                 // and mean1, halfA1, halfB1, … where they are kept
  bool floatHeadline = false;    // R G B as float instead of half; with AovSet::Features those as well
  std::string layerPrefix;       // e.g. "ViewLayer": put before every channel but R G B A
  std::vector<ExrLayer> layers;  // written with AovSet::All; "Error" with Features too
};

// A plane under the channel name that it has in files, such as "R", "Albedo.R" or "pt.mean.R".
struct ExrChannel {
  std::string name;
  const Plane<float>* plane;
  bool half = false;  // stored with 16 bits
};

// The channels that writeExr() writes, in its order; the planes are those of the arguments.
std::vector<ExrChannel> namedPlanes(const Estimates& estimates, const Rgb<float>& headline, const Plane<float>* alpha,
                                    const ExrOptions& options);

struct WriteReport {
  uint64_t clampedToHalf = 0;  // headline values above 65504
};

// Writes R G B (and A when `alpha` is not null) = headline, features, and the statistics planes of every estimate.
// Throws Error(OutputFailed) with a one-line reason; the previous file is left intact then.
WriteReport writeExr(const std::string& path, const Estimates& estimates, const Rgb<float>& headline,
                     const Plane<float>* alpha, const ExrOptions& options);

// Any image file that OpenImageIO reads: planes by channel name, in float and linear (integer formats are decoded from
// sRGB). The parts of a multi-part EXR are merged: a channel name that repeats gets the part's name as a prefix. Throws
// Error(BadInput).
struct ImageFile {
  std::string path;
  int width = 0, height = 0;
  PixelWindow window;  // where the pixels lie in the full frame
  int fullWidth = 0, fullHeight = 0;
  std::vector<std::string> channelNames;
  std::map<std::string, Plane<float>> planes;
  std::vector<Attribute> attributes;
  // The planes prefix.R prefix.G prefix.B (or R G B for an empty prefix; X Y Z serve too; a single plane such as Y is
  // replicated). Throws Error(BadInput) naming what is missing and which layers there are.
  Rgb<float> rgb(const std::string& prefix = "") const;
};
ImageFile readImage(const std::string& path);

// Whether the file holds the layer, in one of the forms that rgb() takes.
bool hasLayer(const ImageFile& file, const std::string& prefix);

// 8-bit PNG without a tone curve and alpha: writePicture().
void writePng(const std::string& path, const Rgb<float>& image, float exposureStops = 0);

}  // namespace braid
