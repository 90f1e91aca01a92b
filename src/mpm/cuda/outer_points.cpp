#include "mpm/cuda/outer_points.h"

#include <algorithm>
#include <array>
#include <set>

#include "contact/surface_spring.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

constexpr int kSweeps = 3;         // over the surfaces at a point
constexpr double kFarthest = 0.5;  // from a point to its place along an axis [cells]

using Cell = std::array<int, 4>;  // body, x, y, z

/// Cells that have nodes which faces hold.
std::set<Cell> cells_beside(const AnchorFaces& faces, const LatticeTissue& tissue) {
  std::set<std::int32_t> held;
  for (const FaceRow& row : faces.rows) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (row.weight[k] != 0) held.insert(row.node[k]);
    }
  }
  std::set<Cell> cells;
  if (held.empty()) return cells;
  for (std::size_t b = 0; b < tissue.bodies.size(); ++b) {
    tissue.bodies[b].for_each_node([&](int node, int x, int y, int z) {
      if (held.count(node) == 0) return;
      for (int k = 0; k < 27; ++k) {
        cells.insert({static_cast<int>(b), x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1});
      }
    });
  }
  return cells;
}

}  // namespace

bool has_thin_tools(const Scene& scene) {
  return std::any_of(scene.tools.begin(), scene.tools.end(), [&](const Tool& tool) {
    return tool.type != ToolType::kGrasper && tool.type != ToolType::kScalpel &&
           stiffer_across(static_cast<float>(tool.radius), static_cast<float>(scene.cell_size)) > 1;
  });
}

std::vector<float4> surface_planes(const LatticeTissue& tissue) {
  constexpr double kOneWay = 0.8;  // length of the mean of normals that look one way
  const std::vector<OuterPlace> all = find_outer_places(tissue);
  std::vector<float4> planes(tissue.points.size(), float4{0, 0, 0, -1});
  for (auto first = all.begin(); first != all.end();) {
    const auto last = std::find_if(first, all.end(),
                                   [&](const OuterPlace& o) { return o.point != first->point; });
    Vec3 sum = Vec3::Zero();
    const Vec3 one(first->normal[0], first->normal[1], first->normal[2]);
    for (auto o = first; o != last; ++o) {  // of a sheet's two sides either will do
      const Vec3 normal(o->normal[0], o->normal[1], o->normal[2]);
      sum += normal.dot(one) < 0 ? -normal : normal;
    }
    const Vec3 normal = sum / static_cast<double>(last - first);
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    if (normal.norm() > kOneWay) {
      const Vec3 of_axis = normal / normal[axis];
      planes[first->point] = {static_cast<float>(of_axis[0]), static_cast<float>(of_axis[1]),
                              static_cast<float>(of_axis[2]), static_cast<float>(axis)};
    }
    first = last;
  }
  return planes;
}

std::vector<float4> outer_points(const LatticeTissue& tissue, const AnchorFaces& faces) {
  const std::set<Cell> soft = cells_beside(faces, tissue);
  const std::vector<OuterPlace> all = find_outer_places(tissue);
  const Array<std::uint8_t>& bonds = tissue.points.bonds;
  std::vector<float4> places(tissue.points.size(), float4{0, 0, 0, 0});
  for (auto first = all.begin(); first != all.end();) {
    const auto last = std::find_if(first, all.end(),
                                   [&](const OuterPlace& o) { return o.point != first->point; });
    const Points::Site& s = tissue.points.site[first->point];
    const Vec3 from(s.x & 1 ? 0.25 : -0.25, s.y & 1 ? 0.25 : -0.25, s.z & 1 ? 0.25 : -0.25);
    Vec3 x = from;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (auto o = first; o != last; ++o) {
        const Vec3 place(o->place[0], o->place[1], o->place[2]);
        const Vec3 normal(o->normal[0], o->normal[1], o->normal[2]);
        x += normal.dot(place - x) * normal;
      }
    }
    x = x.cwiseMax(from - Vec3::Constant(kFarthest)).cwiseMin(from + Vec3::Constant(kFarthest));
    const bool is_soft = soft.count({s.body, s.x / 2, s.y / 2, s.z / 2}) > 0;
    const int count = __builtin_popcount(bonds[first->point]) + (is_soft ? kSoftPlace : 0);
    places[first->point] = {static_cast<float>(x[0]), static_cast<float>(x[1]),
                            static_cast<float>(x[2]), static_cast<float>(count)};
    first = last;
  }
  return places;
}

}  // namespace tissue_sim
