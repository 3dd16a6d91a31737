// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/plots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include "renderer/core/error.h"

extern char** environ;

namespace braid {

namespace {

// Colours that people with deficient colour vision can tell apart (Okabe and Ito 2008).
constexpr std::array<const char*, 8> kColours = {"#000000", "#0072b2", "#d55e00", "#009e73",
                                                 "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31"};

// Points and dashes of the methods after the first, second, ... eight, which have the same colours again.
constexpr std::array<const char*, 4> kMarks = {"pt 7 dt 1", "pt 5 dt 2", "pt 9 dt 4", "pt 13 dt 5"};

struct Range {
  double lo = INFINITY, hi = -INFINITY;
  void extend(double v) {
    if (!(v > 0) || !std::isfinite(v)) return;
    lo = std::min(lo, v);
    hi = std::max(hi, v);
  }
  bool empty() const { return !(lo <= hi); }
  double decades() const { return std::log10(hi / lo); }
  // A little room on both sides.
  Range padded() const {
    const double factor = std::pow(10.0, std::max(0.03, 0.05 * decades()));
    return {lo / factor, hi * factor};
  }
};

double xOf(const Plot& plot, const LadderPoint& p) { return plot.versusSeconds ? p.seconds : p.spp; }

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (char c : text) out += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return out + "'";
}

// Tics that are readable for one decade as well as for ten: 1-2-5 up to two decades, then powers of ten.
std::string decimalTics(const Range& range) {
  std::string list;
  const bool fine = range.decades() < 2;
  for (int e = static_cast<int>(std::floor(std::log10(range.lo))); e <= std::ceil(std::log10(range.hi)); ++e)
    for (double m : fine ? std::vector<double>{1, 2, 5} : std::vector<double>{1}) {
      const double v = m * std::pow(10.0, e);
      if (v >= range.lo && v <= range.hi) list += fmt::format("{}'{:.3g}' {:.6g}", list.empty() ? "" : ", ", v, v);
    }
  return "(" + list + ")";
}

std::string binaryTics(const Range& range) {
  std::string list;
  const int first = static_cast<int>(std::ceil(std::log2(range.lo))),
            last = static_cast<int>(std::floor(std::log2(range.hi)));
  const int step = std::max(1, (last - first) / 10);
  for (int e = first; e <= last; e += step)
    list += fmt::format("{}'{:.4g}' {:.6g}", list.empty() ? "" : ", ", std::exp2(e), std::exp2(e));
  return "(" + list + ")";
}

std::string dataText(const Plot& plot) {
  std::string text = "# spp seconds error low high; one block a method, in the order of the script\n";
  for (const auto& [name, curve] : plot.series) {
    text += fmt::format("# {}\n", name);
    for (const LadderPoint& p : curve)
      text += fmt::format("{:.6g} {:.6g} {:.6g} {:.6g} {:.6g}\n", p.spp, p.seconds, p.error, p.low, p.high);
    text += "\n\n";
  }
  return text;
}

// What `plot` draws: bands first, then the guide, then the lines over them.
std::string plotCommand(const Plot& plot) {
  const std::string file = quoted(plot.name + ".dat");
  const int x = plot.versusSeconds ? 2 : 1;
  std::string bands, lines, guide;
  for (size_t i = 0; i < plot.series.size(); ++i) {
    const auto& [name, curve] = plot.series[i];
    if (curve.empty()) continue;
    const char* colour = kColours[i % kColours.size()];
    const bool spread = std::any_of(curve.begin(), curve.end(), [](const LadderPoint& p) { return p.high > p.low; });
    // A block of the data file is found by its number among the blocks that are not empty.
    const auto block = std::count_if(plot.series.begin(), plot.series.begin() + static_cast<std::ptrdiff_t>(i),
                                     [](const auto& s) { return !s.second.empty(); });
    if (spread)
      bands += fmt::format(
          "  {} index {} using {}:4:5 with filledcurves fc rgb '{}' fs transparent solid 0.18 noborder "
          "notitle, \\\n",
          file, block, x, colour);
    const char* mark = kMarks[i / kColours.size() % kMarks.size()];
    lines += fmt::format("  {} index {} using {}:3 with linespoints lw 2 {} ps 0.6 lc rgb '{}' title {}, \\\n", file,
                         block, x, mark, colour, quoted(name));
    if (guide.empty() && curve.front().error > 0)
      guide = fmt::format("  {:.6g}*{:.6g}/x with lines dt 2 lw 1 lc rgb '#888888' title 'slope -1', \\\n",
                          curve.front().error, xOf(plot, curve.front()));
  }
  std::string all = bands + guide + lines;
  all.erase(all.rfind(", \\"));
  return "plot \\\n" + all + "\n";
}

// Of the SVG, in pixels: the key stands beside the curves, whatever the number and the length of its names.
struct Canvas {
  int width = 720, height = 500;
};

Canvas canvasOf(const Plot& plot) {
  size_t longest = 0;
  for (const auto& [name, curve] : plot.series) longest = std::max(longest, name.size());
  Canvas canvas;
  canvas.width = std::max(canvas.width, 580 + 8 * static_cast<int>(longest));
  canvas.height = std::max(canvas.height, 90 + 16 * static_cast<int>(plot.series.size() + 1));
  return canvas;
}

std::string scriptText(const Plot& plot, const Range& x, const Range& y) {
  std::string s = fmt::format(
      "# Run in this folder: gnuplot {}.gp\n"
      "set title {} noenhanced\nset xlabel {} noenhanced\nset ylabel {} noenhanced\n"
      "set logscale xy\nset xrange [{:.6g}:{:.6g}]\nset yrange [{:.6g}:{:.6g}]\nset xtics {}\nset ytics {}\n"
      "set grid xtics ytics lt 1 lc rgb '#dddddd'\nset key outside right top noenhanced Left reverse\n"
      "set border lc rgb '#444444'\n",
      plot.name, quoted(plot.title), quoted(plot.xLabel), quoted(plot.yLabel), x.lo, x.hi, y.lo, y.hi,
      plot.versusSeconds ? decimalTics(x) : binaryTics(x), decimalTics(y));
  const std::string command = plotCommand(plot);
  const Canvas canvas = canvasOf(plot);
  s +=
      fmt::format("set terminal svg size {},{} dynamic font 'DejaVu Sans,13' background rgb 'white'\nset output {}\n{}",
                  canvas.width, canvas.height, quoted(plot.name + ".svg"), command);
  s += fmt::format("set terminal pngcairo size {},{} font 'DejaVu Sans,14' background rgb 'white'\nset output {}\n{}",
                   canvas.width * 3 / 2, canvas.height * 3 / 2, quoted(plot.name + ".png"), command);
  return s + "set output\n";
}

}  // namespace

void writePlotFiles(const std::string& folder, const Plot& plot) {
  Range x, y;
  for (const auto& [name, curve] : plot.series)
    for (const LadderPoint& p : curve) {
      if (!(p.error > 0)) continue;
      x.extend(xOf(plot, p));
      y.extend(p.error);
      y.extend(p.low);
      y.extend(p.high);
    }
  BRAID_ASSERT(!x.empty() && !y.empty());
  writeText(folder + "/" + plot.name + ".dat", dataText(plot));
  writeText(folder + "/" + plot.name + ".gp", scriptText(plot, x.padded(), y.padded()));
}

std::string runGnuplot(const std::string& folder, const std::string& name) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  std::string program = "gnuplot", script = name + ".gp";
  char* arguments[] = {program.data(), script.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return fmt::format("gnuplot cannot be run: {}", std::strerror(failed));
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "" : fmt::format("gnuplot failed on {}/{}", folder, script);
}

}  // namespace braid
