// SPDX-License-Identifier: Apache-2.0
// Values of accessors as plain arrays: any component type, stride, normalisation and sparse replacement.
#pragma once

#include <cstring>
#include <vector>

#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

// componentType of an accessor.
enum Component : int { kI8 = 5120, kU8 = 5121, kI16 = 5122, kU16 = 5123, kU32 = 5125, kF32 = 5126 };

// 0: no type that an accessor may have.
uint64_t componentBytes(int component);
// Numbers an element consists of.
uint32_t componentsOf(const Accessor& accessor);
// Size of one element; columns of matrices start at multiples of four bytes.
uint64_t elementBytes(const Accessor& accessor);

// Whether its numbers can be indices.
inline bool isIndex(const Accessor& a) {
  return a.componentType == kU8 || a.componentType == kU16 || a.componentType == kU32;
}
// Reports accessors whose bytes are not there or not in order, and empties them.
void validateAccessors(Document& document);

// What readers do with integers: follow the accessor, or treat them as fractions whatever it says (colours, weights).
enum class Integers { AsDeclared, AlwaysNormalized };

// count * components values.
std::vector<float> readFloats(const Document& document, int accessor, Integers integers = Integers::AsDeclared);
std::vector<uint32_t> readIntegers(const Document& document, int accessor);
// The same for some elements only; costs nothing for the others.
std::vector<float> gatherFloats(const Document& document, int accessor, std::span<const uint32_t> elements,
                                Integers integers = Integers::AsDeclared);
// The elements that a sparse accessor replaces, ascending once validated.
std::vector<uint32_t> sparseIndices(const Document& document, const Accessor& accessor);

// Elements of two, three or four floats.
template <class Vector>
std::vector<Vector> asVectors(const std::vector<float>& values) {
  std::vector<Vector> vectors(values.size() / size_t(Vector::length()));
  if (!vectors.empty()) std::memcpy(static_cast<void*>(vectors.data()), values.data(), vectors.size() * sizeof(Vector));
  return vectors;
}

}  // namespace braid::gltf
