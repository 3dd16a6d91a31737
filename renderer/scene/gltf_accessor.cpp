// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf_accessor.h"

#include <algorithm>

namespace braid::gltf {

namespace {

uint64_t columnBytes(const Accessor& accessor) {
  const uint64_t tight = accessor.rows * componentBytes(accessor.component);
  return accessor.columns > 1 ? (tight + 3) / 4 * 4 : tight;
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
  const uint64_t column = columnBytes(accessor);
  for (uint64_t i = 0; i < source.count; ++i) {
    const uint8_t* element = source.first + i * source.stride;
    for (uint64_t c = 0; c < accessor.columns; ++c) {
      for (uint64_t r = 0; r < accessor.rows; ++r) *out++ = convert(load<T>(element + c * column + r * sizeof(T)));
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
  switch (accessor.component) {
    case Component::I8:
      return readReal<int8_t>(accessor, source, normalized, out);
    case Component::U8:
      return readReal<uint8_t>(accessor, source, normalized, out);
    case Component::I16:
      return readReal<int16_t>(accessor, source, normalized, out);
    case Component::U16:
      return readReal<uint16_t>(accessor, source, normalized, out);
    case Component::U32:
      return readReal<uint32_t>(accessor, source, normalized, out);
    case Component::F32:
      return readReal<float>(accessor, source, normalized, out);
  }
}

template <class T>
void readWhole(const Accessor& accessor, const Strided& source, uint32_t* out) {
  readStrided<T>(accessor, source, out, [](T v) { return static_cast<uint32_t>(v); });
}

void readBlock(const Accessor& accessor, const Strided& source, bool, uint32_t* out) {
  switch (accessor.component) {
    case Component::U8:
      return readWhole<uint8_t>(accessor, source, out);
    case Component::U16:
      return readWhole<uint16_t>(accessor, source, out);
    case Component::U32:
      return readWhole<uint32_t>(accessor, source, out);
    // Refused by validation wherever integers are wanted.
    default:
      std::fill_n(out, source.count * accessor.components(), 0u);
  }
}

Strided elementsOf(const Document& document, const Accessor& accessor) {
  const BufferView& view = document.views[accessor.view];
  return {view.data.data() + accessor.offset, view.stride != 0 ? view.stride : elementBytes(accessor), accessor.count};
}

Strided replacementsOf(const Document& document, const Accessor& accessor) {
  const SparseAccessor& sparse = *accessor.sparse;
  return {document.views[sparse.valueView].data.data() + sparse.valueOffset, elementBytes(accessor), sparse.count};
}

Strided oneOf(const Strided& all, uint64_t index) { return {all.first + index * all.stride, all.stride, 1}; }

template <class Value>
void replaceSparse(const Document& document, const Accessor& accessor, bool normalized, std::vector<Value>& values) {
  const std::vector<uint32_t> indices = sparseIndices(document, *accessor.sparse);
  const Strided replacements = replacementsOf(document, accessor);
  for (size_t i = 0; i < indices.size(); ++i) {
    readBlock(accessor, oneOf(replacements, i), normalized, &values[size_t(indices[i]) * accessor.components()]);
  }
}

template <class Value>
std::vector<Value> readAll(const Document& document, uint32_t index, bool normalized) {
  const Accessor& accessor = document.accessors[index];
  BRAID_ASSERT(accessor.valid);
  std::vector<Value> values(accessor.count * accessor.components());
  if (accessor.view != kNone) readBlock(accessor, elementsOf(document, accessor), normalized, values.data());
  if (accessor.sparse) replaceSparse(document, accessor, normalized, values);
  return values;
}

}  // namespace

uint64_t componentBytes(Component component) {
  switch (component) {
    case Component::I8:
    case Component::U8:
      return 1;
    case Component::I16:
    case Component::U16:
      return 2;
    default:
      return 4;
  }
}

uint64_t elementBytes(const Accessor& accessor) { return accessor.columns * columnBytes(accessor); }

std::vector<float> readFloats(const Document& document, uint32_t accessor, Integers integers) {
  const bool normalized = integers == Integers::AlwaysNormalized || document.accessors[accessor].normalized;
  return readAll<float>(document, accessor, normalized);
}

std::vector<float> gatherFloats(const Document& document, uint32_t index, std::span<const uint32_t> elements,
                                Integers integers) {
  const Accessor& accessor = document.accessors[index];
  BRAID_ASSERT(accessor.valid);
  const bool normalized = integers == Integers::AlwaysNormalized || accessor.normalized;
  const size_t width = accessor.components();
  std::vector<float> values(elements.size() * width);
  if (accessor.view != kNone) {
    const Strided all = elementsOf(document, accessor);
    for (size_t i = 0; i < elements.size(); ++i)
      readBlock(accessor, oneOf(all, elements[i]), normalized, &values[i * width]);
  }
  if (!accessor.sparse) return values;
  const std::vector<uint32_t> replaced = sparseIndices(document, *accessor.sparse);
  const Strided replacements = replacementsOf(document, accessor);
  for (size_t i = 0; i < elements.size(); ++i) {
    const auto found = std::lower_bound(replaced.begin(), replaced.end(), elements[i]);
    if (found == replaced.end() || *found != elements[i]) continue;
    readBlock(accessor, oneOf(replacements, static_cast<uint64_t>(found - replaced.begin())), normalized,
              &values[i * width]);
  }
  return values;
}

std::vector<uint32_t> sparseIndices(const Document& document, const SparseAccessor& sparse) {
  Accessor scalar;
  scalar.component = sparse.indexType;
  std::vector<uint32_t> indices(sparse.count);
  const uint8_t* data = document.views[sparse.indexView].data.data() + sparse.indexOffset;
  readBlock(scalar, {data, componentBytes(sparse.indexType), sparse.count}, false, indices.data());
  return indices;
}

std::vector<uint32_t> readIntegers(const Document& document, uint32_t accessor) {
  return readAll<uint32_t>(document, accessor, false);
}

}  // namespace braid::gltf
