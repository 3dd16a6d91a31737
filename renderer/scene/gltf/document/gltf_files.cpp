// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_files.h"

#include <utf8proc.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "renderer/scene/gltf/document/gltf_report.h"
#include "renderer/scene/gltf/document/other_formats.h"

namespace braid::gltf {

namespace {

namespace fs = std::filesystem;

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

std::string lowered(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Our own, as tinygltf decodes base64 thirty times slower, only of seven media types, and takes no percent-encoding.
std::optional<std::vector<uint8_t>> readDataUri(const std::string& uri, std::string& reason) {
  const size_t comma = uri.find(',');
  if (comma == std::string::npos) {
    reason = "is a data URI without a comma; export the file again";
    return {};
  }
  if (!lowered(uri.substr(0, comma)).ends_with(";base64")) {
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

std::string withSlashes(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  return path;
}

// Whether a path stays in the folder it is relative to. Backslashes count as separators, whatever the system.
bool staysInside(const std::string& path) {
  const std::string slashes = withSlashes(path);
  if (slashes.starts_with('/')) return false;
  int depth = 0;
  for (const fs::path& part : fs::path(slashes)) {
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

// A name in one case and one Unicode form: macOS writes decomposed letters, Windows takes no heed of case.
std::string folded(const std::string& name) {
  utf8proc_uint8_t* out = nullptr;
  const auto size =
      utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(name.data()), static_cast<utf8proc_ssize_t>(name.size()),
                   &out, static_cast<utf8proc_option_t>(UTF8PROC_STABLE | UTF8PROC_COMPOSE | UTF8PROC_CASEFOLD));
  if (size < 0) return lowered(name);
  std::string text(reinterpret_cast<const char*>(out), static_cast<size_t>(size));
  std::free(out);
  return text;
}

// The one entry of each folder on the way that a part of `name` means when spelled loosely; empty: none or several.
std::string looselyNamed(const fs::path& folder, const std::string& name) {
  constexpr int kMostEntries = 100'000;
  fs::path found;
  for (const fs::path& part : fs::path(name)) {
    std::error_code error;
    if (part == "." || part == ".." || fs::exists(folder / found / part, error)) {
      found /= part;
      continue;
    }
    const std::string wanted = folded(part.string());
    fs::path match;
    int entries = 0;
    for (fs::directory_iterator it(folder.empty() && found.empty() ? fs::path(".") : folder / found, error), end;
         !error && it != end; it.increment(error)) {
      if (++entries > kMostEntries) return {};
      if (folded(it->path().filename().string()) != wanted) continue;
      if (!match.empty()) return {};
      match = it->path().filename();
    }
    if (match.empty()) return {};
    found /= match;
  }
  return found.string();
}

}  // namespace

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

bool isDataUri(const std::string& uri) { return lowered(uri.substr(0, 5)) == "data:"; }

std::optional<std::vector<uint8_t>> Files::readPath(const std::string& name, std::string& reason) const {
  const fs::path path = fs::path(folder_) / name;
  if (!external_ && !liesInside(folder_, path)) {
    reason = "is a link out of the scene's folder; copy the file there or give --allow-external";
    return {};
  }
  std::optional<std::vector<uint8_t>> data = readFile(path, reason);
  if (!data) reason += "; put it beside the scene or correct the uri";
  if (data) reason = noFileAtAll(*data);
  if (!reason.empty()) data.reset();
  return data;
}

std::optional<std::vector<uint8_t>> Files::read(const std::string& uri, std::string& reason, std::string& note) const {
  if (isDataUri(uri)) return readDataUri(uri, reason);
  std::string plain = uri;
  if (external_) {
    for (const char* local : {"file://localhost/", "file:///"}) {
      if (plain.starts_with(local)) plain = '/' + plain.substr(std::strlen(local));
    }
  }
  if (hasScheme(plain)) {
    reason = quoted(uri) + " is not relative; only files beside the scene are read: copy it there and write its name";
    return {};
  }
  const std::string decoded = percentDecoded(plain);
  if (decoded.empty() || decoded.find('\0') != std::string::npos) {
    reason = quoted(uri) + " is not a file name";
    return {};
  }
  if (!external_ && (!staysInside(decoded) || !staysInside(plain))) {
    reason =
        quoted(uri) +
        " leads out of the scene's folder; copy the file there and write a relative path, or give --allow-external";
    return {};
  }
  // The decoded name is the right one; the others are what careless exporters mean.
  std::string firstReason, other;
  for (const std::string& name : {decoded, plain, withSlashes(decoded)}) {
    if (auto data = readPath(name, firstReason.empty() ? firstReason : other)) return data;
  }
  const std::string loose = looselyNamed(folder_, withSlashes(decoded));
  if (!loose.empty()) {
    if (auto data = readPath(loose, other)) {
      note = "names " + quoted(decoded) + ", but the file is " + quoted(loose) + "; correct the uri";
      return data;
    }
  }
  reason = (firstReason.starts_with("is a link") ? "" : "file ") + quoted(decoded) + ' ' + firstReason;
  return {};
}

}  // namespace braid::gltf
