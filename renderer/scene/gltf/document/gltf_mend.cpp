// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_mend.h"

#include <cmath>
#include <cstdlib>

#include <nlohmann/json.hpp>

namespace braid::gltf {

namespace {

using Json = nlohmann::json;

constexpr const char* kHuge = "1.7976931348623157e308";

// Length of the UTF-8 sequence that begins at `i`; 0 if there is none (RFC 3629: shortest form, no surrogates).
size_t sequenceAt(std::string_view text, size_t i) {
  const auto byte = [&](size_t k) { return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u; };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  const size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                        : lead >= 0xE0 && lead < 0xF0 ? 3
                        : lead >= 0xF0 && lead < 0xF5 ? 4
                                                      : 0;
  for (size_t k = 1; k < length; ++k) {
    if ((byte(k) & 0xC0) != 0x80) return 0;
  }
  const bool bad = (lead == 0xE0 && byte(1) < 0xA0) || (lead == 0xED && byte(1) >= 0xA0) ||
                   (lead == 0xF0 && byte(1) < 0x90) || (lead == 0xF4 && byte(1) >= 0x90);
  return bad ? 0 : length;
}

class TextMender {
 public:
  TextMender(std::string_view text, Report& report) : text_(text), report_(report) { out_.reserve(text.size() + 64); }

  std::string run() {
    while (i_ < text_.size()) {
      if (text_[i_] == '"') {
        string();
      } else if (text_[i_] == '-' || std::isalnum(static_cast<unsigned char>(text_[i_]))) {
        token();
      } else {
        out_ += text_[i_++];
      }
    }
    tell(badBytes_, "holds bytes that are not UTF-8; save the file as UTF-8", "they are replaced");
    tell(badControls_, "holds control characters or backslashes in texts; write them as \\n, \\\\ and the like",
         "they are read as meant");
    tell(badNumbers_, "holds numbers that JSON cannot have (NaN, Infinity, beyond 1e308); export the file again",
         "NaN is taken as absent, the others as the largest number");
    return std::move(out_);
  }

 private:
  void tell(uint64_t count, const char* what, const char* meanwhile) {
    if (count > 0) report_.problem("", what, meanwhile);
  }

  // No pixel depends on a name, so that one bad byte of it, from a program that writes Latin-1, must not cost the file.
  void string() {
    out_ += text_[i_++];
    while (i_ < text_.size() && text_[i_] != '"') {
      const auto c = static_cast<unsigned char>(text_[i_]);
      if (c == '\\') {
        escape();
      } else if (c < 0x20) {
        static const char* digits = "0123456789abcdef";
        out_ += std::string("\\u00") + digits[c >> 4] + digits[c & 15];
        ++badControls_;
        ++i_;
      } else if (const size_t length = sequenceAt(text_, i_); length > 0) {
        out_ += text_.substr(i_, length);
        i_ += length;
      } else {
        out_ += "\xEF\xBF\xBD";
        ++badBytes_;
        ++i_;
      }
    }
    if (i_ < text_.size()) out_ += text_[i_++];
  }

  int hexAt(size_t at) const {
    if (at + 4 > text_.size()) return -1;
    int value = 0;
    for (size_t k = at; k < at + 4; ++k) {
      if (!std::isxdigit(static_cast<unsigned char>(text_[k]))) return -1;
      value = value * 16 + std::stoi(std::string(1, text_[k]), nullptr, 16);
    }
    return value;
  }

  // A backslash that begins no escape is one of a Windows path; half a surrogate pair is a bad byte.
  void escape() {
    const char next = i_ + 1 < text_.size() ? text_[i_ + 1] : ' ';
    const int code = next == 'u' ? hexAt(i_ + 2) : -1;
    size_t length = 0;
    if (std::string_view("\"\\/bfnrt").find(next) != std::string_view::npos) length = 2;
    if (code >= 0 && (code < 0xD800 || code > 0xDFFF)) length = 6;
    if (code >= 0xD800 && code < 0xDC00 && text_.substr(i_ + 6, 2) == "\\u") {
      const int low = hexAt(i_ + 8);
      if (low >= 0xDC00 && low <= 0xDFFF) length = 12;
    }
    if (length > 0) {
      out_ += text_.substr(i_, length);
      i_ += length;
    } else if (code >= 0) {
      out_ += "\xEF\xBF\xBD";
      ++badBytes_;
      i_ += 6;
    } else {
      out_ += "\\\\";
      ++badControls_;
      ++i_;
    }
  }

  // Python writes NaN and Infinity, and numbers beyond a double stop the parser.
  void token() {
    const size_t begin = i_;
    while (i_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[i_])) || text_[i_] == '-' ||
                                 text_[i_] == '+' || text_[i_] == '.'))
      ++i_;
    const std::string token(text_.substr(begin, i_ - begin));
    const bool negative = token[0] == '-';
    const std::string word = token.substr(negative ? 1 : 0);
    const bool isNumber = !word.empty() && std::isdigit(static_cast<unsigned char>(word[0]));
    const bool isHuge =
        word == "Infinity" || word == "inf" || (isNumber && std::isinf(std::strtod(word.c_str(), nullptr)));
    const bool isNan = word == "NaN" || word == "nan";
    badNumbers_ += isHuge || isNan;
    out_ += isNan ? "null" : isHuge ? (negative ? "-" : "") + std::string(kHuge) : token;
  }

  std::string_view text_;
  Report& report_;
  std::string out_;
  size_t i_ = 0;
  uint64_t badBytes_ = 0, badControls_ = 0, badNumbers_ = 0;
};

// tinygltf has 0 for "none" where 0 is a flaw.
void dropUnlessPositive(Json& object, const char* name, const char* what, const std::string& place, Report& report) {
  if (object.value(name, 1.0) > 0) return;
  report.problem(place + '/' + name, std::string("is not positive; write ") + what, "it is taken as absent");
  object.erase(name);
}

// tinygltf refuses a file with a camera or a spot light whose own object is missing.
void mendCameras(Json& cameras, Report& report) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    Json& camera = cameras[i];
    if (camera["type"] == "")
      camera["type"] =
          camera.contains("orthographic") && !camera.contains("perspective") ? "orthographic" : "perspective";
    const std::string type = camera["type"], place = "/cameras/" + std::to_string(i) + '/' + type;
    if (camera.contains(type)) {
      dropUnlessPositive(camera[type], "aspectRatio", "width divided by height", place, report);
      continue;
    }
    report.problem(place, "is missing; describe the camera", "a usual view is used");
    camera[type] = {{"yfov", 0.8}, {"xmag", 1}, {"ymag", 1}, {"znear", 0.1}, {"zfar", 100}};
  }
}

void mendLights(Json& lights, Report& report) {
  for (size_t i = 0; i < lights.size(); ++i) {
    const std::string place = "/extensions/KHR_lights_punctual/lights/" + std::to_string(i);
    dropUnlessPositive(lights[i], "range", "a distance in metres", place, report);
    if (lights[i]["type"] != "spot" || lights[i].contains("spot")) continue;
    report.problem(place + "/spot", "is missing; describe the cone", "the usual cone is used");
    lights[i]["spot"] = Json::object();
  }
}

// A matrix rules; tinygltf would drop the others without a word.
void mendNodes(Json& nodes, Report& report) {
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!nodes[i].contains("matrix")) continue;
    const size_t others = nodes[i].erase("translation") + nodes[i].erase("rotation") + nodes[i].erase("scale");
    if (others > 0)
      report.warn("/nodes/" + std::to_string(i),
                  "a node has both a matrix and translation, rotation or scale; the matrix is used");
  }
}

// tinygltf refuses a file with indices that have no bufferView, as all have that Draco packs. They name one more view,
// which is none.
void mendIndices(Json& root) {
  const auto meshes = root.find("meshes");
  if (meshes == root.end()) return;
  Json& views = root["bufferViews"];
  if (views.is_null()) views = Json::array();
  const size_t none = views.size();
  for (Json& mesh : *meshes) {
    const auto primitives = mesh.find("primitives");
    if (primitives == mesh.end()) continue;
    for (Json& primitive : *primitives) {
      const int indices = primitive.value("indices", -1);
      if (indices < 0) continue;
      Json& accessor = root["accessors"][static_cast<size_t>(indices)];
      const int view = accessor.value("bufferView", -1);
      if (view == -2) accessor["count"] = 0;
      if (view < 0) accessor["bufferView"] = none;
    }
  }
  views.push_back({{"buffer", -1}, {"byteLength", 0}});
}

}  // namespace

std::string mendText(std::span<const uint8_t> json, Report& report) {
  return TextMender({reinterpret_cast<const char*>(json.data()), json.size()}, report).run();
}

void mendJson(Json& root, Report& report) {
  if (root.contains("cameras")) mendCameras(root["cameras"], report);
  const Json::json_pointer lights("/extensions/KHR_lights_punctual/lights");
  if (root.contains(lights)) mendLights(root[lights], report);
  if (root.contains("nodes")) mendNodes(root["nodes"], report);
  mendIndices(root);
}

}  // namespace braid::gltf
