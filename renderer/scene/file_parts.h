// SPDX-License-Identifier: Apache-2.0
// What a file may hold or not, for reports: the name of the trait, and the words of the plan.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

struct FilePartEntry {
  const char* trait;
  // Of the plan: the part, what there is (before its number), why it is left out.
  const char *part, *kept, *left;
};

// In the order of FilePart.
inline constexpr std::array<FilePartEntry, kFileParts> kFilePartTable = {{
    {"ktx2-images", "KTX2 decoder", "images (KHR_texture_basisu)", "no image is a KTX2 texture"},
    {"avif-images", "AVIF decoder", "images (EXT_texture_avif)", "no image is AVIF"},
    {"meshopt-views", "meshopt decoder", "packed views of buffers (KHR_ or EXT_meshopt_compression)",
     "no view of a buffer is packed"},
    {"draco-primitives", "Draco decoder", "packed primitives (KHR_draco_mesh_compression)", "no primitive is packed"},
    {"animated-properties", "animated properties", "values that move beside places and shapes (KHR_animation_pointer)",
     "no clip moves more than places and shapes"},
    {"hidden-nodes", "hidden nodes", "nodes that are not shown (KHR_node_visibility)", "every node is shown"},
    {"points-and-lines", "points and lines", "primitives that become spheres and rods (--point-radius)",
     "none become spheres and rods (--point-radius)"},
    {"image-based-light", "image-based light", "environments of the file (EXT_lights_image_based)",
     "the file brings none, or another environment takes its place"},
}};

}  // namespace braid
