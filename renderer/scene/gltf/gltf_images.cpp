// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/gltf_images.h"

#include <atomic>

#include "renderer/core/parallel.h"

namespace braid::gltf {

// Small files can hold huge empty pictures: bounds what all of them together may take.
class PixelBudget {
 public:
  explicit PixelBudget(uint64_t sourceBytes) : limit_(kAlways + kTimesSource * sourceBytes) {}
  bool spent() const { return used_ > limit_; }
  void add(uint64_t bytes) { used_ += bytes; }

 private:
  static constexpr uint64_t kAlways = uint64_t(8) << 30, kTimesSource = 256;
  uint64_t limit_;
  std::atomic<uint64_t> used_{0};
};

namespace {

std::shared_ptr<const Image> pixelsOf(Bytes encoded, const std::string& name, DecodedImage& out) {
  if (!isKtx2(encoded.data(), encoded.size())) return decodeImage(encoded.data(), encoded.size(), name);
  out.ktx2.emplace();
  return decodeKtx2(encoded.data(), encoded.size(), name, *out.ktx2);
}

void decodeOnce(const Document& document, const ImageSource& source, PixelBudget& budget, DecodedImage& out) {
  if (budget.spent()) {
    out.problem = "is one image too many: together they take too much memory; make them smaller";
    return;
  }
  if (source.view >= 0) {
    out.encoded = document.views[static_cast<size_t>(source.view)].data;
    if (out.encoded.empty()) return;  // reported with the view
  } else {
    if (source.uri.empty()) return;  // reported with the image
    std::optional<std::vector<uint8_t>> data = document.files.read(source.uri, out.problem, out.note);
    if (!data) return;
    out.file = std::move(*data);
    out.encoded = out.file;
  }
  const bool named = source.view < 0 && !isDataUri(source.uri);
  try {
    out.image = pixelsOf(out.encoded, named ? source.uri : source.name, out);
    budget.add(out.image->bytes.size() + out.image->floats.size() * sizeof(float));
  } catch (const Error& error) {
    // That the codecs cannot be opened is no fault of the image.
    if (error.code() != ExitCode::BadInput) throw;
    out.problem = error.what();
  }
}

}  // namespace

ImageTable::ImageTable(Document& document, const std::set<int>& textures) : document_(document) {
  document_.decoded.resize(document_.images.size());
  // Each round, the next choice of the textures that have no pixels yet.
  std::set<int> without = textures;
  PixelBudget budget(document_.sourceBytes);
  for (size_t choice = 0; !without.empty(); ++choice) {
    std::map<int, bool> wanted;  // image, and whether a texture that reads it has another
    for (auto texture = without.begin(); texture != without.end();) {
      const std::vector<int> images = imagesOf(document_.model.textures[static_cast<size_t>(*texture)]);
      if (choice >= images.size()) {
        texture = without.erase(texture);
        continue;
      }
      wanted[images[choice]] |= choice + 1 < images.size();
      ++texture;
    }
    for (const int image : decode(wanted, budget))
      report(image, wanted.at(image) ? "the texture's other image is used" : "factors alone are used");
    std::erase_if(without, [&](int texture) { return of(texture) != nullptr; });
  }
}

const DecodedImage* ImageTable::of(int texture) const {
  for (const int image : imagesOf(document_.model.textures[static_cast<size_t>(texture)]))
    if (first_.contains(key(image)) && at(image).image) return &at(image);
  return nullptr;
}

std::vector<std::shared_ptr<const Image>> ImageTable::read(const std::vector<int>& images, const char* meanwhile) {
  std::map<int, bool> wanted;
  for (const int image : images) wanted[image] = false;
  PixelBudget budget(document_.sourceBytes);
  for (const int image : decode(wanted, budget)) report(image, meanwhile);
  std::vector<std::shared_ptr<const Image>> pixels;
  for (const int image : images) pixels.push_back(at(image).image);
  return pixels;
}

ImageTable::Key ImageTable::key(int image) const {
  const ImageSource& source = document_.images[static_cast<size_t>(image)];
  return {source.uri, source.view};
}

std::vector<int> ImageTable::decode(const std::map<int, bool>& images, PixelBudget& budget) {
  std::vector<int> unique;
  for (const auto& [image, hasOther] : images) {
    document_.usage.mark("images", image);
    document_.useView(document_.images[static_cast<size_t>(image)].view);
    if (first_.emplace(key(image), image).second) unique.push_back(image);
  }
  parallelFor(unique.size(), [&](size_t i) {
    const auto image = static_cast<size_t>(unique[i]);
    DecodedImage& out = document_.decoded[image];
    if (!out.done) decodeOnce(document_, document_.images[image], budget, out);
    out.done = true;
  });
  return unique;
}

void ImageTable::report(int image, const char* meanwhile) {
  const DecodedImage& item = at(image);
  const std::string place = "/images/" + std::to_string(image);
  if (!item.problem.empty()) document_.report.problem(place, item.problem, meanwhile);
  if (!item.note.empty()) document_.report.problem(place, item.note, "that file is read");
  if (!item.image) return;
  if (item.image->format == "ktx2") document_.count(FilePart::Ktx2Images);
  if (item.image->format == "avif") document_.count(FilePart::AvifImages);
  if (item.image->limited > 0)
    document_.report.warn(place, std::to_string(item.image->limited) +
                                     " values are not finite, negative or above 1e18; they are limited");
  if (item.ktx2 && item.ktx2->isSeveral)
    document_.report.warn(place, "is a KTX2 texture of several layers, faces or frames; the first is used");
  if (document_.images[static_cast<size_t>(image)].view < 0)
    document_.hash.add(item.encoded.data(), item.encoded.size());
}

}  // namespace braid::gltf
