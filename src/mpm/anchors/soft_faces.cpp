#include "mpm/anchors/soft_faces.h"

#include <algorithm>

#include "mpm/anchors/anchor_faces.h"

namespace tissue_sim {
namespace {

constexpr double kWall = -0.25;  // of nodes held up to one, from there [cells]

/// Calls f(point) for the points of a cell's column at site `along` of an axis: four at most.
template <class F>
void for_each_of_column(const LatticeBody& b, const std::int32_t (&cell)[3], int axis, int along,
                        const F& f) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (int k = 0; k < 4; ++k) {
    int site[3];
    site[axis] = along;
    site[u] = 2 * cell[u] + k % 2;
    site[v] = 2 * cell[v] + k / 2;
    const int p = b.point(site[0], site[1], site[2]);
    if (p >= 0) f(p);
  }
}

}  // namespace

void soften_at_faces(const Scene& scene, LatticeTissue& tissue) {
  AnchorFaces faces;
  find_face_links(scene, tissue, faces);
  if (faces.links.empty()) return;
  Points& points = tissue.points;
  points.yielding.assign(points.size(), 1.0f);
  for (const FaceLink& link : faces.links) {
    const LatticeBody& b = tissue.bodies[link.body];
    const int cell = link.cell[link.axis];
    bool goes_on = false;  // tissue inside
    // The site of the half cell `i` half cells outwards from the inner one of the face's cell.
    const auto site = [&](int i) { return link.outside ? 2 * cell + i : 2 * cell + 1 - i; };
    for_each_of_column(b, link.cell, link.axis, site(-1), [&](int) { goes_on = true; });
    // Outwards from the node of the face's cell: the last one that is held.
    const int last = goes_on && link.at <= kWall ? 0 : 1;
    const auto share = static_cast<float>(yielding_share(kWall - (link.at - last)));
    // A node is held where points three quarters of a cell before it are: NodeFields.
    for (int i = 0; i < 2 * last; ++i) {
      for_each_of_column(b, link.cell, link.axis, site(i),
                         [&](int p) { points.anchored[p] = Points::kInAnchor; });
    }
    for (int i = 2 * last; i < 2 * last + 3; ++i) {
      for_each_of_column(b, link.cell, link.axis, site(i),
                         [&](int p) { points.yielding[p] = std::min(points.yielding[p], share); });
    }
  }
}

}  // namespace tissue_sim
