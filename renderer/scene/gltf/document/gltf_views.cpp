// SPDX-License-Identifier: Apache-2.0
// Buffer views: placed inside their buffers, and decompressed where EXT/KHR_meshopt_compression packed them.
#include <meshoptimizer.h>

#include "renderer/core/parallel.h"
#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/document/meshopt_vertices.h"

namespace braid::gltf {

namespace {

enum class Mode : uint8_t { Attributes, Triangles, Indices };
enum class Filter : uint8_t { None, Octahedral, Quaternion, Exponential, Colour };

// What EXT_meshopt_compression says of a view.
struct Packed {
  int buffer = -1;
  uint64_t offset = 0, length = 0, stride = 0, count = 0;
  Mode mode = Mode::Attributes;
  Filter filter = Filter::None;
};

Packed readPacked(const Value& json) {
  const auto whole = [&](const char* name) { return static_cast<uint64_t>(number(json, name, 0)); };
  const std::string mode = member(json, "mode").Get<std::string>();
  const Value& filterName = member(json, "filter");
  const std::string filter = filterName.IsString() ? filterName.Get<std::string>() : "NONE";
  return {index(json, "buffer"),
          whole("byteOffset"),
          whole("byteLength"),
          whole("byteStride"),
          whole("count"),
          mode == "ATTRIBUTES"  ? Mode::Attributes
          : mode == "TRIANGLES" ? Mode::Triangles
                                : Mode::Indices,
          filter == "OCTAHEDRAL"    ? Filter::Octahedral
          : filter == "QUATERNION"  ? Filter::Quaternion
          : filter == "EXPONENTIAL" ? Filter::Exponential
          : filter == "COLOR"       ? Filter::Colour
                                    : Filter::None};
}

// The bytes [offset, offset + length) of a buffer, or as many of them as there are; reports why not all.
Bytes slice(Document& document, int buffer, uint64_t offset, uint64_t length, const std::string& place) {
  if (buffer < 0 || length == 0) return {};
  if (document.bareBuffers.contains(buffer)) {
    document.report.problem(place + "/buffer",
                            "is " + std::to_string(buffer) + ", a buffer without a uri and without data; give it a uri",
                            "what reads it is left out");
    return {};
  }
  const Bytes data = document.model.buffers[static_cast<size_t>(buffer)].data;
  if (data.empty()) return {};  // a buffer whose file failed was reported already
  if (offset <= data.size() && length <= data.size() - offset) return data.subspan(offset, length);
  document.report.problem(place,
                          "covers bytes " + std::to_string(offset) + " to " + std::to_string(offset + length) +
                              " of buffer " + std::to_string(buffer) + ", which has " + std::to_string(data.size()) +
                              "; correct byteOffset and byteLength",
                          "what lies beyond is left out");
  return offset < data.size() ? data.subspan(offset) : Bytes();
}

// `packedBytes`: those that are there.
bool layoutValid(const Packed& view, uint64_t packedBytes, uint64_t viewLength, Report& report,
                 const std::string& place) {
  const char* const without = "what reads it is left out";
  const bool attributes = view.mode == Mode::Attributes;
  const bool strideFits =
      attributes ? view.stride % 4 == 0 && view.stride > 0 && view.stride <= 256 : view.stride == 2 || view.stride == 4;
  if (!strideFits) {
    report.problem(
        place + "/byteStride",
        "is " + std::to_string(view.stride) + "; it must be " + (attributes ? "a multiple of 4 up to 256" : "2 or 4"),
        without);
    return false;
  }
  // The codecs pack at best 1024 to 1; more is a declared size that the data cannot hold.
  if (view.count > viewLength / view.stride || view.count * view.stride > packedBytes * 1024 + 4096) {
    report.problem(place + "/count",
                   "is " + std::to_string(view.count) + ", more than the view can hold; compress the file again",
                   without);
    return false;
  }
  if (view.mode == Mode::Triangles && view.count % 3 != 0) {
    report.problem(place + "/count", "is " + std::to_string(view.count) + "; a triangle list needs a multiple of 3",
                   without);
    return false;
  }
  const bool filterFits =
      view.filter == Filter::None ||
      (attributes &&
       ((view.filter != Filter::Octahedral && view.filter != Filter::Colour) || view.stride == 4 || view.stride == 8) &&
       (view.filter != Filter::Quaternion || view.stride == 8));
  if (!filterFits)
    report.problem(place + "/filter", "does not fit mode and byteStride; compress the file again", without);
  return filterFits;
}

// Returns whether the data could be decoded.
bool decodeMeshopt(const Packed& view, Bytes source, std::vector<uint8_t>& out) {
  switch (view.mode) {
    case Mode::Attributes:
      if (source[0] == kMeshoptVersion1) {
        if (!decodeMeshoptVertices(source, view.count, view.stride, out.data())) return false;
      } else if (meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, source.data(), source.size()) != 0) {
        return false;
      }
      break;
    case Mode::Triangles:
      return meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, source.data(), source.size()) == 0;
    case Mode::Indices:
      return meshopt_decodeIndexSequence(out.data(), view.count, view.stride, source.data(), source.size()) == 0;
  }
  switch (view.filter) {
    case Filter::None:
      break;
    case Filter::Octahedral:
      meshopt_decodeFilterOct(out.data(), view.count, view.stride);
      break;
    case Filter::Quaternion:
      meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
      break;
    case Filter::Exponential:
      meshopt_decodeFilterExp(out.data(), view.count, view.stride);
      break;
    case Filter::Colour:
      decodeMeshoptColours(out.data(), view.count, view.stride);
      break;
  }
  return true;
}

struct Job {
  View* view;
  Packed packed;
  Bytes source;
  std::string place;
  bool decoded = false;
};

}  // namespace

void resolveViews(Document& document) {
  std::vector<Job> jobs;
  // Views that overlap could have the same few bytes unpacked any number of times.
  uint64_t present = 0, claimed = 0;
  for (const tinygltf::Buffer& buffer : document.model.buffers) present += buffer.data.size();
  for (size_t i = 0; i < document.views.size(); ++i) {
    const tinygltf::BufferView& json = document.model.bufferViews[i];
    View& view = document.views[i];
    const std::string place = "/bufferViews/" + std::to_string(i);
    const bool isKhr = json.extensions.contains("KHR_meshopt_compression");
    const char* const name = isKhr ? "KHR_meshopt_compression" : "EXT_meshopt_compression";
    const Value& extension = member(json.extensions, name);
    if (!extension.IsObject()) {
      view.data = slice(document, json.buffer, json.byteOffset, json.byteLength, place);
      continue;
    }
    const Packed packed = readPacked(extension);
    const std::string at = place + "/extensions/" + name;
    const Bytes source = slice(document, packed.buffer, packed.offset, packed.length, at);
    if (source.empty() || !layoutValid(packed, source.size(), json.byteLength, document.report, at)) continue;
    claimed += source.size();
    if (claimed > 2 * present) {
      document.report.problem(at, "shares its bytes with many other views; compress the file again",
                              "what reads it is left out");
      continue;
    }
    jobs.push_back({&view, packed, source, at});
  }
  parallelFor(jobs.size(), [&](size_t i) {
    Job& job = jobs[i];
    // Never allocated beyond the check above: at most 1024 times the compressed bytes.
    job.view->decoded.resize(job.packed.count * job.packed.stride);
    job.decoded = decodeMeshopt(job.packed, job.source, job.view->decoded);
  });
  for (Job& job : jobs) {
    if (job.decoded) {
      document.count(FilePart::MeshoptViews);
      job.view->data = job.view->decoded;
      if (job.view->stride == 0 && job.packed.mode == Mode::Attributes) job.view->stride = job.packed.stride;
      continue;
    }
    job.view->decoded = {};
    document.report.problem(job.place, "cannot be decompressed: the data is broken; compress the file again",
                            "what reads it is left out");
  }
}

}  // namespace braid::gltf
