// SPDX-License-Identifier: Apache-2.0
// Image files of other programs, in several formats, and files that are refused.
#include <fstream>
#include <limits>

#include <doctest/doctest.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/core/image_values.h"
#include "tests/film/exr_files.h"

namespace braid::test_exr_reading {

using namespace test::exr_files;

TEST_CASE("PNG: exposure, sRGB, clamping, and the way back to linear") {
  const Folder folder;
  const std::string path = folder.file("a.png");
  Rgb<float> image(4, 1, 0.1f);
  image[0][1] = 7;
  image[1][1] = -1;
  image[2][1] = std::numeric_limits<float>::quiet_NaN();
  writePng(path, image, 1);
  const ImageFile f = readImage(path);
  CHECK(f.rgb()[0][0] == doctest::Approx(0.2).epsilon(0.01));
  CHECK((f.rgb()[0][1] == 1 && f.rgb()[1][1] == 0 && f.rgb()[2][1] == 0));
  for (float v : {0.0f, 0.001f, 0.0031308f, 0.2f, 1.0f})
    CHECK(decodeSrgb(encodeSrgb(v)) == doctest::Approx(v).epsilon(1e-5));
  CHECK(encodeSrgb(0.2140411f) == doctest::Approx(0.5).epsilon(1e-5));
}

TEST_CASE("other programs' files: PFM, HDR, grey, tiles, named layers") {
  const Folder folder;
  const auto write = [](const std::string& path, std::vector<std::string> names, int tile) {
    OIIO::ImageSpec spec(19, 13, static_cast<int>(names.size()), OIIO::TypeDesc::FLOAT);
    spec.channelnames = names;
    spec.tile_width = spec.tile_height = tile;
    std::vector<float> data;
    for (size_t i = 0; i < 19 * 13; ++i)
      for (size_t c = 0; c < names.size(); ++c) data.push_back(static_cast<float>(i) + 0.25f * static_cast<float>(c));
    auto out = OIIO::ImageOutput::create(path);
    REQUIRE(out);
    REQUIRE(out->open(path, spec));
    REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, data.data()));
    REQUIRE(out->close());
  };
  {
    std::ofstream pfm(folder.file("a.pfm"), std::ios::binary);  // rows from the bottom up, little-endian
    pfm << "PF\n19 13\n-1.0\n";
    for (int y = 12; y >= 0; --y)
      for (int x = 0; x < 19; ++x)
        for (int c = 0; c < 3; ++c) {
          const float v = static_cast<float>(y * 19 + x) + 0.25f * static_cast<float>(c);
          pfm.write(reinterpret_cast<const char*>(&v), 4);
        }
  }
  for (const char* name : {"a.pfm", "a.hdr", "a.exr", "a.tif"}) {
    if (std::string(name) != "a.pfm") write(folder.file(name), {"R", "G", "B"}, 0);
    const Rgb<float> image = readImage(folder.file(name)).rgb();
    CAPTURE(name);
    CHECK(image[1].at(18, 12) == doctest::Approx(246.25).epsilon(0.01));
    CHECK(image[0].at(3, 1) == doctest::Approx(22).epsilon(0.01));
  }
  write(folder.file("tiled.exr"), {"R", "G", "B"}, 16);
  CHECK(readImage(folder.file("tiled.exr")).rgb()[2].at(18, 12) == 246.5f);
  write(folder.file("grey.exr"), {"Y"}, 0);
  CHECK(readImage(folder.file("grey.exr")).rgb()[2].at(5, 0) == 5);
  write(folder.file("blender.exr"),
        {"ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B", "ViewLayer.Depth.Z"}, 0);
  const ImageFile blender = readImage(folder.file("blender.exr"));
  CHECK(blender.rgb("ViewLayer.Combined")[1].at(0, 0) == 0.25f);
  CHECK((blender.rgb("ViewLayer.Depth")[0].at(0, 0) == 0.75f && !hasLayer(blender, "pt.mean")));
  CHECK(errorOf([&] { blender.rgb(); }, ExitCode::BadInput) ==
        folder.file("blender.exr") + ": no channels R G B; its layers are ViewLayer.Combined, ViewLayer.Depth");
}

TEST_CASE("the parts of a multi-part file are merged") {
  const Folder folder;
  const std::string path = folder.file("parts.exr");
  OIIO::ImageSpec spec(3, 2, 3, OIIO::TypeDesc::FLOAT);
  OIIO::ImageSpec specs[2] = {spec, spec};
  specs[0].attribute("oiio:subimagename", "beauty");
  specs[1].attribute("oiio:subimagename", "albedo");
  auto out = OIIO::ImageOutput::create("exr");
  REQUIRE(out->open(path, 2, specs));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, std::vector<float>(18, 1).data()));
  REQUIRE(out->open(path, specs[1], OIIO::ImageOutput::AppendSubimage));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, std::vector<float>(18, 2).data()));
  REQUIRE(out->close());
  const ImageFile f = readImage(path);
  CHECK(f.rgb()[0][0] == 1);
  CHECK(f.rgb("albedo")[0][0] == 2);
}

TEST_CASE("bad files are refused in one line that names them") {
  const Folder folder;
  CHECK(errorOf([&] { readImage(folder.file("none.exr")); }, ExitCode::BadInput) ==
        folder.file("none.exr") + ": no such file");
  CHECK(errorOf([&] { readImage(folder.path.string()); }, ExitCode::BadInput).find("is a folder") != std::string::npos);
  std::ofstream(folder.file("text.exr")) << "this is not an image";
  CHECK(errorOf([&] { readImage(folder.file("text.exr")); }, ExitCode::BadInput).find(folder.file("text.exr")) == 0);
  std::ofstream(folder.file("empty.png"));
  CHECK(errorOf([&] { readImage(folder.file("empty.png")); }, ExitCode::BadInput).find("cannot be read as an image") !=
        std::string::npos);

  const Estimates all = sampleEstimates(64, 200);
  writeExr(folder.file("a.exr"), all, all.estimates[0].mean, nullptr, {});
  const std::string whole = bytesOf(folder.file("a.exr"));
  for (size_t part : {whole.size() / 10, whole.size() / 2, whole.size() - 1}) {
    std::ofstream(folder.file("cut.exr"), std::ios::binary) << whole.substr(0, part);
    CAPTURE(part);
    CHECK(errorOf([&] { readImage(folder.file("cut.exr")); }, ExitCode::BadInput).find(folder.file("cut.exr")) == 0);
  }

  // A PFM header may declare any size in a few bytes.
  std::ofstream(folder.file("huge.pfm"), std::ios::binary) << "PF\n60000 60000\n-1.0\n";
  CHECK(errorOf([&] { readImage(folder.file("huge.pfm")); }, ExitCode::BadInput) ==
        folder.file("huge.pfm") + ": 60000x60000 pixels are more than the limit of 2^28; crop or resize it");
}

}  // namespace braid::test_exr_reading
