#include "geometry/lattice.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "geometry/chord.h"
#include "geometry/gaps.h"
#include "geometry/thickness.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

constexpr int kLines = 4;  // sample lines per half cell along y and z
constexpr double kSmallest =
    1.0 / 32;  // share of a half cell's cube below which a point is dropped

template <class Error = std::invalid_argument>
[[noreturn]] void refuse(const Body& body, const std::string& reason) {
  throw Error("body '" + body.name + "': " + reason);
}

std::string metres(const Vec3& size) {
  char text[96];
  std::snprintf(text, sizeof(text), "%.3g x %.3g x %.3g m", size.x(), size.y(), size.z());
  return text;
}

// Half cells along one axis: where they start and how many.
struct Axis {
  double origin, half;
  int count;
};

// What is left of the last half cell is shared between both ends, so that a symmetric body is
// sampled symmetrically; `from_low` leaves all of it at the end.
Axis axis_of(double low, double high, double half, bool from_low) {
  const int count = std::max(1, static_cast<int>(std::ceil((high - low) / half - 1e-6)));
  const double slack = count * half - (high - low);
  return {from_low || slack < 2e-6 * half ? low : low - slack / 2, half, count};
}

// Strips of a quarter of a half cell, cut off at the body's box: so faces along the axes are exact.
std::vector<SampleLine> lines_of(const Axis& axis, double low, double high) {
  std::vector<SampleLine> lines;
  for (int s = 0; s < kLines * axis.count; ++s) {
    const bool last = s + 1 == kLines * axis.count;  // takes what rounding left beyond it
    const double begin = std::max(low, axis.origin + s * axis.half / kLines);
    const double end = last ? high : std::min(high, axis.origin + (s + 1) * axis.half / kLines);
    if (end - begin <= 1e-9 * axis.half) continue;
    lines.push_back({(begin + end) / 2, end - begin, s / kLines});
  }
  return lines;
}

// Volumes of the half cells of a row: those from first to last, the others are 0. A body that lies
// diagonally in its box has few.
struct HalfCellRow {
  std::vector<double> all;
  int first, last;

  explicit HalfCellRow(int count) : all(count, 0.0), first(count), last(-1) {}
  double& operator[](int i) { return all[i]; }
  void clear() {
    for (int i = first; i <= last; ++i) all[i] = 0;
    first = static_cast<int>(all.size());
    last = -1;
  }
};

// Adds area times length of the interval to the half cells along x that it covers.
void deposit(const Axis& axis, const Interval& interval, double area, HalfCellRow& volumes) {
  const double begin = (interval.begin - axis.origin) / axis.half;
  const double end = (interval.end - axis.origin) / axis.half;
  const int first = std::max(0, std::min(axis.count - 1, static_cast<int>(std::floor(begin))));
  const int last = std::max(first, std::min(axis.count - 1, static_cast<int>(std::floor(end))));
  const double unit = area * axis.half;
  volumes.first = std::min(volumes.first, first);
  volumes.last = std::max(volumes.last, last);
  if (first == last) {
    volumes[first] += unit * (end - begin);
    return;
  }
  volumes[first] += unit * (first + 1 - begin);
  for (int i = first + 1; i < last; ++i) volumes[i] += unit;
  volumes[last] += unit * (end - last);
}

struct Slab {
  std::vector<SampleLine> lines;  ///< along z
  std::vector<int> triangles;     ///< that reach into it
  std::vector<Lattice::Site> sites;
  double volume = 0, dropped = 0;
};

struct Sampling {
  Axis x, y, z;
  std::vector<SampleLine> y_lines;
  const Solid* solid;        ///< or
  const TriangleMesh* mesh;  ///< the body's surface
  WorkLimits limits;
};

// Calls add(interval, area) for each interval on lines [first, last) along y of the slab.
template <class Add>
void for_each_interval(const Sampling& s, const Slab& slab, std::size_t first, std::size_t last,
                       const std::vector<std::vector<Interval>>& chords, Add add) {
  Interval interval;
  for (std::size_t iz = 0; iz < slab.lines.size(); ++iz) {
    for (std::size_t iy = first; iy < last; ++iy) {
      const double area = s.y_lines[iy].width * slab.lines[iz].width;
      if (s.solid) {
        if (s.solid->chord(s.y_lines[iy].at, slab.lines[iz].at, interval)) add(interval, area);
      } else {
        for (const Interval& i : chords[iz * s.y_lines.size() + iy]) add(i, area);
      }
    }
  }
}

// Fills a slab's sites, row by row.
void fill(const Sampling& s, int k, Slab& slab) {
  if (slab.lines.empty() || (s.mesh && slab.triangles.empty())) return;
  std::vector<std::vector<Interval>> chords;
  if (s.mesh) mesh_chords(*s.mesh, slab.triangles, s.y_lines, slab.lines, chords);
  const double cube = s.x.half * s.x.half * s.x.half;
  HalfCellRow volumes(s.x.count);
  for (std::size_t first = 0, last = 0; first < s.y_lines.size(); first = last) {
    stop_if_asked(s.limits);
    const int j = s.y_lines[first].row;
    while (last < s.y_lines.size() && s.y_lines[last].row == j) ++last;
    volumes.clear();
    for_each_interval(s, slab, first, last, chords, [&](const Interval& interval, double area) {
      deposit(s.x, interval, area, volumes);
    });
    for (int i = volumes.first; i <= volumes.last; ++i) {
      if (volumes[i] <= 0) continue;
      slab.volume += volumes[i];
      if (volumes[i] < kSmallest * cube) {
        slab.dropped += volumes[i];
      } else {
        slab.sites.push_back({i, j, k, static_cast<float>(volumes[i])});
      }
    }
  }
}

void bin_triangles(const TriangleMesh& mesh, const Axis& z, std::vector<Slab>& slabs) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    double low = 1e300, high = -1e300;
    for (int v : mesh.triangles[t]) {
      low = std::min(low, mesh.vertices[v].z());
      high = std::max(high, mesh.vertices[v].z());
    }
    const int first = std::max(0, static_cast<int>((low - z.origin) / z.half) - 1);
    const int last = std::min(z.count - 1, static_cast<int>((high - z.origin) / z.half) + 1);
    for (int k = first; k <= last; ++k) slabs[k].triangles.push_back(static_cast<int>(t));
  }
}

Box box_of(const TriangleMesh& mesh) {
  Box box;
  for (const auto& t : mesh.triangles) {  // vertices that no triangle uses do not count
    for (int v : t) {
      box.min = box.min.cwiseMin(mesh.vertices[v]);
      box.max = box.max.cwiseMax(mesh.vertices[v]);
    }
  }
  return box;
}

}  // namespace

Lattice make_lattice(const Body& body, double cell_size, std::vector<std::string>* notes,
                     std::int64_t max_points) {
  const double half = cell_size / 2;
  const bool is_mesh = is_meshed(body);
  // Where a mesh is in another unit, no cell size is the answer.
  const auto hint_of = [&](const Vec3& size) {
    const std::string hint = is_mesh ? scale_hint(size.maxCoeff(), body.scale) : "";
    return hint.empty() ? hint : hint + " Else ";
  };
  const auto too_many_of = [&](const Vec3& size) {
    return "it takes more than " + std::to_string(max_points) + " points at cell_size " +
           text(cell_size) + " m (it measures " + metres(size) + "): " + hint_of(size) +
           "raise cell_size";
  };
  // Before a mesh is checked and repaired, which may take a minute: its volume is right unless it
  // is broken, and then it is not four times too large.
  const auto look = [&](const TriangleMesh& raw) {
    const double volume = std::abs(signed_volume(raw)) / (half * half * half);
    if (volume < 4 * static_cast<double>(max_points)) return;
    const Box box = box_of(raw);
    throw TooLarge(too_many_of(box.max - box.min));
  };
  const TriangleMesh mesh = is_mesh ? load_solid(body, notes, look) : TriangleMesh();
  const Solid solid(body);
  const Box box = is_mesh ? box_of(mesh) : bounding_box(body);
  const Vec3 size = box.max - box.min;
  const std::string hint = hint_of(size), too_many = too_many_of(size);
  const double volume = is_mesh ? signed_volume(mesh) : exact_volume(body);
  if (max_points <= 0 || volume / (half * half * half) > 1.01 * static_cast<double>(max_points)) {
    refuse<TooLarge>(body, too_many);
  }

  const bool upright =
      body.shape == Shape::kBox && std::abs(body.pose.orientation.normalized().w()) > 1 - 1e-12;
  Sampling sampling;
  sampling.x = axis_of(box.min.x(), box.max.x(), half, upright);
  sampling.y = axis_of(box.min.y(), box.max.y(), half, upright);
  sampling.z = axis_of(box.min.z(), box.max.z(), half, upright);
  // Thirty seconds of two cores; what lies along an axis takes a thousandth of it.
  constexpr double kMostLines = 1e9;
  if (static_cast<double>(sampling.y.count) * sampling.z.count * kLines * kLines > kMostLines) {
    refuse(body, "its box measures " + metres(size) + ", too much for cell_size " +
                     text(cell_size) + " m: raise cell_size, or turn it so that it lies along x");
  }
  sampling.limits = work_limits();
  sampling.y_lines = lines_of(sampling.y, box.min.y(), box.max.y());
  sampling.solid = is_mesh ? nullptr : &solid;
  sampling.mesh = is_mesh ? &mesh : nullptr;

  std::vector<Slab> slabs(sampling.z.count);
  for (const SampleLine& line : lines_of(sampling.z, box.min.z(), box.max.z())) {
    slabs[line.row].lines.push_back(line);
  }
  if (is_mesh) bin_triangles(mesh, sampling.z, slabs);

  // Slabs are independent of each other and joined in order: the same bits for any thread count.
  std::atomic<std::int64_t> points{0};
  try {
    tbb::parallel_for(tbb::blocked_range<int>(0, sampling.z.count),
                      [&](const tbb::blocked_range<int>& range) {
                        for (int k = range.begin(); k != range.end(); ++k) {
                          fill(sampling, k, slabs[k]);
                          points += static_cast<std::int64_t>(slabs[k].sites.size());
                          if (points > max_points) throw TooLarge(too_many);
                        }
                      });
  } catch (const TooLarge& e) {
    refuse<TooLarge>(body, e.what());
  } catch (const std::invalid_argument& e) {
    refuse(body, "mesh " + body.mesh + " " + e.what());
  }

  Lattice lattice;
  lattice.origin = Vec3(sampling.x.origin, sampling.y.origin, sampling.z.origin);
  lattice.cell_size = cell_size;
  lattice.nx = (sampling.x.count + 1) / 2;
  lattice.ny = (sampling.y.count + 1) / 2;
  lattice.nz = (sampling.z.count + 1) / 2;
  lattice.sites.reserve(static_cast<std::size_t>(points.load()));
  double total = 0, dropped = 0;
  for (Slab& slab : slabs) {
    lattice.sites.insert(lattice.sites.end(), slab.sites.begin(), slab.sites.end());
    std::vector<Lattice::Site>().swap(slab.sites);
    total += slab.volume;
    dropped += slab.dropped;
  }
  if (lattice.sites.empty()) {
    refuse(body, "no points at cell_size " + text(cell_size) + " m (it measures " + metres(size) +
                     "): " + hint + "lower cell_size");
  }
  if (dropped > 0) {
    const float share = static_cast<float>(total / (total - dropped));
    for (Lattice::Site& site : lattice.sites) site.volume *= share;
  }
  if (is_mesh) find_gaps(mesh, lattice);
  const std::string thin = notes ? thickness_note(lattice) : "";
  if (!thin.empty()) notes->push_back("body '" + body.name + "': " + thin);
  return lattice;
}

}  // namespace tissue_sim
