// SPDX-License-Identifier: Apache-2.0
#include "tools/options/scene_files.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <nlohmann/json.hpp>

namespace braid {

namespace {

// Collects the strings of all members called "uri".
class UriCollector : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<std::string> uris;

  bool key(string_t& name) override {
    isUri_ = name == "uri";
    return true;
  }
  bool string(string_t& value) override {
    if (isUri_ && !value.starts_with("data:")) uris.push_back(value);
    return other();
  }
  bool null() override { return other(); }
  bool boolean(bool) override { return other(); }
  bool number_integer(number_integer_t) override { return other(); }
  bool number_unsigned(number_unsigned_t) override { return other(); }
  bool number_float(number_float_t, const string_t&) override { return other(); }
  bool binary(binary_t&) override { return other(); }
  bool start_object(std::size_t) override { return other(); }
  bool end_object() override { return other(); }
  bool start_array(std::size_t) override { return other(); }
  bool end_array() override { return other(); }
  bool parse_error(std::size_t, const std::string&, const nlohmann::json::exception&) override { return false; }

 private:
  bool other() {
    isUri_ = false;
    return true;
  }
  bool isUri_ = false;
};

// The JSON of a .gltf, or of the first chunk of a .glb.
std::string textOf(const std::string& scene) {
  std::ifstream in(scene, std::ios::binary);
  uint32_t header[5] = {};
  in.read(reinterpret_cast<char*>(header), sizeof header);
  std::error_code ignored;
  const uint64_t size = std::filesystem::file_size(scene, ignored);
  if (in && std::memcmp(header, "glTF", 4) == 0) {
    std::string text(std::min<uint64_t>(header[3], ignored ? 0 : size), '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    return text;
  }
  in.clear();
  in.seekg(0);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string percentDecoded(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto isHex = [&](size_t k) { return k < text.size() && std::isxdigit(static_cast<unsigned char>(text[k])); };
    if (text[i] == '%' && isHex(i + 1) && isHex(i + 2)) {
      out += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace

std::vector<std::string> filesOfScene(const std::string& scene) {
  std::vector<std::string> files{scene};
  UriCollector collector;
  nlohmann::json::sax_parse(textOf(scene), &collector, nlohmann::json::input_format_t::json, false);
  for (const std::string& uri : collector.uris)
    for (const std::string& name : {uri, percentDecoded(uri)})
      files.push_back((std::filesystem::path(scene).parent_path() / name).string());
  return files;
}

}  // namespace braid
