// What makes a triangle mesh a solid: every edge is passed as often one way as the other.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <stdexcept>
#include <tuple>

#include "geometry/mesh.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

/// One side of a triangle.
struct Side {
  int low, high;  ///< vertices, the lower first
  int triangle;
  bool forward;  ///< goes from low to high
};

struct Counts {
  int open = 0;         ///< edges with an odd number of sides
  int disagreeing = 0;  ///< edges with an even number, not as many each way
};

std::vector<Side> sorted_sides(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<int>(t), a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return sides;
}

// Calls visit(first, last) for the sides of each edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, Visit visit) {
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i;
    while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high) ++j;
    visit(&sides[i], &sides[i] + (j - i));
    i = j;
  }
}

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

void flip(std::array<int, 3>& triangle) { std::swap(triangle[1], triangle[2]); }

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

struct Part {
  std::vector<int> triangles;
  double volume = 0;  ///< signed
  Box box;
};

double six_volumes(const TriangleMesh& mesh, const std::array<int, 3>& t, const Vec3& origin) {
  return (mesh.vertices[t[0]] - origin)
      .dot((mesh.vertices[t[1]] - origin).cross(mesh.vertices[t[2]] - origin));
}

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
    for (int t : part.triangles) part.volume += six_volumes(mesh, mesh.triangles[t], origin) / 6;
  }
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return (a.box.max - a.box.min).squaredNorm() > (b.box.max - b.box.min).squaredNorm();
  });
  return parts;
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

// Outermost parts must face outwards; what lies in them turns with them.
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

}  // namespace

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
  turn_outwards(mesh, notes);
}

}  // namespace tissue_sim
