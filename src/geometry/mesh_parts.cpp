#include "geometry/mesh_parts.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "geometry/mesh_edges.h"
#include "geometry/ray_tree.h"
#include "math/union_find.h"

namespace tissue_sim {
namespace {

struct Part {
  std::vector<int> triangles;
  double volume = 0;  ///< signed
  double area = 0;
  Box box;
};

// Parts are connected across edges; largest box first, so that what contains comes first.
std::vector<Part> parts_of(const TriangleMesh& mesh) {
  std::vector<int> root(mesh.triangles.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int t) {
    while (root[t] != t) t = root[t] = root[root[t]];
    return t;
  };
  for_each_edge(sorted_sides(mesh), [&](const Side* first, const Side* last) {
    for (const Side* s = first + 1; s != last; ++s) {
      const int a = find(first->triangle), b = find(s->triangle);
      root[std::max(a, b)] = std::min(a, b);
    }
  });
  std::vector<int> part_of(mesh.triangles.size(), -1);
  std::vector<Part> parts;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    int& index = part_of[find(static_cast<int>(t))];
    if (index < 0) {
      index = static_cast<int>(parts.size());
      parts.emplace_back();
    }
    Part& part = parts[index];
    part.triangles.push_back(static_cast<int>(t));
    for (int v : mesh.triangles[t]) {
      part.box.min = part.box.min.cwiseMin(mesh.vertices[v]);
      part.box.max = part.box.max.cwiseMax(mesh.vertices[v]);
    }
  }
  for (Part& part : parts) {
    const Vec3 origin = (part.box.min + part.box.max) / 2;
    for (int t : part.triangles) {
      const std::array<int, 3>& v = mesh.triangles[t];
      part.volume += six_volumes(mesh, v, origin) / 6;
      part.area += (mesh.vertices[v[1]] - mesh.vertices[v[0]])
                       .cross(mesh.vertices[v[2]] - mesh.vertices[v[0]])
                       .norm() /
                   2;
    }
  }
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return (a.box.max - a.box.min).squaredNorm() > (b.box.max - b.box.min).squaredNorm();
  });
  return parts;
}

// What holds nothing: a triangle and its back, a needle, a leftover of merging. A ball has 0.094 of
// its area to the 3/2, a sheet a third of its thickness over its side; single precision leaves 1e-7
// of the coordinates' size.
bool is_sliver(const Part& part, double largest) {
  const double volume = std::abs(part.volume);
  return volume <= 1e-5 * std::pow(part.area, 1.5) || volume <= 1e-9 * largest;
}

// Winding number of a part around a point, by the solid angles of its triangles (Van Oosterom and
// Strackee 1983).
double winding(const TriangleMesh& mesh, const Part& part, const Vec3& point) {
  double angle = 0;
  for (int t : part.triangles) {
    const Vec3 a = mesh.vertices[mesh.triangles[t][0]] - point;
    const Vec3 b = mesh.vertices[mesh.triangles[t][1]] - point;
    const Vec3 c = mesh.vertices[mesh.triangles[t][2]] - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)),
                            la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle / (4 * M_PI);
}

bool lies_in(const TriangleMesh& mesh, const Part& inner, const Part& outer) {
  if ((inner.box.min.array() < outer.box.min.array()).any()) return false;
  if ((inner.box.max.array() > outer.box.max.array()).any()) return false;
  const Vec3& point = mesh.vertices[mesh.triangles[inner.triangles.front()][0]];
  return std::abs(winding(mesh, outer, point)) > 0.75;  // on the surface itself it is about 1/2
}

}  // namespace

std::vector<TriangleMesh> separate_solids(const TriangleMesh& mesh) {
  const std::vector<Part> parts = parts_of(mesh);
  if (parts.size() < 2) return {mesh};
  std::vector<TriangleMesh> of_part(parts.size());
  std::vector<std::unique_ptr<RayTree>> trees(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    of_part[i].vertices = mesh.vertices;
    for (const int t : parts[i].triangles) of_part[i].triangles.push_back(mesh.triangles[t]);
  }
  const Vec3 direction = Vec3(0.8711, 0.3917, 0.2963).normalized();
  // Whether a corner, or the middle of a side, of one part lies in the other.
  const auto reaches_into = [&](std::size_t i, std::size_t j) {
    if (trees[j] == nullptr) trees[j] = std::make_unique<RayTree>(of_part[j]);
    const Box& box = parts[j].box;
    for (const auto& t : of_part[i].triangles) {
      for (int k = 0; k < 6; ++k) {
        const Vec3& corner = mesh.vertices[t[k % 3]];
        const Vec3 x = k < 3 ? corner : Vec3(0.5 * (corner + mesh.vertices[t[(k + 1) % 3]]));
        if ((x.array() < box.min.array()).any() || (x.array() > box.max.array()).any()) continue;
        if (trees[j]->winding(x, direction) != 0) return true;
      }
    }
    return false;
  };
  UnionFind joined(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = i + 1; j < parts.size(); ++j) {
      const Box &a = parts[i].box, &b = parts[j].box;
      if ((a.min.array() > b.max.array()).any() || (b.min.array() > a.max.array()).any()) continue;
      if (reaches_into(i, j) || reaches_into(j, i)) {
        joined.join(static_cast<std::int32_t>(i), static_cast<std::int32_t>(j));
      }
    }
  }
  std::vector<TriangleMesh> solids;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (joined.root(static_cast<std::int32_t>(i)) != static_cast<std::int32_t>(i)) continue;
    TriangleMesh solid;
    solid.vertices = mesh.vertices;
    for (std::size_t j = i; j < parts.size(); ++j) {
      if (joined.root(static_cast<std::int32_t>(j)) != static_cast<std::int32_t>(i)) continue;
      solid.triangles.insert(solid.triangles.end(), of_part[j].triangles.begin(),
                             of_part[j].triangles.end());
    }
    drop_unused_vertices(solid);
    solids.push_back(std::move(solid));
  }
  return solids;
}

void drop_slivers(TriangleMesh& mesh, std::vector<std::string>& notes) {
  const std::vector<Part> parts = parts_of(mesh);
  double largest = 0;
  for (const Part& part : parts) largest = std::max(largest, std::abs(part.volume));
  std::vector<char> dropped(mesh.triangles.size(), 0);
  std::size_t slivers = 0;
  for (const Part& part : parts) {
    if (!is_sliver(part, largest)) continue;
    ++slivers;
    for (int t : part.triangles) dropped[t] = 1;
  }
  if (slivers == 0 || slivers == parts.size()) return;
  std::vector<std::array<int, 3>> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!dropped[t]) kept.push_back(mesh.triangles[t]);
  }
  mesh.triangles.swap(kept);
  drop_unused_vertices(mesh);
  notes.push_back("had " + std::to_string(slivers) + " slivers without volume: left out");
}

void turn_outwards(TriangleMesh& mesh, std::vector<std::string>& notes) {
  std::vector<Part> parts = parts_of(mesh);
  std::vector<int> outermost(parts.size(), -1);
  int apart = 0, voids = 0, doubled = 0, turned = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = 0; j < i && outermost[i] < 0; ++j) {
      const bool is_outermost = outermost[j] == static_cast<int>(j);
      if (is_outermost && lies_in(mesh, parts[i], parts[j])) outermost[i] = static_cast<int>(j);
    }
    if (outermost[i] < 0) outermost[i] = static_cast<int>(i);
  }
  std::vector<char> turn(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    turn[i] = parts[outermost[i]].volume < 0;
    const bool outwards = (parts[i].volume < 0) == static_cast<bool>(turn[i]);
    const bool inner = outermost[i] != static_cast<int>(i);
    apart += !inner;
    voids += inner && !outwards;
    doubled += inner && outwards;
    turned += !inner && turn[i];
    if (turn[i]) {
      for (int t : parts[i].triangles) flip(mesh.triangles[t]);
    }
  }
  if (turned > 0 && apart == 1) notes.push_back("was inside out: turned around");
  if (turned > 0 && apart > 1) {
    notes.push_back("had " + std::to_string(turned) + " parts inside out: turned around");
  }
  if (apart > 1) notes.push_back("has " + std::to_string(apart) + " separate parts: all are taken");
  if (voids > 0) {
    notes.push_back("has " + std::to_string(voids) +
                    " parts within others that face inwards: voids");
  }
  if (doubled > 0) {
    notes.push_back("has " + std::to_string(doubled) +
                    " parts within others that face outwards: they change nothing (turn them "
                    "around if they are voids)");
  }
}

}  // namespace tissue_sim
