// SPDX-License-Identifier: Apache-2.0
// Any other denoiser, run as a command of the shell on the image and on both halves:
//
//   external-command:my_denoiser {color} {albedo} {normal} {out}
//
// In the place of {color}, {albedo} and {normal} stand files that it reads, of {out} one that it writes: EXRs of 32-bit
// floats with the channels R G B, in the units of the render; {color.pfm} and so on for PFM. They lie in a temporary
// folder. Its seconds are those of writing the files, of the command, three times, and of reading.
#include <algorithm>
#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "combiners/denoise/external/shell_command.h"
#include "combiners/pipeline/exposure.h"
#include "combiners/pipeline/invalid_pixels.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kTimeout{
    "external-command-timeout", 600, "Seconds after which an external command is ended", 0.01, 1e6, false};

// Portable float map: rows from the bottom up, little-endian.
void writePfm(const std::string& path, const Rgb<float>& image) {
  static_assert(std::endian::native == std::endian::little);
  std::ofstream out(path, std::ios::binary);
  out << fmt::format("PF\n{} {}\n-1.0\n", image.width(), image.height());
  std::vector<float> row(3 * static_cast<size_t>(image.width()));
  for (int y = image.height() - 1; y >= 0; --y) {
    for (int x = 0; x < image.width(); ++x)
      for (size_t c = 0; c < 3; ++c) row[3 * static_cast<size_t>(x) + c] = image[c].at(x, y);
    out.write(reinterpret_cast<const char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(float)));
  }
  if (!out) throw Error(ExitCode::OutputFailed, path + ": cannot be written");
}

Rgb<float> readPfm(const std::string& path, const Rgb<float>& like) {
  std::ifstream in(path, std::ios::binary);
  std::string kind;
  int width = 0, height = 0;
  double scale = 0;
  in >> kind >> width >> height >> scale;
  in.get();
  if (!in || kind != "PF" || !(scale < 0))
    throw Error(ExitCode::BadInput, "the command wrote no PFM of three little-endian channels");
  if (width != like.width() || height != like.height())
    throw Error(ExitCode::BadInput, fmt::format("the command wrote {}x{} pixels instead of {}x{}", width, height,
                                                like.width(), like.height()));
  Rgb<float> image(width, height);
  std::vector<float> row(3 * static_cast<size_t>(width));
  for (int y = height - 1; y >= 0; --y) {
    in.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(float)));
    for (int x = 0; x < width; ++x)
      for (size_t c = 0; c < 3; ++c) image[c].at(x, y) = row[3 * static_cast<size_t>(x) + c];
  }
  if (!in) throw Error(ExitCode::BadInput, "the command wrote a PFM that is cut off");
  return image;
}

void writeImage(const std::string& path, const Rgb<float>& image) {
  if (path.ends_with(".pfm")) return writePfm(path, image);
  ExrOptions exr;
  exr.floatHeadline = true;
  writeExr(path, {}, image, nullptr, exr);
}

Rgb<float> readImageLike(const std::string& path, const Rgb<float>& like) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    throw Error(ExitCode::BadInput, "the command wrote no image to the file of {out}");
  if (path.ends_with(".pfm")) return readPfm(path, like);
  const ImageFile file = readImage(path);
  if (file.width != like.width() || file.height != like.height())
    throw Error(ExitCode::BadInput, fmt::format("the command wrote {}x{} pixels instead of {}x{}", file.width,
                                                file.height, like.width(), like.height()));
  return file.rgb();
}

Rgb<float> multiplied(const Rgb<float>& image, double k) {
  Rgb<float> out = image;
  for (Plane<float>& p : out.channel)
    for (float& v : p.data) v = static_cast<float>(static_cast<double>(v) * k);
  return out;
}

constexpr const char* kEndings[] = {".exr", ".pfm"};

// "{what}" or "{what.exr}" or "{what.pfm}" in a command; npos: none of them.
size_t placeOf(const std::string& command, const std::string& what, std::string& found) {
  for (const std::string& ending : {std::string(), std::string(kEndings[0]), std::string(kEndings[1])}) {
    found = "{" + what + ending + "}";
    if (const size_t at = command.find(found); at != std::string::npos) return at;
  }
  return std::string::npos;
}

bool mentions(const std::string& command, const std::string& what) {
  std::string ignored;
  return placeOf(command, what, ignored) != std::string::npos;
}

class ExternalCommand : public ExternalMethod {
 public:
  ExternalCommand() = default;
  explicit ExternalCommand(std::string command) : command_(std::move(command)) {}

  const char* name() const override { return "external-command"; }
  const char* description() const override {
    return "Another denoiser, run by the shell: external-command:'COMMAND {color} {albedo} {normal} {out}'";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.halves = needs.variance = false;
    needs.helpful.features = wantsFeatures();
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {84, 36}; }
  std::vector<OptionInfo> options() const override { return {kTimeout}; }
  std::string skipReason() const override {
    return command_.empty() ? "needs a command: external-command:'COMMAND {color} {albedo} {normal} {out}'" : "";
  }
  std::unique_ptr<Method> with(const std::string& parameter) const override;
  MethodResult run(const MethodInputs& in) const override;

 private:
  bool wantsFeatures() const { return mentions(command_, "albedo") || mentions(command_, "normal"); }
  Rgb<float> denoised(const Rgb<float>& image, const MethodInputs& in) const;

  std::string command_;
};

std::unique_ptr<Method> ExternalCommand::with(const std::string& parameter) const {
  std::string command = parameter;
  if (command.size() >= 2 && command.front() == '\'' && command.back() == '\'')
    command = command.substr(1, command.size() - 2);
  for (const char* what : {"color", "out"})
    if (!mentions(command, what))
      throw Error(ExitCode::Usage, fmt::format("external-command:{}: it does not say where {{{}}} is: expected "
                                               "external-command:'COMMAND {{color}} {{albedo}} {{normal}} {{out}}'",
                                               parameter, what));
  if (command.find('\n') != std::string::npos)
    throw Error(ExitCode::Usage, "external-command: the command has more than one line; put it into a script");
  return std::make_unique<ExternalCommand>(std::move(command));
}

Rgb<float> ExternalCommand::denoised(const Rgb<float>& image, const MethodInputs& in) const {
  const double exposure = in.options.number(kPipelineExposure);
  const TemporaryFolder folder;
  std::string text = command_, out;
  const auto put = [&](const std::string& what, const Rgb<float>* content) {
    std::string place;
    for (size_t at = placeOf(text, what, place); at != std::string::npos; at = placeOf(text, what, place)) {
      const std::string file = folder.file(what + (place.ends_with(".pfm}") ? ".pfm" : ".exr"));
      if (content)
        writeImage(file, *content);
      else
        out = file;
      text.replace(at, place.size(), shellWord(file));
    }
  };
  if (wantsFeatures() && !in.features)
    throw Error(ExitCode::BadInput, "the command reads albedo or normal, which the inputs lack");
  put("color", &image);
  if (in.features) {
    put("albedo", &in.features->albedo.mean);
    put("normal", &in.features->normal.mean);
  }
  put("out", nullptr);
  runShellCommand(text, folder.file("log"), in.options.number(kTimeout), in.cancel);
  if (in.cancel && in.cancel->load()) return image;
  return multiplied(readImageLike(out, image), exposure);
}

MethodResult ExternalCommand::run(const MethodInputs& in) const {
  // The command sees the units of the render.
  const double exposure = in.options.number(kPipelineExposure);
  const auto filter = [&](const Rgb<float>& image) { return denoised(multiplied(image, 1 / exposure), in); };
  MethodResult result;
  Estimate& e = result.image;
  e.mean = filter(in.unbiased->mean);
  const bool halves = !in.unbiased->half[0].empty() && !in.unbiased->half[1].empty();
  if (halves && !in.meanOnly)
    for (size_t h = 0; h < 2; ++h) e.half[h] = filter(in.unbiased->half[h]);
  const auto filled = static_cast<int64_t>(fillInvalid(e));
  if (filled > 0) result.remarks.push_back(wholeAttribute("filledPixels", filled));
  result.remarks.push_back(textAttribute("command", command_));
  return result;
}

}  // namespace

std::unique_ptr<Method> make_external_command() { return std::make_unique<ExternalCommand>(); }

}  // namespace braid
