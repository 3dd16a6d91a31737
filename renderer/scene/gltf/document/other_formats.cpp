// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/other_formats.h"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace braid::gltf {

namespace {

using namespace std::string_view_literals;

struct Beginning {
  std::string_view bytes;  // the first of the file, letters in either case
  std::string_view what;
};

constexpr std::string_view kConvert = "; open it in Blender, say, and export glTF 2.0 (.glb)";
constexpr Beginning kScenes[] = {
    {"BLENDER"sv, "is a file of Blender"},
    {"Kaydara FBX Binary"sv, "is FBX"},
    {"; FBX"sv, "is FBX"},
    {"ply\n"sv, "is PLY"},
    {"ply\r"sv, "is PLY"},
    {"solid "sv, "is STL"},
    {"#usda"sv, "is USD"},
    {"PXR-USDC"sv, "is USD"},
    {"Ogawa"sv, "is Alembic"},
    {"\x89HDF"sv, "is HDF5, such as older Alembic"},
    {"#VRML"sv, "is VRML"},
    {"MM"sv, "is 3DS"},
    {"ISO-10303-21"sv, "is STEP"},
    {"<?xml"sv, "is XML, such as COLLADA, X3D or Mitsuba scenes"},
    {"<COLLADA"sv, "is COLLADA"},
    {"<X3D"sv, "is X3D"},
    {"<scene"sv, "is a scene of Mitsuba"},
    {"v "sv, "is Wavefront OBJ"},
    {"o "sv, "is Wavefront OBJ"},
    {"mtllib "sv, "is Wavefront OBJ"},
    {"# Blender"sv, "is Wavefront OBJ or MTL"},
    {"LookAt "sv, "is a scene of pbrt"},
    {"\x28\xB5\x2F\xFD"sv, "is compressed (zstd), as files of Blender are"},
    {"#"sv, "is text with comments, such as Wavefront OBJ"},
};

constexpr std::string_view kUnpack = "; unpack it and give the .gltf or .glb in it";
constexpr Beginning kArchives[] = {
    {"PK\x03\x04"sv, "is a ZIP archive (USDZ is one, too)"},
    {"\x1F\x8B"sv, "is compressed (gzip)"},
    {"7z\xBC\xAF"sv, "is a 7z archive"},
    {"Rar!"sv, "is a RAR archive"},
};

constexpr std::string_view kLook = "; `braid info`, `combine` and `compare` read images";
constexpr Beginning kImages[] = {
    {"\x76\x2F\x31\x01"sv, "is an OpenEXR image"},
    {"\x89PNG"sv, "is a PNG image"},
    {"\xFF\xD8\xFF"sv, "is a JPEG image"},
    {"#?RADIANCE"sv, "is an HDR image"},
    {"II*\0"sv, "is a TIFF image"},
    {"MM\0*"sv, "is a TIFF image"},
    {"RIFF"sv, "is a WebP image"},
};

constexpr Beginning kNoFiles[] = {
    {"version https://git-lfs"sv, "is a pointer of Git LFS, not the file itself; fetch it: git lfs pull"},
    {"<!DOCTYPE html"sv, "is a web page, not the file itself; download that again"},
    {"<html"sv, "is a web page, not the file itself; download that again"},
};

bool beginsWith(std::span<const uint8_t> bytes, std::string_view with) {
  const auto lower = [](auto c) { return std::tolower(static_cast<unsigned char>(c)); };
  return bytes.size() >= with.size() &&
         std::equal(with.begin(), with.end(), bytes.begin(), [&](char a, uint8_t b) { return lower(a) == lower(b); });
}

std::string found(std::span<const uint8_t> bytes, std::span<const Beginning> among, std::string_view help) {
  for (const Beginning& b : among)
    if (beginsWith(bytes, b.bytes)) return std::string(b.what) + std::string(help);
  return {};
}

}  // namespace

std::string noFileAtAll(std::span<const uint8_t> bytes) { return found(bytes, kNoFiles, ""); }

bool isImage(std::span<const uint8_t> bytes) { return !found(bytes, kImages, "").empty(); }

std::string otherFormat(std::span<const uint8_t> bytes) {
  for (const std::string& text : {noFileAtAll(bytes), found(bytes, kImages, kLook), found(bytes, kScenes, kConvert),
                                  found(bytes, kArchives, kUnpack)})
    if (!text.empty()) return text;
  return {};
}

}  // namespace braid::gltf
