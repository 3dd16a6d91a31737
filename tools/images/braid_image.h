// SPDX-License-Identifier: Apache-2.0
// Estimates from files of braid, with everything that combiners read.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/files/exr.h"

namespace braid {

// Null where the file has no attribute of the name.
const Attribute* findAttribute(const ImageFile& file, const std::string& name);

// No estimates: the size and window of the file.
Estimates emptyLike(const ImageFile& file);

// "<prefix>pt" for every layer "<prefix>pt.mean"; none in files of other renderers.
std::vector<std::string> estimateNames(const ImageFile& file);

// The estimates of the names, their history, and the features if they are complete.
Estimates readBraidImage(const ImageFile& file, const std::vector<std::string>& names);

}  // namespace braid
