// SPDX-License-Identifier: Apache-2.0
// Vertices that follow joints: linear blend skinning.
#pragma once

#include <algorithm>
#include <vector>

#include "renderer/scene/data/placement.h"
#include "renderer/scene/data/scene_data.h"

namespace braid::gltf {

// T: the numbers in which matrices are blended.
template <class T>
class Skinning {
 public:
  // `joints`: to the world times inverse bind, all zero for a joint that does not exist; `origin` is taken from what
  // comes out.
  Skinning(const std::vector<glm::dmat4>& joints, const glm::dvec3& origin, size_t vertices)
      : blended_(vertices, Matrix(0)), total_(vertices, 0.0f) {
    for (glm::dmat4 joint : joints) {
      for (int c = 0; c < 4; ++c) joint[c] -= glm::dvec4(origin * joint[c].w, 0);
      joints_.emplace_back(joint);
    }
  }

  // Four numbers of joints and weights a vertex; what makes no sense moves nothing.
  void add(const std::vector<float>& joints, const std::vector<float>& weights) {
    for (size_t i = 0; i < blended_.size() * 4; ++i) {
      if (!(weights[i] > 0) || !std::isfinite(weights[i])) continue;
      if (!(joints[i] >= 0 && joints[i] < 1e9f)) continue;
      const auto joint = static_cast<size_t>(joints[i]);
      if (joint >= joints_.size() || joints_[joint][3][3] == 0) continue;
      blended_[i / 4] += joints_[joint] * static_cast<T>(weights[i]);
      total_[i / 4] += weights[i];
    }
  }

  // Moves the vertices, and returns how many have no weights: these follow the first joint.
  uint64_t apply(MeshVertices& mesh) {
    const auto first = std::find_if(joints_.begin(), joints_.end(), [](const Matrix& j) { return j[3][3] != 0; });
    const Matrix atRest = first == joints_.end() ? Matrix(1) : *first;
    uint64_t unweighted = 0;
    for (size_t v = 0; v < blended_.size(); ++v) {
      if (!(total_[v] > 1e-6f)) {
        ++unweighted;
        blended_[v] = atRest;
        total_[v] = 1;
      }
      transform(mesh, v, blended_[v] * (1 / static_cast<T>(total_[v])));
    }
    return unweighted;
  }

 private:
  using Matrix = glm::mat<4, 4, T>;

  static void transform(MeshVertices& mesh, size_t v, const Matrix& m) {
    mesh.positions[v] = Vec3(m * glm::vec<4, T>(glm::vec<3, T>(mesh.positions[v]), 1));
    const glm::mat3 linear(m);
    if (!mesh.normals.empty()) {
      const glm::mat3 normalMatrix = cofactors(linear);
      const float side = glm::dot(linear[0], normalMatrix[0]) < 0 ? -1.0f : 1.0f;
      mesh.normals[v] = normalizedOr(side * (normalMatrix * mesh.normals[v]), Vec3(0));
    }
    if (!mesh.tangents.empty()) mesh.tangents[v] = Vec4(linear * Vec3(mesh.tangents[v]), mesh.tangents[v].w);
  }

  std::vector<Matrix> joints_, blended_;
  std::vector<float> total_;
};

}  // namespace braid::gltf
