// SPDX-License-Identifier: Apache-2.0
// Files and bytes: reading a .gltf or .glb, URIs, buffers and meshopt-compressed views.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "renderer/scene/gltf_document.h"

namespace braid::gltf {

namespace {

namespace fs = std::filesystem;

std::optional<std::vector<uint8_t>> readFile(const fs::path& path, std::string& reason) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    reason = "does not exist";
    return {};
  }
  // Devices and pipes could deliver bytes for ever.
  if (!fs::is_regular_file(status)) {
    reason = "is not a regular file";
    return {};
  }
  std::ifstream stream(path, std::ios::binary);
  const uint64_t size = stream ? fs::file_size(path, error) : 0;
  if (!stream || error) {
    reason = std::string("cannot be read (") + std::strerror(errno) + ')';
    return {};
  }
  std::vector<uint8_t> bytes(size);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  bytes.resize(static_cast<size_t>(stream.gcount()));
  return bytes;
}

uint32_t readU32(const uint8_t* p) {
  return uint32_t(p[0]) | uint32_t(p[1]) << 8 | uint32_t(p[2]) << 16 | uint32_t(p[3]) << 24;
}

[[noreturn]] void refuse(const Document& document, const std::string& text) {
  throw SceneError(ExitCode::BadInput, document.path, "", text);
}

constexpr uint32_t kGlbMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

void splitGlb(Document& document) {
  const Bytes all(document.bytes);
  if (all.size() < 20)
    refuse(document, "is truncated: a GLB has at least 20 bytes, this one " + std::to_string(all.size()));
  const uint32_t version = readU32(&all[4]), length = readU32(&all[8]);
  if (version != 2) refuse(document, "is GLB version " + std::to_string(version) + "; convert it to version 2");
  if (length > all.size()) {
    refuse(document, "is truncated: its header says " + std::to_string(length) + " bytes, it has " +
                         std::to_string(all.size()) + "; copy or export it again");
  }
  if (length < all.size()) document.report.warn("", "bytes after the end of the GLB are ignored");
  bool haveJson = false, haveBinary = false;
  for (uint64_t at = 12; at + 8 <= length;) {
    const uint64_t size = readU32(&all[at]);
    const uint32_t kind = readU32(&all[at + 4]);
    if (size > length - at - 8) {
      refuse(document,
             "has a chunk at byte " + std::to_string(at) + " that runs past the end of the file; export it again");
    }
    const Bytes data = all.subspan(at + 8, size);
    if (!haveJson && kind != kJsonChunk) refuse(document, "does not begin with a JSON chunk; export it again");
    if (kind == kJsonChunk && !haveJson) {
      document.json = data;
      haveJson = true;
    } else if (kind == kBinaryChunk && !haveBinary) {
      document.binary = data;
      haveBinary = true;
    }
    at += 8 + size;
    if (at % 4 != 0) document.report.warn("", "a GLB chunk is not padded to a multiple of 4 bytes");
    // Writers that forget the padding put the next chunk right behind; those that forget it in the length align the
    // next.
    if (at % 4 != 0 && at + 8 <= length && readU32(&all[at + 4]) != kBinaryChunk) at = (at + 3) / 4 * 4;
  }
  if (!haveJson) refuse(document, "has no JSON chunk; export it again");
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
std::string parseReason(const nlohmann::json::exception& error) {
  std::string text = error.what();
  if (const size_t end = text.find("] "); end != std::string::npos) text = text.substr(end + 2);
  if (const size_t last = text.find("; last read"); last != std::string::npos) text = text.substr(0, last);
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return text;
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percentDecoded(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
    const int low = high >= 0 ? hexDigit(text[i + 2]) : -1;
    if (low >= 0) {
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

int base64Digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return -1;
}

std::optional<std::vector<uint8_t>> base64Decoded(std::string_view text) {
  std::vector<uint8_t> out;
  out.reserve(text.size() / 4 * 3 + 3);
  uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    if (c == '=') break;
    if (c == '\n' || c == '\r' || c == ' ') continue;
    const int digit = base64Digit(c);
    if (digit < 0) return {};
    bits = bits << 6 | static_cast<uint32_t>(digit);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    out.push_back(static_cast<uint8_t>(bits >> held));
  }
  return out;
}

std::optional<std::vector<uint8_t>> readDataUri(const std::string& uri, std::string& reason) {
  const size_t comma = uri.find(',');
  if (comma == std::string::npos) {
    reason = "is a data URI without a comma; export the file again";
    return {};
  }
  const std::string_view header = std::string_view(uri).substr(0, comma);
  if (!header.ends_with(";base64")) {
    const std::string text = percentDecoded(uri.substr(comma + 1));
    return std::vector<uint8_t>(text.begin(), text.end());
  }
  // Some writers percent-encode '+', '/' and '='.
  const bool escaped = uri.find('%', comma) != std::string::npos;
  const std::string plain = escaped ? percentDecoded(uri.substr(comma + 1)) : std::string();
  std::optional<std::vector<uint8_t>> data =
      base64Decoded(escaped ? std::string_view(plain) : std::string_view(uri).substr(comma + 1));
  if (!data) reason = "is a data URI whose base64 text holds other characters; export the file again";
  return data;
}

bool hasScheme(const std::string& uri) {
  const size_t colon = uri.find(':');
  if (colon == std::string::npos || colon == 0 || !std::isalpha(static_cast<unsigned char>(uri[0]))) return false;
  for (size_t i = 0; i < colon; ++i) {
    const char c = uri[i];
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '+' && c != '.' && c != '-') return false;
  }
  return true;
}

// Whether a path stays in the folder it is relative to. Backslashes count as separators, whatever the system.
bool staysInside(std::string path) {
  for (char& c : path) {
    if (c == '\\') c = '/';
  }
  if (path.starts_with('/')) return false;
  int depth = 0;
  for (const fs::path& part : fs::path(path)) {
    if (part == "..") {
      if (--depth < 0) return false;
    } else if (!part.empty() && part != ".") {
      ++depth;
    }
  }
  return true;
}

// Whether the file lies in the folder once all symbolic links are followed. What cannot be resolved is not there.
bool liesInside(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path target = error ? fs::path() : fs::canonical(file, error);
  if (error) return true;
  return std::mismatch(root.begin(), root.end(), target.begin(), target.end()).first == root.end();
}

}  // namespace

uint64_t Document::sourceBytes() const {
  uint64_t total = bytes.size();
  for (const Buffer& b : buffers) total += b.owned.size();
  return total;
}

void readContainer(Document& document, const std::string& path) {
  document.path = path;
  document.folder = fs::path(path).parent_path().string();
  std::string reason;
  std::optional<std::vector<uint8_t>> bytes = readFile(path, reason);
  if (!bytes) refuse(document, reason + "; check the path");
  document.bytes = std::move(*bytes);
  if (document.bytes.empty()) refuse(document, "is empty; export it again");
  if (document.bytes.size() >= 4 && readU32(document.bytes.data()) == kGlbMagic) {
    splitGlb(document);
  } else {
    document.json = document.bytes;
  }
  trimJson(document);
  document.hash.add(document.json.data(), document.json.size());
  try {
    document.root = std::make_shared<nlohmann::json>(nlohmann::json::parse(document.json.begin(), document.json.end()));
  } catch (const nlohmann::json::exception& error) {
    refuse(document, "is neither GLB nor valid JSON: " + parseReason(error) + "; export it again");
  }
}

std::optional<std::vector<uint8_t>> readUri(const Document& document, const std::string& uri, std::string& reason) {
  if (uri.starts_with("data:")) return readDataUri(uri, reason);
  if (hasScheme(uri)) {
    reason = quoted(uri) + " is not relative; only files beside the scene are read: copy it there and write its name";
    return {};
  }
  const std::string decoded = percentDecoded(uri);
  if (decoded.empty() || decoded.find('\0') != std::string::npos) {
    reason = quoted(uri) + " is not a file name";
    return {};
  }
  if (!staysInside(decoded) || !staysInside(uri)) {
    reason = quoted(uri) + " leads out of the scene's folder; copy the file there and write a relative path";
    return {};
  }
  std::string slashes = decoded;
  for (char& c : slashes) {
    if (c == '\\') c = '/';
  }
  // The decoded name is the right one; the others are what careless exporters mean.
  std::string firstReason;
  for (const std::string& name : {decoded, uri, slashes}) {
    if (!document.allowExternal && !liesInside(document.folder, fs::path(document.folder) / name)) {
      reason = quoted(decoded) + " is a link out of the scene's folder; copy the file there or give --allow-external";
      return {};
    }
    if (auto data = readFile(fs::path(document.folder) / name, reason)) return data;
    if (firstReason.empty()) firstReason = reason;
  }
  reason = "file " + quoted(decoded) + ' ' + firstReason + "; put it beside the scene or correct the uri";
  return {};
}

void readBuffers(Document& document) {
  const JsonRef list = JsonRef(document.root.get(), "", &document.report)["buffers"];
  for (size_t i = 0; i < document.buffers.size(); ++i) {
    Buffer& buffer = document.buffers[i];
    const JsonRef json = list.at(i);
    const uint64_t declared = json["byteLength"].whole(0);
    const std::string uri = json["uri"].text();
    if (!uri.empty()) {
      std::string reason;
      std::optional<std::vector<uint8_t>> data = readUri(document, uri, reason);
      if (!data) {
        json["uri"].problem(reason);
        continue;
      }
      buffer.owned = std::move(*data);
      buffer.data = buffer.owned;
    } else if (i == 0 && document.binary.data() && !buffer.meshoptFallback) {
      buffer.data = document.binary;
    } else {
      continue;  // a problem only if a view reads it
    }
    if (declared > buffer.data.size()) {
      json["byteLength"].problem("is " + std::to_string(declared) + ", but the data has " +
                                 std::to_string(buffer.data.size()) + " bytes: it is truncated; export the file again");
      buffer.data = {};
      continue;
    }
    buffer.data = buffer.data.first(declared);
    if (!buffer.data.empty()) document.hash.add(buffer.data.data(), buffer.data.size());
  }
}

}  // namespace braid::gltf
