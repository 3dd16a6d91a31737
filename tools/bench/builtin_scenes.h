// SPDX-License-Identifier: Apache-2.0
// Scenes made in memory, for benchmarks and tests that must not depend on files.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// A perfectly diffuse material.
Material diffuseMaterial(const Spectrum& albedo, const Spectrum& emission = Spectrum(0));

// Appends a quad p, p+a, p+a+b, p+b as two triangles; its front is the side of cross(a, b).
void addQuad(TriangleMesh& mesh, const Vec3& p, const Vec3& a, const Vec3& b);
// Appends an icosphere with smooth normals; each level quarters the triangles.
void addSphere(TriangleMesh& mesh, const Vec3& centre, float radius, int level);
// Adds a mesh with one instance.
void addMesh(SceneData& data, TriangleMesh mesh, uint32_t material);

// The diffuse Cornell box, 2 m wide, with its camera; 38 triangles. The blocks are tessellated into about
// `blockTriangles` and rippled when that is over 1000, which makes the million-triangle benchmark.
SceneData cornellBox(size_t blockTriangles = 0);

// A closed sphere seen from inside with albedo a and emission e everywhere: radiance e / (1 - a) for every ray.
SceneData furnace(float albedo, float emission);

}  // namespace braid
