#include "geometry/overlap.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <numeric>
#include <stdexcept>

#include "geometry/chord.h"
#include "geometry/surface.h"
#include "geometry/tet_mesh.h"

namespace tissue_sim {
namespace {

constexpr int kLines = 48;          // along y and along z
constexpr double kTouching = 1e-3;  // cells: bodies that lie on one another do not overlap

/// The solid of a body, as it is at rest.
struct Inside {
  Box box;
  std::unique_ptr<Solid> solid;  ///< of a shape, or
  TriangleMesh mesh;
  bool is_open = false;
};

Inside inside_of(const Body& body) {
  Inside in;
  if (body.shape != Shape::kMesh) {
    in.box = bounding_box(body);
    in.solid = std::make_unique<Solid>(body);
    return in;
  }
  if (is_tet_file(body.mesh)) {
    const TetMesh tets = load_tets(body, 1, nullptr);
    in.mesh.vertices = tets.vertices;
    in.mesh.triangles = boundary(tets);
  } else {
    SurfaceKind kind;
    in.mesh = load_surface(body, kind, nullptr);
    in.is_open = !kind.is_closed();
  }
  for (const Vec3& v : in.mesh.vertices) {
    in.box.min = in.box.min.cwiseMin(v);
    in.box.max = in.box.max.cwiseMax(v);
  }
  return in;
}

std::vector<SampleLine> lines_between(double low, double high) {
  std::vector<SampleLine> lines;
  const double width = (high - low) / kLines;
  for (int i = 0; i < kLines; ++i) lines.push_back({low + (i + 0.5) * width, width, 0});
  return lines;
}

/// Where lines run within the body.
void chords_of(const Inside& in, const std::vector<SampleLine>& ys,
               const std::vector<SampleLine>& zs, std::vector<std::vector<Interval>>& chords) {
  if (in.solid == nullptr) {
    std::vector<int> all(in.mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0);
    return mesh_chords(in.mesh, all, ys, zs, chords);
  }
  chords.assign(ys.size() * zs.size(), {});
  Interval interval;
  for (std::size_t z = 0; z < zs.size(); ++z) {
    for (std::size_t y = 0; y < ys.size(); ++y) {
      if (in.solid->chord(ys[y].at, zs[z].at, interval)) {
        chords[z * ys.size() + y].push_back(interval);
      }
    }
  }
}

struct Overlap {
  double volume = 0, longest = 0;  // along x
};

Overlap overlap_of(const Inside& a, const Inside& b, const Box& both) {
  const std::vector<SampleLine> ys = lines_between(both.min.y(), both.max.y()),
                                zs = lines_between(both.min.z(), both.max.z());
  std::vector<std::vector<Interval>> of_a, of_b;
  chords_of(a, ys, zs, of_a);
  chords_of(b, ys, zs, of_b);
  Overlap sum;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    for (const Interval& s : of_a[i]) {
      for (const Interval& t : of_b[i]) {
        const double length = std::min(s.end, t.end) - std::max(s.begin, t.begin);
        if (length <= 0) continue;
        sum.volume += length * ys[0].width * zs[0].width;
        sum.longest = std::max(sum.longest, length);
      }
    }
  }
  return sum;
}

}  // namespace

std::vector<std::string> overlap_notes(const Scene& scene) {
  std::vector<std::string> notes;
  if (scene.bodies.size() < 2) return notes;
  std::vector<Inside> insides;
  for (const Body& body : scene.bodies) insides.push_back(inside_of(body));
  const double least = kTouching * scene.cell_size;
  for (std::size_t i = 0; i < insides.size(); ++i) {
    for (std::size_t j = i + 1; j < insides.size(); ++j) {
      const Inside &a = insides[i], &b = insides[j];
      Box both;
      both.min = a.box.min.cwiseMax(b.box.min);
      both.max = a.box.max.cwiseMin(b.box.max);
      const Vec3 size = both.max - both.min;
      if (a.is_open || b.is_open || !(size.minCoeff() > least)) continue;
      const Overlap overlap = overlap_of(a, b, both);
      if (!(overlap.longest > least)) continue;
      const double deep = std::min({overlap.longest, size.y(), size.z()});
      char by[96];
      std::snprintf(by, sizeof(by), "overlap by %.3g cm^3, up to %.3g mm deep",
                    1e6 * overlap.volume, 1e3 * deep);
      notes.push_back("bodies '" + scene.bodies[i].name + "' and '" + scene.bodies[j].name + "' " +
                      by + ": what lies there is there twice, move one of them");
    }
  }
  return notes;
}

}  // namespace tissue_sim
