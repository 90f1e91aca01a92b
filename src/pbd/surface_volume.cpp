#include "pbd/surface_volume.h"

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "math/union_find.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Of a surface's area, and of what it encloses: a part below both is a speck.
constexpr double kSpeckArea = 1e-3, kSpeckVolume = 1e-6;

/// Closes the rim of the part: sides of triangles that no other side runs against, one after the
/// other. An edge of more than two triangles belongs to it with what is left over.
void close_holes(const TriangleMesh& mesh, SurfacePart& part) {
  std::map<std::pair<int, int>, int> sides;
  for (const int t : part.triangles) {
    const auto& c = mesh.triangles[t];
    for (int i = 0; i < 3; ++i) {
      const int a = c[i], b = c[(i + 1) % 3];
      const auto against = sides.find({b, a});
      if (against == sides.end()) {
        ++sides[{a, b}];
      } else if (--against->second == 0) {
        sides.erase(against);
      }
    }
  }
  while (!sides.empty()) {
    const int start = sides.begin()->first.first;
    std::vector<int> rim;
    for (int at = start; rim.empty() || at != start;) {
      const auto side = sides.lower_bound({at, -1});
      if (side == sides.end() || side->first.first != at) break;  // no rim: turned triangles
      rim.push_back(at);
      at = side->first.second;
      if (--side->second == 0) sides.erase(side);
    }
    Vec3 centre = Vec3::Zero();
    for (const int v : rim) centre += mesh.vertices[v] / static_cast<double>(rim.size());
    const Vec3& origin = mesh.vertices[mesh.triangles[part.triangles.front()][0]];
    for (std::size_t i = 0; i < rim.size(); ++i) {
      const Vec3 &a = mesh.vertices[rim[i]], &b = mesh.vertices[rim[(i + 1) % rim.size()]];
      const Vec3 twice = (b - centre).cross(a - centre);
      part.fans += 0.5 * twice.norm();
      part.volume += twice.dot(centre - origin) / 6;
    }
    ++part.holes;
  }
}

}  // namespace

std::vector<SurfacePart> surface_parts(const TriangleMesh& mesh) {
  UnionFind joined(static_cast<int>(mesh.vertices.size()));
  for (const auto& t : mesh.triangles) {
    joined.join(t[0], t[1]);
    joined.join(t[0], t[2]);
  }
  std::map<int, int> number;
  std::vector<SurfacePart> parts;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const int next = static_cast<int>(parts.size());
    const int part = number.try_emplace(joined.root(mesh.triangles[t][0]), next).first->second;
    if (part == next) parts.emplace_back();
    parts[part].triangles.push_back(static_cast<int>(t));
  }
  for (SurfacePart& part : parts) {
    const Vec3& origin = mesh.vertices[mesh.triangles[part.triangles.front()][0]];
    for (const int t : part.triangles) {
      const Vec3 &a = mesh.vertices[mesh.triangles[t][0]], &b = mesh.vertices[mesh.triangles[t][1]],
                 &c = mesh.vertices[mesh.triangles[t][2]];
      const Vec3 twice = (b - a).cross(c - a);
      part.area += 0.5 * twice.norm();
      part.volume += twice.dot(a - origin) / 6;
    }
    close_holes(mesh, part);
  }
  return parts;
}

void drop_specks(TriangleMesh& mesh, std::vector<std::string>& notes) {
  const std::vector<SurfacePart> parts = surface_parts(mesh);
  double area = 0, volume = 0;
  for (const SurfacePart& part : parts) {
    area += part.area;
    volume += std::fabs(part.volume);
  }
  std::vector<bool> is_speck(mesh.triangles.size(), false);
  int specks = 0;
  for (const SurfacePart& part : parts) {
    if (part.area > kSpeckArea * area || std::fabs(part.volume) > kSpeckVolume * volume) continue;
    ++specks;
    for (const int t : part.triangles) is_speck[t] = true;
  }
  if (specks == 0) return;
  std::vector<std::array<int, 3>> kept;
  std::vector<int> index(mesh.vertices.size(), -1);
  std::vector<Vec3> used;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (is_speck[t]) continue;
    kept.push_back(mesh.triangles[t]);
    for (int& v : kept.back()) {
      if (index[v] < 0) {
        index[v] = static_cast<int>(used.size());
        used.push_back(mesh.vertices[v]);
      }
      v = index[v];
    }
  }
  mesh.triangles.swap(kept);
  mesh.vertices.swap(used);
  notes.push_back("had " + std::to_string(specks) + (specks == 1 ? " speck" : " specks") +
                  " without volume, parts of their own: left out");
}

}  // namespace pbd
}  // namespace tissue_sim
