#include "mls/nodes.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "geometry/nearest_surface.h"
#include "mls/anchors.h"
#include "mls/placement.h"
#include "scene/scene_text.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

[[noreturn]] void refuse_region(const char* list, std::size_t index, double spacing,
                                const std::string& body, const char* what) {
  throw std::invalid_argument(
      std::string(list) + "[" + std::to_string(index) + "] of body '" + body +
      "' holds no node of it" + what +
      ": a region is in world coordinates and must reach at least a spacing of nodes (" +
      text(spacing) + " m) into the body");
}

/// Puts a material into the list unless it is there; returns its number.
std::uint8_t number_of(std::vector<Material>& materials, const Material& m) {
  const auto same = [&m](const Material& other) { return other.name == m.name; };
  const auto at = std::find_if(materials.begin(), materials.end(), same);
  const auto number = at - materials.begin();
  if (number > 255) throw std::invalid_argument("materials: a scene uses at most 256 of them");
  if (at == materials.end()) materials.push_back(m);
  return static_cast<std::uint8_t>(number);
}

/// How far below the surface a node lies [m]; less than 0 above it, as nodes at curved ones may.
/// And which way the surface looks there.
float depth_of(const NearestSurface& surface, const Vec3& x, const Vec3& middle, double spacing,
               Vec3& normal) {
  SurfacePoint nearest;
  if (!surface.find(x, x - middle, nearest)) return static_cast<float>(0.5 * spacing);
  normal = nearest.normal;
  return static_cast<float>((nearest.place - x).dot(nearest.normal));
}

/// The last of the regions that holds the place, -1 for none.
template <class Regions, class RegionOf>
int last_that_holds(const Regions& regions, const Vec3& x, const RegionOf& region) {
  for (std::size_t i = regions.size(); i-- > 0;) {
    if (region(regions[i]).contains(x)) return static_cast<int>(i);
  }
  return -1;
}

/// An anchor at the body's own face, which no node lies in, holds those whose share of the body is
/// there. Whether there are any.
bool hold_own_face(const Body& body, std::size_t r, std::size_t first_anchor, double spacing,
                   std::int32_t first_node, MlsNodes& nodes) {
  constexpr double kShare = 0.6;  // of a spacing; half of one on a lattice
  bool any = false;
  for (std::int32_t i = first_node; i < nodes.count(); ++i) {
    if (nodes.surface[i] == 0 || nodes.anchored[i] != 0) continue;
    const double far = (nearest_of(body.anchors[r], nodes.place[i]) - nodes.place[i]).norm();
    if (far > kShare * spacing) continue;
    nodes.anchor[i] = static_cast<std::int16_t>(first_anchor + r);
    nodes.anchored[i] = 1;
    any = true;
  }
  return any;
}

}  // namespace

double mls_spacing(const Scene& scene) {
  return scene.mls.spacing > 0 ? scene.mls.spacing : 0.5 * scene.cell_size;
}

std::vector<double> usual_spacings(const MlsNodes& nodes) {
  std::vector<double> volume, count;
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    volume.resize(nodes.body[i] + 1, 0.0);
    count.resize(nodes.body[i] + 1, 0.0);
    volume[nodes.body[i]] += nodes.part[i] < 0 ? 0.0 : nodes.volume[i];
    count[nodes.body[i]] += 1;
  }
  for (std::size_t b = 0; b < volume.size(); ++b) volume[b] = std::cbrt(volume[b] / count[b]);
  return volume;
}

MlsNodes make_mls_nodes(const Scene& scene, std::vector<std::string>* notes) {
  const double spacing = mls_spacing(scene);
  MlsNodes nodes;
  std::size_t first_anchor = 0;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    const std::uint8_t own = number_of(nodes.materials, find_material(scene, body.material));
    std::vector<std::uint8_t> number;
    for (const Inclusion& i : body.inclusions) {
      number.push_back(number_of(nodes.materials, find_material(scene, i.material)));
    }
    std::vector<int> held(body.inclusions.size(), 0), anchored(body.anchors.size(), 0);
    const double widest = scene.mls.placement == MlsPlacement::kGraded ? scene.mls.grading : 1;
    std::unique_ptr<NearestSurface> surface;  // given nodes lie at the surface itself
    if (!has_given_nodes(body)) {
      surface = std::make_unique<NearestSurface>(body, 2 * widest * spacing);
    }
    const LimitWork rest(with_points(work_limits().max_points - nodes.count()));
    const std::int32_t first_node = nodes.count();
    nodes.gaps.emplace_back();
    MlsMeshEdges edges;
    for (const PlacedNode& n :
         place_nodes(body, scene.mls, spacing, scene.seed + b, notes, nodes.gaps.back(), edges)) {
      nodes.place.push_back(n.place);
      nodes.volume.push_back(static_cast<float>(n.volume));
      nodes.body.push_back(static_cast<std::int16_t>(b));
      nodes.part.push_back(n.part);
      nodes.surface.push_back(n.surface ? 1 : 0);
      nodes.normal.emplace_back(Vec3::Zero());
      nodes.depth.push_back(
          n.surface && surface != nullptr
              ? depth_of(*surface, n.place, body.pose.position, spacing, nodes.normal.back())
              : 0.0f);
      const int inclusion = last_that_holds(
          body.inclusions, n.place, [](const Inclusion& i) -> const Region& { return i.region; });
      nodes.material.push_back(inclusion < 0 ? own : number[inclusion]);
      if (inclusion >= 0) ++held[inclusion];
      std::int16_t anchor = -1;
      for (std::size_t r = 0; r < body.anchors.size(); ++r) {
        if (!body.anchors[r].contains(n.place)) continue;
        ++anchored[r];
        if (anchor < 0) anchor = static_cast<std::int16_t>(first_anchor + r);
      }
      nodes.anchor.push_back(anchor);
      nodes.anchored.push_back(anchor >= 0 ? 1 : 0);
    }
    for (const auto& e : edges) {
      nodes.mesh_edges.push_back({first_node + e[0], first_node + e[1]});
    }
    for (std::size_t r = 0; r < anchored.size(); ++r) {
      if (anchored[r] == 0 && !hold_own_face(body, r, first_anchor, spacing, first_node, nodes)) {
        refuse_region("anchors", r, spacing, body.name, "");
      }
    }
    first_anchor += body.anchors.size();
    for (std::size_t i = 0; i < held.size(); ++i) {
      if (held[i] == 0) {
        refuse_region("inclusions", i, spacing, body.name, " that no later one holds");
      }
    }
  }
  return nodes;
}

}  // namespace tissue_sim
