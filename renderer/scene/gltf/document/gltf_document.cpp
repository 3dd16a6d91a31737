// SPDX-License-Identifier: Apache-2.0
// Bytes to a model: container, text, table, buffers, tinygltf.
#include "renderer/scene/gltf/document/gltf_document.h"

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "renderer/core/parallel.h"
#include "renderer/scene/gltf/document/gltf_extensions.h"
#include "renderer/scene/gltf/document/gltf_mend.h"
#include "renderer/scene/gltf/document/gltf_schema.h"
#include "renderer/scene/gltf/document/other_formats.h"

namespace braid::gltf {

namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

[[noreturn]] void refuse(const Document& document, const std::string& text, const std::string& place = {}) {
  throw SceneError(ExitCode::BadInput, document.path, place, text);
}

uint32_t readU32(const uint8_t* p) {
  return uint32_t(p[0]) | uint32_t(p[1]) << 8 | uint32_t(p[2]) << 16 | uint32_t(p[3]) << 24;
}

constexpr uint64_t kMostBytes = uint64_t(1) << 53, kMostText = 0xFFFFFFFF;
constexpr uint32_t kGlbMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

// Our own, as tinygltf refuses GLBs that are cut, unpadded or have chunks of unknown kinds. Returns the binary chunk.
Bytes splitGlb(Document& document, Bytes all) {
  if (all.size() < 20)
    refuse(document, "is truncated: a GLB has at least 20 bytes, this one " + std::to_string(all.size()));
  const uint32_t version = readU32(&all[4]);
  uint64_t length = readU32(&all[8]);
  if (version != 2) refuse(document, "is GLB version " + std::to_string(version) + "; convert it to version 2");
  if (length > all.size()) {
    const std::string text = "is truncated: its header says " + std::to_string(length) + " bytes, it has " +
                             std::to_string(all.size()) + "; copy or export it again";
    if (20 + uint64_t(readU32(&all[12])) > all.size()) refuse(document, text);
    document.report.problem("", text, "what is there is read");
    length = all.size();
  }
  if (length < all.size()) document.report.warn("", "bytes after the end of the GLB are ignored");
  Bytes binary;
  for (uint64_t at = 12; at + 8 <= length;) {
    uint64_t size = readU32(&all[at]);
    const uint32_t kind = readU32(&all[at + 4]);
    if (size > length - at - 8) {
      const std::string text =
          "has a chunk at byte " + std::to_string(at) + " that runs past the end of the file; export it again";
      if (!document.json.data()) refuse(document, text);
      document.report.problem("", text, "what is there is read");
      size = length - at - 8;
    }
    const Bytes data = all.subspan(at + 8, size);
    if (!document.json.data() && kind != kJsonChunk)
      refuse(document, "does not begin with a JSON chunk; export it again");
    if (kind == kJsonChunk && !document.json.data()) document.json = data;
    if (kind == kBinaryChunk && !binary.data()) binary = data;
    at += 8 + size;
    if (at % 4 != 0) document.report.warn("", "a GLB chunk is not padded to a multiple of 4 bytes");
    // Writers that forget the padding put the next chunk right behind; those that forget it in the length align the
    // next.
    if (at % 4 != 0 && at + 8 <= length && readU32(&all[at + 4]) != kBinaryChunk) at = (at + 3) / 4 * 4;
  }
  if (!document.json.data()) refuse(document, "has no JSON chunk; export it again");
  return binary;
}

void trimJson(Document& document) {
  Bytes& json = document.json;
  if (json.size() >= 3 && json[0] == 0xEF && json[1] == 0xBB && json[2] == 0xBF) {
    document.report.warn("", "the JSON begins with a byte order mark, which glTF forbids");
    json = json.subspan(3);
  }
  while (!json.empty() && (json.back() == 0 || json.back() == ' ' || json.back() == '\n' || json.back() == '\r')) {
    json = json.first(json.size() - 1);
  }
  if (json.empty()) refuse(document, "is empty; export it again");
  const auto isMark = [&](uint8_t a, uint8_t b) { return json.size() >= 2 && json[0] == a && json[1] == b; };
  if (isMark(0xFF, 0xFE) || isMark(0xFE, 0xFF)) refuse(document, "is UTF-16 text; glTF is UTF-8: save it so");
}

// The parser's own words without its internal prefix and without the text of the file.
std::string parseReason(const Json::exception& error) {
  std::string text = error.what();
  if (const size_t end = text.find("] "); end != std::string::npos) text = text.substr(end + 2);
  if (const size_t last = text.find("; last read"); last != std::string::npos) text = text.substr(0, last);
  return printable(text);
}

Json parse(Document& document) {
  try {
    return Json::parse(document.json.begin(), document.json.end());
  } catch (const Json::exception& error) {
    const std::string mended = mendText(document.json, document.report);
    Json root = Json::parse(mended, nullptr, false);
    const std::string other = root.is_discarded() ? otherFormat(document.json) : std::string();
    if (!other.empty()) refuse(document, other);
    if (root.is_discarded())
      refuse(document, "is neither GLB nor valid JSON: " + parseReason(error) + "; export it again");
    return root;
  }
}

void checkAsset(Document& document, const Json& asset) {
  const std::string version = asset["version"];
  if (!version.starts_with("2."))
    refuse(document, "is " + quoted(version) + "; convert the file to glTF 2.0", "/asset/version");
  const std::string minimum = asset.value("minVersion", "2.0");
  if (minimum != "2.0") {
    document.report.problem("/asset/minVersion",
                            "is " + quoted(minimum) + "; only glTF 2.0 can be read: convert the file",
                            "it is read as 2.0");
  }
}

// The data of buffer `i`, cut to the length that it declares.
std::vector<uint8_t> readBuffer(Document& document, size_t i, Json& json, std::vector<uint8_t>& binary) {
  const std::string place = "/buffers/" + std::to_string(i);
  const std::string uri = json.contains("uri") ? std::move(json["uri"].get_ref<std::string&>()) : std::string();
  const uint64_t declared = json["byteLength"];
  bool fallback = false;
  if (const auto extensions = json.find("extensions"); extensions != json.end()) {
    for (const Json& extension : *extensions) fallback = fallback || extension.value("fallback", false);
  }
  std::vector<uint8_t> data;
  if (!uri.empty()) {
    std::string reason, note;
    std::optional<std::vector<uint8_t>> read = document.files.read(uri, reason, note);
    if (!read) document.report.problem(place + "/uri", reason, "what reads it is left out");
    if (!note.empty()) document.report.problem(place + "/uri", note, "that file is read");
    if (!read) return {};
    data = std::move(*read);
    document.sourceBytes += data.size();
  } else if (i == 0 && !binary.empty() && !fallback) {
    data = std::move(binary);
  } else {
    document.bareBuffers.insert(static_cast<int>(i));  // a problem only if a view reads it
    return {};
  }
  if (declared > data.size() && declared < kMostBytes) {
    document.report.problem(place + "/byteLength",
                            "is " + std::to_string(declared) + ", but the data has " + std::to_string(data.size()) +
                                " bytes: it is truncated; export the file again",
                            "what lies beyond is left out");
  }
  if (declared < data.size()) data.resize(declared);
  if (!data.empty()) document.hash.add(data.data(), data.size());
  return data;
}

// What tinygltf would hold twice, or read at once though the picture may not need it, is taken out of the JSON.
void takeSources(Document& document, Json& root, std::vector<uint8_t>& binary,
                 std::vector<std::vector<uint8_t>>& buffers) {
  for (Json& view : root["bufferViews"]) {
    document.views.emplace_back().stride = view.value("byteStride", uint64_t(0));
    view.erase("byteStride");
  }
  for (Json& image : root["images"]) {
    ImageSource& source = document.images.emplace_back();
    source.name = image.value("name", "");
    source.view = image.value("bufferView", -1);
    if (image.contains("uri")) source.uri = std::move(image["uri"].get_ref<std::string&>());
    const std::string place = "/images/" + std::to_string(document.images.size() - 1);
    if (source.view < 0 && source.uri.empty())
      document.report.problem(place, "has neither uri nor bufferView; add one of them", "factors alone are used");
    image = {{"uri", "image"}};
  }
  for (Json& buffer : root["buffers"]) {
    buffers.push_back(readBuffer(document, buffers.size(), buffer, binary));
    // tinygltf takes no empty buffer.
    buffer = {{"uri", std::to_string(buffers.size() - 1)}, {"byteLength", std::max<size_t>(buffers.back().size(), 1)}};
  }
}

// tinygltf's way to files: it gets the buffers that were read, and no image, as those are read when they are used.
tinygltf::FsCallbacks callbacks(std::vector<std::vector<uint8_t>>& buffers) {
  tinygltf::FsCallbacks fs{};
  fs.user_data = &buffers;
  fs.FileExists = [](const std::string& name, void*) { return !name.ends_with("image"); };
  fs.ExpandFilePath = [](const std::string& name, void*) { return name; };
  fs.ReadWholeFile = [](std::vector<unsigned char>* out, std::string*, const std::string& name, void* data) {
    *out = std::move((*static_cast<std::vector<std::vector<uint8_t>>*>(data))[std::stoul(name)]);
    if (out->empty()) out->push_back(0);
    return true;
  };
  return fs;
}

// From the JSON as it is: as text, to be parsed again, large scenes would take twice as long.
void readNodes(const Json& nodes, std::vector<tinygltf::Node>& list) {
  constexpr size_t kChunk = 1024;
  list.resize(nodes.size());
  parallelChunks(list.size(), kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) parseNode(nodes[i], list[i]);
  });
}

void runTinygltf(Document& document, const std::string& text, std::vector<std::vector<uint8_t>>& buffers) {
  if (text.size() >= kMostText) refuse(document, "has more than 4 GB of JSON; split it");
  std::vector<bool> isEmpty;
  for (const auto& buffer : buffers) isEmpty.push_back(buffer.empty());
  tinygltf::TinyGLTF reader;
  reader.SetFsCallbacks(callbacks(buffers));
  reader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int,
                           void*) { return true; },
                        nullptr);
  std::string error, warning;
  if (!reader.LoadASCIIFromString(&document.model, &error, &warning, text.data(),
                                  static_cast<unsigned int>(text.size()), "")) {
    refuse(document, "cannot be read as glTF: " + printable(error) + "; export it again");
  }
  for (size_t i = 0; i < isEmpty.size(); ++i) {
    if (isEmpty[i]) document.model.buffers[i].data.clear();
  }
  const Value& variants = member(member(document.model.extensions, "KHR_materials_variants"), "variants");
  for (size_t i = 0; i < variants.ArrayLen(); ++i)
    document.variants.push_back(variants.Get(static_cast<int>(i)).Get("name").Get<std::string>());
  for (Accessor& accessor : document.model.accessors) {
    // The view that stands for none.
    if (accessor.bufferView >= static_cast<int>(document.views.size())) accessor.bufferView = -1;
  }
}

bool movesByPointer(const Json& animation) {
  const auto channels = animation.find("channels");
  return channels != animation.end() && std::any_of(channels->begin(), channels->end(), [](const Json& channel) {
           const auto target = channel.find("target");
           return target != channel.end() && target->value("path", "") == "pointer";
         });
}

// What pointers of animations may lead to.
void keepAnimatable(Document& document, const Json& root) {
  const auto animations = root.find("animations");
  if (animations == root.end() || std::none_of(animations->begin(), animations->end(), movesByPointer)) return;
  Json kept = Json::object();
  for (const char* name : {"materials", "cameras", "extensions"})
    if (root.contains(name)) kept[name] = root[name];
  document.animatable = std::make_shared<const Json>(std::move(kept));
}

}  // namespace

void Document::useView(int view) {
  if (!usage.mark("bufferViews", view)) return;
  usage.mark("buffers", model.bufferViews[static_cast<size_t>(view)].buffer);
  for (const auto& [name, extension] : model.bufferViews[static_cast<size_t>(view)].extensions)
    usage.mark("buffers", index(extension, "buffer"));
}

void Document::useAccessor(int a) {
  if (!usage.mark("accessors", a)) return;
  useView(accessor(a).bufferView);
  if (!accessor(a).sparse.isSparse) return;
  useView(accessor(a).sparse.indices.bufferView);
  useView(accessor(a).sparse.values.bufferView);
}

void readDocument(Document& document, const std::string& path) {
  document.path = path;
  document.files = Files(fs::path(path).parent_path().string(), document.options.allowExternal);
  std::string reason;
  std::optional<std::vector<uint8_t>> bytes = readFile(path, reason);
  if (!bytes) refuse(document, reason + "; check the path");
  document.sourceBytes = bytes->size();
  if (bytes->empty()) refuse(document, "is empty; export it again");
  Bytes chunk;
  document.json = *bytes;
  if (bytes->size() >= 4 && readU32(bytes->data()) == kGlbMagic) {
    document.json = {};
    chunk = splitGlb(document, *bytes);
  }
  trimJson(document);
  document.hash.add(document.json.data(), document.json.size());
  Json root = parse(document);
  if (!root.is_object()) refuse(document, "is an array or a value; it must be an object");
  checkJson(root, document.report);
  checkExtensions(document, root);
  checkAsset(document, root["asset"]);
  // The binary chunk moves to the front of the file's own bytes: large files are never held twice.
  document.json = {};
  if (chunk.data()) bytes->erase(bytes->begin(), bytes->begin() + (chunk.data() - bytes->data()));
  if (chunk.data()) bytes->resize(chunk.size());
  if (!chunk.data()) bytes->clear(), bytes->shrink_to_fit();
  std::vector<std::vector<uint8_t>> buffers;
  takeSources(document, root, *bytes, buffers);
  mendJson(root, document.report);
  keepAnimatable(document, root);
  const Json nodes = std::move(root["nodes"]);
  root.erase("nodes");
  const std::string text = root.dump();
  root = nullptr;
  runTinygltf(document, text, buffers);
  readNodes(nodes, document.model.nodes);
}

const Value& member(const tinygltf::ExtensionMap& extensions, const char* name) {
  static const Value none;
  const auto found = extensions.find(name);
  return found == extensions.end() ? none : found->second;
}

const Value& member(const Value& object, const char* name) {
  static const Value none;
  return object.IsObject() ? object.Get(name) : none;
}

double number(const Value& object, const char* name, double fallback) {
  const Value& value = member(object, name);
  return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

int index(const Value& object, const char* name) { return static_cast<int>(number(object, name, -1)); }

}  // namespace braid::gltf
