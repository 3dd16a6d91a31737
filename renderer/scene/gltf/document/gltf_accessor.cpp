// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_accessor.h"

#include <algorithm>

namespace braid::gltf {

namespace {

uint64_t columnsOf(const Accessor& accessor) {
  switch (accessor.type) {
    case TINYGLTF_TYPE_MAT2:
      return 2;
    case TINYGLTF_TYPE_MAT3:
      return 3;
    case TINYGLTF_TYPE_MAT4:
      return 4;
    default:
      return 1;
  }
}

uint64_t rowsOf(const Accessor& accessor) { return componentsOf(accessor) / columnsOf(accessor); }

uint64_t columnBytes(const Accessor& accessor) {
  const uint64_t tight = rowsOf(accessor) * componentBytes(accessor.componentType);
  return columnsOf(accessor) > 1 ? (tight + 3) / 4 * 4 : tight;
}

template <class T>
T load(const uint8_t* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return value;
}

// Signed fractions reach -1 twice: at the lowest and the second-lowest integer.
template <class T>
float fraction(T value) {
  return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()), -1.0f);
}

struct Strided {
  const uint8_t* first;
  uint64_t stride, count;
};

template <class T, class Out, class Convert>
void readStrided(const Accessor& accessor, const Strided& source, Out* out, const Convert& convert) {
  const uint64_t column = columnBytes(accessor), columns = columnsOf(accessor), rows = rowsOf(accessor);
  for (uint64_t i = 0; i < source.count; ++i) {
    const uint8_t* element = source.first + i * source.stride;
    for (uint64_t c = 0; c < columns; ++c) {
      for (uint64_t r = 0; r < rows; ++r) *out++ = convert(load<T>(element + c * column + r * sizeof(T)));
    }
  }
}

template <class T>
void readReal(const Accessor& accessor, const Strided& source, bool normalized, float* out) {
  if constexpr (std::is_floating_point_v<T>) {
    readStrided<T>(accessor, source, out, [](T v) { return v; });
  } else if (normalized) {
    readStrided<T>(accessor, source, out, fraction<T>);
  } else {
    readStrided<T>(accessor, source, out, [](T v) { return static_cast<float>(v); });
  }
}

void readBlock(const Accessor& accessor, const Strided& source, bool normalized, float* out) {
  switch (accessor.componentType) {
    case kI8:
      return readReal<int8_t>(accessor, source, normalized, out);
    case kU8:
      return readReal<uint8_t>(accessor, source, normalized, out);
    case kI16:
      return readReal<int16_t>(accessor, source, normalized, out);
    case kU16:
      return readReal<uint16_t>(accessor, source, normalized, out);
    case kU32:
      return readReal<uint32_t>(accessor, source, normalized, out);
    case kF32:
      return readReal<float>(accessor, source, normalized, out);
    default:
      return;
  }
}

template <class T>
void readWhole(const Accessor& accessor, const Strided& source, uint32_t* out) {
  readStrided<T>(accessor, source, out, [](T v) { return static_cast<uint32_t>(v); });
}

void readBlock(const Accessor& accessor, const Strided& source, bool, uint32_t* out) {
  switch (accessor.componentType) {
    case kU8:
      return readWhole<uint8_t>(accessor, source, out);
    case kU16:
      return readWhole<uint16_t>(accessor, source, out);
    case kU32:
      return readWhole<uint32_t>(accessor, source, out);
    // Joints written as floats; what is no number of a joint is one that does not exist.
    case kF32:
      return readStrided<float>(accessor, source, out,
                                [](float v) { return v >= 0 && v < 1e9f ? static_cast<uint32_t>(v) : kNone; });
    // No integers: left out by validation wherever those are wanted.
    default:
      std::fill_n(out, source.count * componentsOf(accessor), 0u);
  }
}

Strided elementsOf(const Document& document, const Accessor& accessor) {
  const View& view = document.views[static_cast<size_t>(accessor.bufferView)];
  return {view.data.data() + accessor.byteOffset, view.stride != 0 ? view.stride : elementBytes(accessor),
          accessor.count};
}

Strided replacementsOf(const Document& document, const Accessor& accessor) {
  const auto& values = accessor.sparse.values;
  return {document.views[static_cast<size_t>(values.bufferView)].data.data() + values.byteOffset,
          elementBytes(accessor), static_cast<uint64_t>(accessor.sparse.count)};
}

Strided oneOf(const Strided& all, uint64_t index) { return {all.first + index * all.stride, all.stride, 1}; }

template <class Number>
void replaceSparse(const Document& document, const Accessor& accessor, bool normalized, std::vector<Number>& values) {
  const std::vector<uint32_t> indices = sparseIndices(document, accessor);
  const Strided replacements = replacementsOf(document, accessor);
  for (size_t i = 0; i < indices.size(); ++i) {
    readBlock(accessor, oneOf(replacements, i), normalized, &values[size_t(indices[i]) * componentsOf(accessor)]);
  }
}

template <class Number>
std::vector<Number> readAll(const Document& document, int index, bool normalized) {
  const Accessor& accessor = document.accessor(index);
  if (accessor.count == 0) return {};
  std::vector<Number> values(accessor.count * componentsOf(accessor));
  if (accessor.bufferView >= 0) readBlock(accessor, elementsOf(document, accessor), normalized, values.data());
  if (accessor.sparse.isSparse) replaceSparse(document, accessor, normalized, values);
  return values;
}

}  // namespace

uint64_t componentBytes(int component) {
  switch (component) {
    case kI8:
    case kU8:
      return 1;
    case kI16:
    case kU16:
      return 2;
    case kU32:
    case kF32:
      return 4;
    default:
      return 0;
  }
}

uint32_t componentsOf(const Accessor& accessor) {
  return static_cast<uint32_t>(tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type)));
}

uint64_t elementBytes(const Accessor& accessor) { return columnsOf(accessor) * columnBytes(accessor); }

std::vector<float> readFloats(const Document& document, int accessor, Integers integers) {
  const bool normalized = integers == Integers::AlwaysNormalized || document.accessor(accessor).normalized;
  return readAll<float>(document, accessor, normalized);
}

std::vector<float> gatherFloats(const Document& document, int index, std::span<const uint32_t> elements,
                                Integers integers) {
  const Accessor& accessor = document.accessor(index);
  const bool normalized = integers == Integers::AlwaysNormalized || accessor.normalized;
  const size_t width = componentsOf(accessor);
  std::vector<float> values(elements.size() * width);
  if (accessor.bufferView >= 0) {
    const Strided all = elementsOf(document, accessor);
    for (size_t i = 0; i < elements.size(); ++i)
      readBlock(accessor, oneOf(all, elements[i]), normalized, &values[i * width]);
  }
  if (!accessor.sparse.isSparse) return values;
  const std::vector<uint32_t> replaced = sparseIndices(document, accessor);
  const Strided replacements = replacementsOf(document, accessor);
  for (size_t i = 0; i < elements.size(); ++i) {
    const auto found = std::lower_bound(replaced.begin(), replaced.end(), elements[i]);
    if (found == replaced.end() || *found != elements[i]) continue;
    readBlock(accessor, oneOf(replacements, static_cast<uint64_t>(found - replaced.begin())), normalized,
              &values[i * width]);
  }
  return values;
}

std::vector<uint32_t> sparseIndices(const Document& document, const Accessor& accessor) {
  const auto& source = accessor.sparse.indices;
  Accessor scalar;
  scalar.type = TINYGLTF_TYPE_SCALAR;
  scalar.componentType = source.componentType;
  std::vector<uint32_t> indices(static_cast<size_t>(accessor.sparse.count));
  const uint8_t* data = document.views[static_cast<size_t>(source.bufferView)].data.data() + source.byteOffset;
  readBlock(scalar, {data, componentBytes(source.componentType), indices.size()}, false, indices.data());
  return indices;
}

std::vector<uint32_t> readIntegers(const Document& document, int accessor) {
  return readAll<uint32_t>(document, accessor, false);
}

}  // namespace braid::gltf
