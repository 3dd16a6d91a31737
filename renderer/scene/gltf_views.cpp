// SPDX-License-Identifier: Apache-2.0
// Buffer views: placed inside their buffers, and decompressed where EXT/KHR_meshopt_compression packed them.
#include <meshoptimizer.h>

#include "renderer/core/parallel.h"
#include "renderer/scene/gltf_document.h"

namespace braid::gltf {

namespace {

// The bytes [offset, offset + length) of a buffer; reports why not.
std::optional<Bytes> slice(Document& document, uint32_t buffer, uint64_t offset, uint64_t length, const JsonRef& json) {
  if (buffer == kNone) return {};
  const Bytes data = document.buffers[buffer].data;
  if (!data.data()) {
    // A buffer whose file failed was reported already.
    const JsonRef source = JsonRef(document.root.get(), "", &document.report)["buffers"].at(buffer);
    if (!source["uri"])
      json["buffer"].problem("is " + std::to_string(buffer) +
                             ", a buffer without a uri and without data; give it a uri");
    return {};
  }
  if (offset <= data.size() && length <= data.size() - offset) return data.subspan(offset, length);
  json.problem("covers bytes " + std::to_string(offset) + " to " + std::to_string(offset + length) + " of buffer " +
               std::to_string(buffer) + ", which has " + std::to_string(data.size()) +
               "; correct byteOffset and byteLength");
  return {};
}

bool meshoptLayoutValid(const MeshoptView& view, uint64_t viewLength, const JsonRef& json) {
  const bool attributes = view.mode == MeshoptMode::Attributes;
  const bool strideFits =
      attributes ? view.stride % 4 == 0 && view.stride > 0 && view.stride <= 256 : view.stride == 2 || view.stride == 4;
  if (!strideFits) {
    json["byteStride"].problem(std::string("is ") + std::to_string(view.stride) + "; it must be " +
                               (attributes ? "a multiple of 4 up to 256" : "2 or 4"));
    return false;
  }
  // The codecs pack at best 64 to 1; more is a declared size that the data cannot hold.
  if (view.count > viewLength / view.stride || view.count * view.stride > view.length * 256 + 4096) {
    json["count"].problem("is " + std::to_string(view.count) +
                          ", more than the view can hold; compress the file again");
    return false;
  }
  if (view.mode == MeshoptMode::Triangles && view.count % 3 != 0) {
    json["count"].problem("is " + std::to_string(view.count) + "; a triangle list needs a multiple of 3");
    return false;
  }
  const bool filterFits =
      view.filter == MeshoptFilter::None ||
      (attributes && (view.filter != MeshoptFilter::Octahedral || view.stride == 4 || view.stride == 8) &&
       (view.filter != MeshoptFilter::Quaternion || view.stride == 8));
  if (!filterFits) json["filter"].problem("does not fit mode and byteStride; compress the file again");
  return filterFits;
}

// Returns whether the data could be decoded.
bool decodeMeshopt(const MeshoptView& view, Bytes source, std::vector<uint8_t>& out) {
  switch (view.mode) {
    case MeshoptMode::Attributes:
      if (meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, source.data(), source.size()) != 0)
        return false;
      break;
    case MeshoptMode::Triangles:
      return meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, source.data(), source.size()) == 0;
    case MeshoptMode::Indices:
      return meshopt_decodeIndexSequence(out.data(), view.count, view.stride, source.data(), source.size()) == 0;
  }
  switch (view.filter) {
    case MeshoptFilter::None:
      break;
    case MeshoptFilter::Octahedral:
      meshopt_decodeFilterOct(out.data(), view.count, view.stride);
      break;
    case MeshoptFilter::Quaternion:
      meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
      break;
    case MeshoptFilter::Exponential:
      meshopt_decodeFilterExp(out.data(), view.count, view.stride);
      break;
  }
  return true;
}

struct CompressedView {
  BufferView* view;
  Bytes source;
  JsonRef json;
  bool decoded = false;
};

}  // namespace

void resolveViews(Document& document) {
  const JsonRef list = JsonRef(document.root.get(), "", &document.report)["bufferViews"];
  std::vector<CompressedView> compressed;
  for (size_t i = 0; i < document.views.size(); ++i) {
    BufferView& view = document.views[i];
    const JsonRef json = list.at(i);
    if (!view.meshopt) {
      const std::optional<Bytes> data = slice(document, view.buffer, view.offset, view.length, json);
      view.valid = data.has_value();
      if (data) view.data = *data;
      continue;
    }
    const char* name =
        json.extension("KHR_meshopt_compression") ? "KHR_meshopt_compression" : "EXT_meshopt_compression";
    const JsonRef extension = json.extension(name);
    const std::optional<Bytes> source =
        slice(document, view.meshopt->buffer, view.meshopt->offset, view.meshopt->length, extension);
    if (source && meshoptLayoutValid(*view.meshopt, view.length, extension))
      compressed.push_back({&view, *source, extension});
  }
  parallelFor(compressed.size(), [&](size_t i) {
    CompressedView& item = compressed[i];
    // Never allocated beyond the check above: at most 256 times the compressed bytes.
    item.view->decoded.resize(item.view->meshopt->count * item.view->meshopt->stride);
    item.decoded = decodeMeshopt(*item.view->meshopt, item.source, item.view->decoded);
  });
  for (CompressedView& item : compressed) {
    item.view->valid = item.decoded;
    item.view->data = item.view->decoded;
    if (item.view->stride == 0 && item.view->meshopt->mode == MeshoptMode::Attributes)
      item.view->stride = item.view->meshopt->stride;
    if (!item.decoded) {
      item.json.problem(
          "cannot be decompressed: the data is broken or of a newer codec version; compress the file again with "
          "version 0");
    }
  }
}

}  // namespace braid::gltf
