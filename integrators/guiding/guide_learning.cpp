// SPDX-License-Identifier: Apache-2.0
// From photons and records to a guide: the surfaces of a class are cut at medians until a region holds few photons;
// they give its density, and the records of paths that met it its share.
#include <algorithm>
#include <optional>

#include "integrators/guiding/guide_record.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr size_t kRegionPhotons = 256;  // a region is cut while both halves keep so many
constexpr int kDeepest = 20;
// Photons of the region that was cut off last count by so much.
constexpr float kNeighbourWeight = 0.25f;
// Values above this many times the brightness of their pixel are taken for it: one lucky path tells little.
constexpr float kMostRelative = 16;
constexpr size_t kShareRecords = 64;  // a share is learned from so many
constexpr float kUnknownShare = 0.5f;
constexpr float kIdleShare = 0.1f;  // a smaller one does not pay for asking the guide

struct Range {
  size_t begin = 0, end = 0;
  size_t size() const { return end - begin; }
};

// A leaf of the spatial tree: its photons, those of the node above it, and the leaves of every node from the class's
// root down, which lie beside each other.
struct Leaf {
  Range photons, around;
  std::vector<size_t> nodes;  // of Builder::leavesOf_, the nearest last
};

// A record as the fit of shares reads it. `energy` = value² pdf, its part of the second moment for a density of 1.
struct Trial {
  float energy, bsdfPdfW, guidePdfW;
};

// d/dc of Σ energy / pdf(c), which the share c = 0 … 1 of the guide gives the variance; rises with c.
double slope(std::span<const Trial> trials, float c) {
  double sum = 0;
  for (const Trial& t : trials) {
    const float difference = t.guidePdfW - t.bsdfPdfW, pdf = t.bsdfPdfW + c * difference;
    if (pdf > 0) sum -= static_cast<double>(t.energy * difference / (pdf * pdf));
  }
  return sum;
}

float bestShare(std::span<const Trial> trials, const ShareRange& range) {
  float low = range.least, high = range.most;
  for (int i = 0; i < 7; ++i) {
    const float middle = 0.5f * (low + high);
    (slope(trials, middle) < 0 ? low : high) = middle;
  }
  const float share = 0.5f * (low + high);
  return share < kIdleShare ? 0 : share;
}

}  // namespace

class GuideBuilder {
 public:
  GuideBuilder(std::vector<GuidePhoton> photons, const ShareRange& shares)
      : shares_(shares), photons_(std::move(photons)) {
    std::stable_sort(photons_.begin(), photons_.end(),
                     [](const GuidePhoton& a, const GuidePhoton& b) { return a.surface < b.surface; });
    Range range;
    for (uint32_t c = 0; c < kGuideClasses; ++c) {
      range.begin = range.end;
      while (range.end < photons_.size() && photons_[range.end].surface == c) ++range.end;
      if (range.size() == 0) continue;
      guide_.root_[c] = static_cast<uint32_t>(guide_.nodes_.size());
      guide_.nodes_.emplace_back();
      above_.clear();
      cut(guide_.root_[c], range, range);
    }
  }

  Guide fit(std::span<const GuideRecord> records, std::span<const float> scale) {
    sortTrials(records, scale);
    std::vector<std::optional<DirectionalTable>> tables(leaves_.size());
    std::vector<float> shares(leaves_.size());
    parallelFor(leaves_.size(), [&](size_t i) {
      shares[i] = share(leaves_[i]);
      if (shares[i] > 0) tables[i].emplace(density(leaves_[i]));
    });
    for (size_t i = 0; i < leaves_.size(); ++i) {
      guide_.regions_.push_back({static_cast<uint32_t>(guide_.tables_.size()), shares[i]});
      if (tables[i]) guide_.tables_.push_back(*tables[i]);
    }
    return std::move(guide_);
  }

 private:
  // Makes a node an inner one, or a region, of the photons in its range.
  void cut(uint32_t node, const Range& range, const Range& around) {
    Bounds bounds;
    for (size_t i = range.begin; i < range.end; ++i) bounds.extend(photons_[i].position);
    const Vec3 size = bounds.diagonal();
    const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    const size_t self = leavesOf_.size();
    leavesOf_.push_back({leaves_.size(), 0});
    above_.push_back(self);
    if (range.size() >= 2 * kRegionPhotons && above_.size() <= kDeepest && size[axis] > 0) {
      const size_t middle = halve(range, axis);
      const auto child = static_cast<uint32_t>(guide_.nodes_.size());
      guide_.nodes_.resize(child + 2);
      guide_.nodes_[node] = {photons_[middle].position[axis], static_cast<uint32_t>(axis) & 3u, child & 0x3fffffffu};
      cut(child, {range.begin, middle}, range);
      cut(child + 1, {middle, range.end}, range);
    } else {
      leaves_.push_back({range, around, above_});
      guide_.nodes_[node].index = static_cast<uint32_t>(leaves_.size()) & 0x3fffffffu;
    }
    leavesOf_[self].end = leaves_.size();
    above_.pop_back();
  }

  // Photons before the returned one do not lie above it along the axis.
  size_t halve(const Range& range, int axis) {
    const auto begin = photons_.begin() + static_cast<std::ptrdiff_t>(range.begin);
    const auto middle = begin + static_cast<std::ptrdiff_t>(range.size() / 2);
    std::nth_element(
        begin, middle, begin + static_cast<std::ptrdiff_t>(range.size()),
        [axis](const GuidePhoton& a, const GuidePhoton& b) { return a.position[axis] < b.position[axis]; });
    return static_cast<size_t>(middle - photons_.begin());
  }

  // Orders what guided paths tell by the region that they met.
  void sortTrials(std::span<const GuideRecord> records, std::span<const float> scale) {
    begin_.assign(leaves_.size() + 1, 0);
    std::vector<uint32_t> leaf(records.size());
    for (size_t i = 0; i < records.size(); ++i) {
      leaf[i] = guide_.leafOf(static_cast<int>(records[i].surface), records[i].position);
      if (records[i].guided && leaf[i] > 0) ++begin_[leaf[i]];
    }
    for (size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
    trials_.resize(begin_.back());
    std::vector<size_t> next(begin_);
    for (size_t i = 0; i < records.size(); ++i) {
      const GuideRecord& r = records[i];
      if (!r.guided || leaf[i] == 0) continue;
      const float relative = std::min(r.value * scale[r.pixel], kMostRelative);
      trials_[next[leaf[i] - 1]++] = {relative * relative * r.pdfW, r.bsdfPdfW, r.guidePdfW};
    }
  }

  std::vector<DirectionalNode> density(const Leaf& leaf) const {
    std::vector<DirectionalPoint> points;
    points.reserve(leaf.around.size());
    for (size_t i = leaf.around.begin; i < leaf.around.end; ++i) {
      const bool own = i >= leaf.photons.begin && i < leaf.photons.end;
      points.push_back({photons_[i].place, photons_[i].power * (own ? 1 : kNeighbourWeight)});
    }
    return buildDirectionalTree(points);
  }

  // Of the smallest node around the region that enough guided paths met.
  float share(const Leaf& leaf) const {
    for (size_t k = leaf.nodes.size(); k-- > 0;) {
      const Range& leaves = leavesOf_[leaf.nodes[k]];
      const size_t begin = begin_[leaves.begin], end = begin_[leaves.end];
      if (end - begin >= kShareRecords) return bestShare(std::span(trials_).subspan(begin, end - begin), shares_);
    }
    return kUnknownShare;
  }

  const ShareRange shares_;
  std::vector<GuidePhoton> photons_;
  std::vector<Leaf> leaves_;
  std::vector<Range> leavesOf_;  // by node, in the order of the cuts
  std::vector<size_t> above_;    // the nodes above the one that is being cut, and itself
  std::vector<Trial> trials_;    // those of leaf i are begin_[i] … begin_[i + 1]
  std::vector<size_t> begin_;
  Guide guide_;
};

Guide learnGuide(std::vector<GuidePhoton> photons, std::span<const GuideRecord> records, std::span<const float> scale,
                 const ShareRange& shares) {
  return GuideBuilder(std::move(photons), shares).fit(records, scale);
}

}  // namespace braid
