// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/guide.h"

namespace braid {

int guideClass(const Vec3& normal, bool narrow) {
  const Vec3 size = magnitudes(normal);
  const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  return 4 * axis + (normal[axis] < 0 ? 2 : 0) + (narrow ? 1 : 0);
}

Vec3 toGuideAxes(int guideClass, const Vec3& w) {
  const int axis = guideClass / 4;
  const float z = (guideClass & 2) != 0 ? -w[axis] : w[axis];
  return {w[(axis + 1) % 3], w[(axis + 2) % 3], z};
}

Vec3 fromGuideAxes(int guideClass, const Vec3& w) {
  const int axis = guideClass / 4;
  Vec3 out;
  out[(axis + 1) % 3] = w.x;
  out[(axis + 2) % 3] = w.y;
  out[axis] = (guideClass & 2) != 0 ? -w.z : w.z;
  return out;
}

}  // namespace braid
