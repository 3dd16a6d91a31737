// SPDX-License-Identifier: Apache-2.0
// Nothing is lost and nothing is replaced that should not be: outputs over inputs, checkpoints, endings, devices, links
// and streams, as the users of the program meet them.
#include <csignal>
#include <cstring>

#include <doctest/doctest.h>
#include <sys/stat.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/picture.h"
#include "renderer/core/image_values.h"
#include "renderer/film/files/state_file.h"
#include "tests/support/running_braid.h"
#include "tools/options/file_uses.h"

namespace braid::test_output_files {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::kCornellFile;
using test::plainly;
using test::readText;
using test::Run;
namespace fs = std::filesystem;

namespace {

const std::string kSmall = " -q --size 16x12 --spp 4 ";

std::string cornell(const std::string& rest) { return "render '" + kCornellFile + "'" + kSmall + rest; }

// scene.gltf and its buffer.
void writeScene(const Folder& folder) {
  test::GltfFile file = test::quadFile();
  file.root["buffers"] = {{{"uri", "buffer%20one.bin"}, {"byteLength", file.binary.size()}}};
  folder.write("scene.gltf", file.root.dump());
  folder.write("buffer one.bin", file.binary);
}

struct Refusal {
  const Folder& folder;
  // Exit code 1 in one line that holds the parts; no file changes.
  void operator()(const std::string& command, const std::vector<std::string>& parts) const {
    std::map<std::string, std::string> before;
    for (const auto& e : fs::directory_iterator(folder.path))
      if (e.is_regular_file() && !e.path().filename().string().starts_with("std"))
        before[e.path()] = readText(e.path());
    const Run run = braidRun(folder, command);
    INFO(command, ": ", run.err);
    CHECK(run.code == 1);
    CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
    for (const std::string& part : parts) CHECK_MESSAGE(contains(run.err, part), part);
    for (const auto& [path, bytes] : before) CHECK_MESSAGE((readText(path) == bytes), path);
  }
};

}  // namespace

TEST_CASE("No output is an input or another output, by any name") {
  const Folder folder;
  writeScene(folder);
  const Refusal refused{folder};
  const std::string render = "render scene.gltf -q --size 8x6 --spp 1 ";
  REQUIRE(braidRun(folder, render + "-o good.exr").code == 0);
  fs::create_symlink("scene.gltf", folder.path / "link.exr");
  fs::create_hard_link(folder.path / "buffer one.bin", folder.path / "hard.png");
  fs::create_symlink(folder.path / "nowhere.exr", folder.path / "dangling.exr");
  fs::copy_file(folder.path / "good.exr", folder.path / "sky.exr");
  const std::string scene = "is the scene, scene.gltf, which would be lost";
  refused(render + "-o out.exr --checkpoint scene.gltf", {"--checkpoint scene.gltf: ", scene});
  refused(render + "-o out.exr --log-json ./scene.gltf", {"--log-json ./scene.gltf: ", scene});
  refused(render + "-o link.exr", {"--output link.exr: ", scene});
  refused(render + "-o out.exr --png hard.png", {"--png hard.png: is a file of the scene, buffer one.bin"});
  refused(render + "-o sky.exr --env sky.exr", {"--output sky.exr: is the environment, sky.exr"});
  refused(render + "-o same.png --png ./same.png", {"--png ./same.png: is --output, same.png"});
  refused(render + "-o dangling.exr --log-json nowhere.exr", {"--log-json nowhere.exr: is --output, dangling.exr"});
  refused(render + "-o - --log-json -", {"--log-json standard output: is --output, standard output"});
  refused(render + "-o good.exr --combine external:good.exr", {"--output good.exr: is an image of external:"});
  refused("preview scene.gltf --spp 1 -o link.exr", {scene});
  refused("replay scene.gltf --integrator bdpt --strategies link.exr", {scene});
  refused("combine --unbiased good.exr --method box -o ./good.exr", {"is an input of --unbiased, good.exr"});
  refused("combine --unbiased sky.exr:pt --biased good.exr --method js -o o.exr --png sky.exr",
          {"--png sky.exr: is an input of --unbiased"});
  REQUIRE(braidRun(folder, render + "--checkpoint a.state").code == 0);
  refused("merge a.state -o a.exr --checkpoint a.state", {"--checkpoint a.state: is a share, a.state"});
  fs::create_directories(folder.path / "swept" / "images");
  fs::copy_file(folder.path / "good.exr", folder.path / "swept" / "images" / "r.exr");
  refused("sweep scene.gltf -o swept --reference swept/images/r.exr", {"the sweep writes into swept/images"});
  fs::copy_file(folder.path / "scene.gltf", folder.path / "swept" / "sweep.json");
  fs::copy_file(folder.path / "buffer one.bin", folder.path / "swept" / "buffer one.bin");
  refused("sweep swept/sweep.json -o swept", {"-o swept/sweep.json: is the scene"});
  CHECK(braidRun(folder, render + "-o /dev/null --png /dev/null").code == 0);
  CHECK(isSameFile("/dev/stdout", "-"));
  CHECK_FALSE(isSameFile("", "a"));
}

TEST_CASE("A checkpoint is not begun anew by accident") {
  const Folder folder;
  REQUIRE(braidRun(folder, cornell("--checkpoint a.state")).code == 0);
  const Refusal refused{folder};
  refused(cornell("--checkpoint a.state"),
          {"--checkpoint a.state: holds 4 samples already", "--resume", "--overwrite"});
  refused(cornell("--checkpoint a.state -o a.exr"), {"holds 4 samples"});
  folder.write("text.state", "no state at all");
  refused(cornell("--checkpoint text.state"), {"text.state: is there already", "--overwrite"});
  REQUIRE(braidRun(folder, cornell("--checkpoint b.state --seed 2")).code == 0);
  refused(cornell("--checkpoint b.state --resume a.state"), {"b.state: holds 4 samples"});
  CHECK(braidRun(folder, cornell("--checkpoint a.state --resume --spp 6")).code == 1);  // twice --spp
  CHECK(braidRun(folder, "render '" + kCornellFile + "' -q --size 16x12 --spp 6 --checkpoint a.state --resume").code ==
        0);
  CHECK(readStateFile(folder.path / "a.state").rounds() == 6);
  CHECK(braidRun(folder, cornell("--checkpoint a.state --overwrite")).code == 0);
  CHECK(readStateFile(folder.path / "a.state").rounds() == 4);
}

TEST_CASE("The ending decides the format") {
  const Folder folder;
  const auto bytes = [&](const std::string& name) { return readText(folder.path / name); };
  const std::string plain = " --integrator pt --combine none --aovs all --float --tone none --exposure 0";
  REQUIRE(braidRun(folder, cornell("-o o.exr" + plain)).code == 0);
  const Rgb<float> image = readImage(folder.path / "o.exr").rgb();
  for (const char* name : {"o.png", "o.PNG", "o.jpg", "o.jpeg", "o.hdr", "o.tif", "o.tiff", "o.EXR"}) {
    CAPTURE(std::string(name));
    const Run run = braidRun(folder, cornell("-o " + std::string(name) + plain));
    INFO(run.err);
    REQUIRE(run.code == 0);
    const ImageFile file = readImage(folder.path / name);
    CHECK(file.width == 16);
    const std::string ending = fs::path(name).extension();
    const bool linear = ending == ".hdr" || ending == ".tif" || ending == ".tiff" || ending == ".EXR";
    const Rgb<float> read = file.rgb();
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < image.size(); ++i) {
        if (linear)
          CHECK(std::fabs(read[c][i] - image[c][i]) <=
                (ending == ".hdr" ? 0.01f : 0.0f) * std::fabs(image[c][i]) + 0.01f * (ending == ".hdr"));
        else if (ending != ".jpg" && ending != ".jpeg")
          CHECK(std::fabs(encodeSrgb(read[c][i]) - encodeSrgb(std::min(1.0f, image[c][i]))) < 0.5f / 255 + 1e-4f);
      }
  }
  CHECK(bytes("o.png").substr(1, 3) == "PNG");
  CHECK(bytes("o.png") == bytes("o.PNG"));
  CHECK((bytes("o.jpg").substr(0, 2) == "\xff\xd8"));
  CHECK(bytes("o.hdr").substr(0, 2) == "#?");
  CHECK(bytes("o.tif").substr(0, 2) == "II");
  const Refusal refused{folder};
  const std::string known = "known are .exr, .png, .jpg, .jpeg, .hdr, .tif, .tiff";
  for (const char* command : {"render", "preview"})
    for (const char* name : {"o.bmp", "o", "o.exr.bak", "o.", "png"})
      refused(command + (" '" + kCornellFile) + "'" + kSmall + "-o " + name, {known});
  refused(cornell("--png o.jpg"), {"--png o.jpg: writes PNG"});
  refused("combine --unbiased o.exr --method box -o b.gif", {known});
  refused("plan '" + kCornellFile + "' -o o.gif", {known});
  refused("replay '" + kCornellFile + "' --integrator bdpt --spp 1 --size 8x6 --strategies s.png",
          {"only EXR has layers"});
  REQUIRE(braidRun(folder, cornell("--checkpoint m.state" + plain)).code == 0);
  refused("merge m.state -o m.webp", {known});
  CHECK(braidRun(folder, "merge m.state -q --tone none --exposure 0 -o m.png").code == 0);
  CHECK(bytes("m.png") == bytes("o.png"));
  CHECK(braidRun(folder, "combine -q --unbiased o.exr --method box -o b.jpg").code == 0);
  CHECK(readImage(folder.path / "b.jpg").width == 16);
}

TEST_CASE("Standard output, devices and FIFOs are written through, and links stay links") {
  const Folder folder;
  const std::string plain = cornell("--integrator pt --combine none --aovs all --reproducible ");
  REQUIRE(braidRun(folder, plain + "-o file.exr").code == 0);
  const std::string image = readText(folder.path / "file.exr");
  for (const char* to : {"-", "/dev/stdout"}) {
    const Run run = braidRun(folder, plain + "-o " + to);
    CHECK(run.code == 0);
    CHECK((run.out == image));
  }
  const std::string untilTarget =
      "render '" + kCornellFile + "' -q --size 16x12 --integrator pt --combine none --error 1e6 ";
  CHECK(braidRun(folder, untilTarget + "-o -").out.substr(0, 4) == "\x76\x2f\x31\x01");
  Run run = braidRun(folder, plain + "-o - | cat >piped.exr; true");
  CHECK((readText(folder.path / "piped.exr") == image));
  run = braidRun(folder, "preview '" + kCornellFile + "' --http 0 --size 16x12 --spp 4 -o -");
  CHECK(run.code == 0);
  CHECK(run.out.substr(0, 4) == "\x76\x2f\x31\x01");

  REQUIRE(::mkfifo((folder.path / "pipe").c_str(), 0600) == 0);
  run = braidRun(folder, plain + "-o pipe", "{ cat pipe >fifo.exr & } 2>/dev/null; ");
  CHECK(run.code == 0);
  CHECK(test::waitUntil([&] { return readText(folder.path / "fifo.exr").size() == image.size(); }));
  CHECK((readText(folder.path / "fifo.exr") == image));
  CHECK(fs::is_fifo(folder.path / "pipe"));
  CHECK(braidRun(folder, plain + "-o /dev/null").code == 0);
  CHECK(fs::is_character_file("/dev/null"));
  run = braidRun(folder, plain + "-o /dev/full");
  CHECK(run.code == 3);
  CHECK(contains(run.err, "/dev/full: cannot be written: No space left on device"));

  fs::create_directory(folder.path / "elsewhere");
  folder.write("elsewhere/target.exr", "old");
  fs::create_symlink("elsewhere/target.exr", folder.path / "link.exr");
  fs::create_symlink("elsewhere/new.exr", folder.path / "dangling.exr");
  for (const auto& [link, target] : {std::pair("link.exr", "target.exr"), {"dangling.exr", "new.exr"}}) {
    CHECK(braidRun(folder, plain + "-o " + link).code == 0);
    CHECK(fs::is_symlink(folder.path / link));
    CHECK((readText(folder.path / "elsewhere" / target) == image));
  }
}

TEST_CASE("Results that cannot be printed are exit code 3, messages that cannot be are not missed") {
  const Folder folder;
  REQUIRE(braidRun(folder, cornell("-o a.exr")).code == 0);
  const std::string scene = " '" + kCornellFile + "'";
  for (const std::string& command :
       {"info" + scene, "info --json" + scene, "plan" + scene, "plan --json" + scene, std::string("--list"),
        std::string("--version"), std::string("-h"), std::string("render -h"),
        std::string("compare a.exr a.exr --json"), std::string("compare a.exr a.exr"),
        "replay" + scene + " --size 8x6 --pixel 1,1", "render" + scene + kSmall + "-o b.exr --log-json -"})
    for (const char* to : {" >/dev/full", " >&-"}) {
      // braidRun() redirects both; a group of its own comes first.
      const Run run = braidRun(folder, "--version >/dev/null; { '" BRAID_BINARY "' " + command + to + "; }");
      INFO(command, to, ": ", run.err);
      CHECK(run.code == 3);
      CHECK(contains(run.err, "standard output: cannot be written"));
    }
  for (const char* to : {" 2>/dev/full", " 2>&-", " >&- 2>&- <&-"}) {
    INFO(to);
    const Run run = braidRun(folder, "--version >/dev/null; { '" BRAID_BINARY "' render" + scene +
                                         " --size 16x12 --spp 4 -o quiet.exr" + to + "; }");
    CHECK(run.code == 0);
    CHECK(readImage(folder.path / "quiet.exr").width == 16);
    fs::remove(folder.path / "quiet.exr");
  }
  // Nobody reads what the render says.
  const Run run = braidRun(folder, "--version >/dev/null; { { '" BRAID_BINARY "' render" + scene +
                                       " -v --size 16x12 --spp 4 -o pipe.exr; echo $? >code; } 2>&1 | true; }");
  CHECK(readText(folder.path / "code") == "0\n");
  CHECK(readImage(folder.path / "pipe.exr").width == 16);
}

TEST_CASE("A hung-up terminal saves and ends a render, unless it was told to go on") {
  const Folder folder;
  const fs::path log = folder.path / "log";
  {
    test::Process process({"--size", "16x12", "--time", "60", "-o", folder.path / "h.exr", "--log-json", log});
    REQUIRE(test::waitUntil([&] { return contains(readText(log), "\"progress\""); }));
    process.signal(SIGHUP);
    CHECK(process.wait() == 130);
    CHECK(readImage(folder.path / "h.exr").width == 16);
  }
  fs::remove(log);
  struct sigaction ignore = {}, before = {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGHUP, &ignore, &before);  // inherited, as from nohup
  {
    test::Process process({"--size", "16x12", "--time", "1", "-o", folder.path / "n.exr", "--log-json", log});
    sigaction(SIGHUP, &before, nullptr);
    REQUIRE(test::waitUntil([&] { return contains(readText(log), "\"progress\""); }));
    for (const int number : {SIGHUP, SIGPIPE, SIGXFSZ}) process.signal(number);
    CHECK(process.wait() == 0);
    CHECK(test::records(log).back()["reason"] == "time");
  }
}

TEST_CASE("Files of 8 bits have colours that alpha is not multiplied into") {
  Rgb<float> image(2, 1, 0.1f);
  Plane<float> alpha(2, 1, 0.5f);
  image[0][1] = image[1][1] = image[2][1] = alpha[1] = 0;
  const std::vector<uint8_t> bytes = toneMapped(image, &alpha, {});
  const auto fifth = static_cast<uint8_t>(encodeSrgb(0.2f) * 255 + 0.5f);
  CHECK(bytes == std::vector<uint8_t>{fifth, fifth, fifth, 128, 0, 0, 0, 0});

  const Folder folder;
  test::GltfFile file = test::quadFile();
  test::giveMaterial(
      file,
      {{"alphaMode", "BLEND"}, {"doubleSided", true}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.4}}}}});
  folder.write("quad.glb", file.glb());
  const std::string render =
      "render quad.glb -q --size 24x16 --spp 64 --transparent --look-at 0.5,0.5,2,0.5,0.5,0 --yfov 60 --integrator pt "
      "--combine none --float --tone none --exposure 0 ";
  for (const char* name : {"o.exr", "o.png", "o.tif"}) REQUIRE(braidRun(folder, render + "-o " + name).code == 0);
  REQUIRE(braidRun(folder, render + "-o p.exr --png p.png").code == 0);
  CHECK((readText(folder.path / "p.png") == readText(folder.path / "o.png")));
  const ImageFile exr = readImage(folder.path / "o.exr");
  const float a = exr.planes.at("A").at(12, 8), r = exr.planes.at("R").at(12, 8);
  REQUIRE(a > 0.1f);
  // Read back, all are premultiplied again.
  for (const auto& [name, tolerance] : {std::pair("o.png", 0.01f), {"o.tif", 1e-6f}}) {
    const ImageFile other = readImage(folder.path / name);
    CAPTURE(std::string(name));
    REQUIRE(other.planes.count("A") == 1);
    CHECK(std::fabs(other.planes.at("A").at(12, 8) - a) < tolerance);
    CHECK(std::fabs(other.planes.at("R").at(12, 8) - r) < tolerance);
    CHECK(other.planes.at("A").at(0, 0) == 0);
  }
}

TEST_CASE("A crop is compared with its full frame in the window that both hold") {
  const Folder folder;
  const auto render = [&](const std::string& rest) {
    const Run run = braidRun(folder, plainly("render '" + kCornellFile + "' -q --size 24x16 --spp 4 --float " + rest));
    INFO(run.err);
    REQUIRE(run.code == 0);
  };
  render("-o full.exr");
  render("-o crop.exr --crop 3,5,14,9");
  render("-o other.exr --crop 10,0,24,7");
  render("-o apart.exr --crop 20,10,24,16");
  for (const char* pair : {"crop.exr full.exr", "full.exr crop.exr"}) {
    const Run run = braidRun(folder, std::string("compare --json --max 0 --metric MSE ") + pair);
    CHECK(run.code == 0);
    CHECK(contains(run.err, "window 3,5,14,9"));
    const Json json = Json::parse(run.out);
    CHECK(json["metrics"]["MSE"] == 0);
    CHECK(json["window"] == Json::array({3, 5, 14, 9}));
    CHECK(json["width"] == 11);
    CHECK(json["height"] == 4);
  }
  const Run two = braidRun(folder, "compare crop.exr other.exr --metric MSE --max 0");
  CHECK(two.code == 0);
  CHECK(contains(two.err, "window 10,5,14,7"));
  const Run apart = braidRun(folder, "compare crop.exr apart.exr");
  CHECK(apart.code == 2);
  CHECK(contains(apart.err, "share no pixel of the 24x16 frame"));
  const Run same = braidRun(folder, "compare crop.exr crop.exr --json");
  CHECK(same.err.empty());
  CHECK_FALSE(Json::parse(same.out).contains("window"));
}

}  // namespace braid::test_output_files
