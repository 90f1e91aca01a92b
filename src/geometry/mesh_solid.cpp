// What makes a triangle mesh a solid: every edge is passed as often one way as the other.
#include <algorithm>
#include <set>
#include <stdexcept>

#include "geometry/mesh.h"
#include "geometry/mesh_edges.h"
#include "geometry/mesh_parts.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

struct Counts {
  int open = 0;         ///< edges with an odd number of sides
  int disagreeing = 0;  ///< edges with an even number, not as many each way
};

Counts count(const TriangleMesh& mesh) {
  Counts counts;
  for_each_edge(sorted_sides(mesh), [&](const Side* first, const Side* last) {
    const auto forward = std::count_if(first, last, [](const Side& s) { return s.forward; });
    if ((last - first) % 2 != 0) {
      ++counts.open;
    } else if (2 * forward != last - first) {
      ++counts.disagreeing;
    }
  });
  return counts;
}

// Triangles with the same corners and the same facing, but for one of each.
int drop_repeated(TriangleMesh& mesh) {
  std::set<std::array<int, 3>> seen;
  const std::size_t before = mesh.triangles.size();
  std::vector<std::array<int, 3>> kept;
  for (const auto& t : mesh.triangles) {
    std::array<int, 3> turned = t;
    std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
    if (seen.insert(turned).second) kept.push_back(t);
  }
  mesh.triangles.swap(kept);
  return static_cast<int>(before - mesh.triangles.size());
}

// Makes neighbours across edges with two sides agree, turning the fewer of each part.
int make_agree(TriangleMesh& mesh) {
  const int n = static_cast<int>(mesh.triangles.size());
  std::vector<std::vector<std::pair<int, bool>>> neighbours(n);  // triangle, faces the other way
  for_each_edge(sorted_sides(mesh), [&](const Side* first, const Side* last) {
    if (last - first != 2) return;
    const bool opposed = first[0].forward == first[1].forward;
    neighbours[first[0].triangle].push_back({first[1].triangle, opposed});
    neighbours[first[1].triangle].push_back({first[0].triangle, opposed});
  });
  std::vector<char> state(n, 2);  // 0 keep, 1 turn, 2 not reached
  int turned = 0;
  for (int start = 0; start < n; ++start) {
    if (state[start] != 2) continue;
    std::vector<int> part{start};
    state[start] = 0;
    for (std::size_t i = 0; i < part.size(); ++i) {
      for (const auto& [other, opposed] : neighbours[part[i]]) {
        if (state[other] != 2) continue;
        state[other] = static_cast<char>(state[part[i]] ^ static_cast<char>(opposed));
        part.push_back(other);
      }
    }
    const auto odd = std::count_if(part.begin(), part.end(), [&](int t) { return state[t] == 1; });
    const char turn = 2 * odd > static_cast<std::ptrdiff_t>(part.size()) ? 0 : 1;
    for (int t : part) {
      if (state[t] != turn) continue;
      flip(mesh.triangles[t]);
      ++turned;
    }
  }
  return turned;
}

}  // namespace

double six_volumes(const TriangleMesh& mesh, const std::array<int, 3>& t, const Vec3& origin) {
  return (mesh.vertices[t[0]] - origin)
      .dot((mesh.vertices[t[1]] - origin).cross(mesh.vertices[t[2]] - origin));
}

double signed_volume(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return 0;
  const Vec3 origin = mesh.vertices[mesh.triangles.front()[0]];
  double six = 0;
  for (const auto& t : mesh.triangles) six += six_volumes(mesh, t, origin);
  return six / 6;
}

void make_solid(TriangleMesh& mesh, std::vector<std::string>& notes) {
  if (const int repeated = drop_repeated(mesh)) {
    notes.push_back("had " + std::to_string(repeated) + " triangles twice: each is taken once");
  }
  Counts counts = count(mesh);
  if (counts.open > 0) {
    Box box;
    for (const Vec3& v : mesh.vertices) {
      box.min = box.min.cwiseMin(v);
      box.max = box.max.cwiseMax(v);
    }
    TriangleMesh merged = mesh;
    const double distance = 1e-6 * (box.max - box.min).norm();
    merge_vertices(merged, distance);
    drop_repeated(merged);
    const Counts after = count(merged);
    if (after.open == 0) {
      notes.push_back("had " + std::to_string(counts.open) +
                      " open edges between vertices less than " +
                      text(static_cast<float>(distance)) + " m apart: merged");
      mesh = merged;
      counts = after;
    }
  }
  if (counts.open > 0) {
    throw std::invalid_argument(
        "has " + std::to_string(counts.open) +
        " open edges (where it lacks a side, inside and outside are not defined): close its holes, "
        "in Blender or MeshLab for instance");
  }
  if (counts.disagreeing > 0) {
    const int turned = make_agree(mesh);
    counts = count(mesh);
    if (counts.disagreeing > 0) {
      throw std::invalid_argument(
          "has " + std::to_string(counts.disagreeing) +
          " edges whose triangles face both ways (so inside and outside are not defined): "
          "recalculate its normals, remove inner faces");
    }
    notes.push_back("had " + std::to_string(turned) +
                    " triangles that faced the other way than their neighbours: turned around");
  }
  drop_slivers(mesh, notes);
  turn_outwards(mesh, notes);
}

}  // namespace tissue_sim
