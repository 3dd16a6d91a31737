// SPDX-License-Identifier: Apache-2.0
// Checks of accessors against the bytes that they name. What fails is reported and emptied.
#include <algorithm>
#include <functional>

#include "renderer/scene/gltf/document/gltf_accessor.h"

namespace braid::gltf {

namespace {

std::string place(const char* array, size_t index) { return std::string("/") + array + '/' + std::to_string(index); }

constexpr const char* kReadersLeftOut = "what reads it is left out";

class AccessorValidator {
 public:
  explicit AccessorValidator(Document& document)
      : document_(document), model_(document.model), report_(document.report) {}

  void accessors() {
    for (size_t i = 0; i < model_.accessors.size(); ++i) {
      Accessor& accessor = model_.accessors[i];
      if (!checkAccessor(accessor, place("accessors", i))) accessor.count = 0;
    }
  }

 private:
  // `count` elements of `size` bytes, `stride` apart, from `offset` within a view.
  bool fits(int viewIndex, uint64_t offset, uint64_t stride, uint64_t size, uint64_t count, const std::string& where) {
    if (viewIndex < 0) return false;  // reported with the JSON
    if (count == 0) return true;
    const View& view = document_.views[static_cast<size_t>(viewIndex)];
    const uint64_t length = view.data.size();
    if (offset <= length && size <= length - offset && count - 1 <= (length - offset - size) / stride) return true;
    // A view without any data was reported itself.
    if (length == 0 && model_.bufferViews[static_cast<size_t>(viewIndex)].byteLength > 0) return false;
    report_.problem(where,
                    "needs " + counted(count, "element", "elements") + " of " + counted(size, "byte", "bytes") +
                        " at a stride of " + std::to_string(stride) + " from byte " + std::to_string(offset) +
                        ", but bufferView " + std::to_string(viewIndex) + " has " + counted(length, "byte", "bytes") +
                        "; correct count, byteOffset or the view",
                    kReadersLeftOut);
    return false;
  }

  // Whether every element can be read.
  bool checkAccessor(const Accessor& accessor, const std::string& where) {
    // Zeros without data cost nothing in the file, so their number needs a bound of its own.
    constexpr uint64_t kMostZeros = uint64_t(1) << 24;
    if (componentBytes(accessor.componentType) == 0) return false;  // reported with the JSON
    const uint64_t size = elementBytes(accessor);
    if (accessor.bufferView < -1) return false;
    if (accessor.bufferView < 0 && accessor.count > kMostZeros) {
      report_.problem(
          where + "/count",
          "is " + std::to_string(accessor.count) + ", too many for an accessor without a bufferView; add one",
          kReadersLeftOut);
      return false;
    }
    bool valid = true;
    if (accessor.bufferView >= 0) {
      const uint64_t declared = document_.views[static_cast<size_t>(accessor.bufferView)].stride;
      if (declared != 0 && declared < size && accessor.count > 1) {
        report_.problem(place("bufferViews", static_cast<size_t>(accessor.bufferView)) + "/byteStride",
                        "is " + std::to_string(declared) + ", less than the " + std::to_string(size) +
                            " bytes of one element; correct it",
                        kReadersLeftOut);
        return false;
      }
      valid =
          fits(accessor.bufferView, accessor.byteOffset, declared != 0 ? declared : size, size, accessor.count, where);
    }
    return (!accessor.sparse.isSparse || checkSparse(accessor, where + "/sparse")) && valid;
  }

  bool checkSparse(const Accessor& accessor, const std::string& where) {
    const auto& sparse = accessor.sparse;
    const auto count = static_cast<uint64_t>(sparse.count);
    if (count > accessor.count) {
      report_.problem(where + "/count",
                      "is " + std::to_string(count) + ", more than the accessor's " + std::to_string(accessor.count) +
                          " elements; correct it",
                      kReadersLeftOut);
      return false;
    }
    Accessor scalar;
    scalar.componentType = sparse.indices.componentType;
    if (!isIndex(scalar)) {
      report_.problem(where + "/indices/componentType", "must be 5121, 5123 or 5125", kReadersLeftOut);
      return false;
    }
    const uint64_t indexBytes = componentBytes(scalar.componentType), valueBytes = elementBytes(accessor);
    const auto at = [](int offset) { return static_cast<uint64_t>(offset); };
    if (!fits(sparse.indices.bufferView, at(sparse.indices.byteOffset), indexBytes, indexBytes, count,
              where + "/indices") ||
        !fits(sparse.values.bufferView, at(sparse.values.byteOffset), valueBytes, valueBytes, count, where + "/values"))
      return false;
    const std::vector<uint32_t> indices = sparseIndices(document_, accessor);
    const bool ascending = std::adjacent_find(indices.begin(), indices.end(), std::greater_equal<>()) == indices.end();
    if (ascending && (indices.empty() || indices.back() < accessor.count)) return true;
    report_.problem(where + "/indices",
                    "must increase and stay below the accessor's count, " + std::to_string(accessor.count) +
                        "; export the file again",
                    kReadersLeftOut);
    return false;
  }

  Document& document_;
  tinygltf::Model& model_;
  Report& report_;
};

}  // namespace

void validateAccessors(Document& document) { AccessorValidator(document).accessors(); }

}  // namespace braid::gltf
