#include "geometry/volume_cells.h"

#include <algorithm>

namespace tissue_sim {
namespace {

constexpr const char* kCellNames[] = {"points",     "lines",      "triangles", "quadrilaterals",
                                      "tetrahedra", "hexahedra",  "voxels",    "wedges",
                                      "pyramids",   "other cells"};

/// Seen from outside counter-clockwise.
constexpr int kCubeFaces[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                  {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

void add_hexahedron(const std::array<int, 8>& corners, TetMesh& mesh) {
  const int lowest = *std::min_element(corners.begin(), corners.end());
  for (const auto& face : kCubeFaces) {
    std::array<int, 4> quad;
    for (int i = 0; i < 4; ++i) quad[i] = corners[face[i]];
    std::rotate(quad.begin(), std::min_element(quad.begin(), quad.end()), quad.end());
    if (quad[0] == lowest) continue;
    for (int i = 1; i < 3; ++i) {
      // What hexahedra have that stand for wedges: corners twice.
      if (quad[i] == quad[0] || quad[i + 1] == quad[0] || quad[i] == quad[i + 1]) continue;
      mesh.tetrahedra.push_back({quad[0], quad[i + 1], quad[i], lowest});
    }
  }
}

}  // namespace

void VolumeCells::add(CellKind kind, const int* corners, int count) {
  const int needed = kind == CellKind::kTetrahedron                              ? 4
                     : kind == CellKind::kHexahedron || kind == CellKind::kVoxel ? 8
                                                                                 : 0;
  if (count < needed) kind = CellKind::kOther;
  ++counts[static_cast<int>(kind)];
  if (kind == CellKind::kTetrahedron) {
    mesh.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
  } else if (kind == CellKind::kHexahedron || kind == CellKind::kVoxel) {
    std::array<int, 8> c;
    std::copy_n(corners, 8, c.begin());
    if (kind == CellKind::kVoxel) {
      std::swap(c[2], c[3]);
      std::swap(c[6], c[7]);
    }
    add_hexahedron(c, mesh);
  }
}

std::string VolumeCells::note() const {
  std::string taken, left;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const auto kind = static_cast<CellKind>(i);
    const bool is_cube = kind == CellKind::kHexahedron || kind == CellKind::kVoxel;
    std::string& list = kind == CellKind::kTetrahedron || is_cube ? taken : left;
    list += (list.empty() ? "" : ", ") + std::to_string(counts[i]) + " " + kCellNames[i] +
            (is_cube ? ", each taken as six tetrahedra" : "");
  }
  const bool plain = left.empty() && counts[static_cast<int>(CellKind::kHexahedron)] == 0 &&
                     counts[static_cast<int>(CellKind::kVoxel)] == 0;
  if (plain) return "";
  if (taken.empty()) return "has no tetrahedra but " + left;
  return "has " + taken + (left.empty() ? "" : "; left out are " + left);
}

}  // namespace tissue_sim
