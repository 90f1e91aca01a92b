#include "mls/placement.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "geometry/chord.h"
#include "geometry/lattice.h"
#include "geometry/nearest.h"
#include "geometry/tet_mesh.h"
#include "math/union_find.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

constexpr int kSamples = 3;      // along each axis, within a spacing
constexpr double kGrowth = 0.3;  // of the spacing of graded nodes, for each one from the surface
constexpr double kApart = 0.9;   // least distance of graded nodes at first, in spacings
constexpr int kLloydSteps = 8;
constexpr double kGivenApart = 0.5;  // least distance of given nodes, of that of as many evenly

/// A number in [0, 1) that hangs on nothing but the arguments (splitmix64).
double draw(std::uint64_t seed, std::uint64_t index) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15u * (3 * index + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/// The body in small cubes.
std::vector<PlacedNode> cubes_of(const Body& body, double edge, std::vector<std::string>* notes,
                                 NearGaps& gaps) {
  const Lattice lattice = make_lattice(body, 2 * edge, notes);
  gaps = NearGaps(lattice);
  double scale = 1;
  if (!is_meshed(body)) {
    double sum = 0;
    for (const Lattice::Site& s : lattice.sites) sum += s.volume;
    scale = exact_volume(body) / sum;
  }
  const double cube = edge * edge * edge;
  std::vector<PlacedNode> cubes;
  cubes.reserve(lattice.sites.size());
  // Sites come by z, y, x: a neighbour is found among them.
  const auto key = [](std::int64_t x, std::int64_t y, std::int64_t z) {
    return ((z + 1) << 42) + ((y + 1) << 21) + (x + 1);
  };
  std::vector<std::int64_t> keys;
  keys.reserve(lattice.sites.size());
  for (const Lattice::Site& s : lattice.sites) keys.push_back(key(s.x, s.y, s.z));
  const auto is_there = [&](std::int64_t k) {
    return std::binary_search(keys.begin(), keys.end(), k);
  };
  for (const Lattice::Site& s : lattice.sites) {
    PlacedNode c;
    c.place = lattice.origin + edge * Vec3(s.x + 0.5, s.y + 0.5, s.z + 0.5);
    c.volume = scale * s.volume;
    c.surface = s.volume < 0.999 * cube;
    for (int i = -1; i <= 1 && !c.surface; i += 2) {
      c.surface = !is_there(key(s.x + i, s.y, s.z)) || !is_there(key(s.x, s.y + i, s.z)) ||
                  !is_there(key(s.x, s.y, s.z + i));
    }
    cubes.push_back(c);
  }
  for (const Lattice::Gap& g : lattice.gaps) {  // both sides of it
    const Lattice::Site& s = lattice.sites[g.site];
    const std::int64_t other = key(s.x + (g.axis == 0), s.y + (g.axis == 1), s.z + (g.axis == 2));
    cubes[g.site].surface = true;
    cubes[std::lower_bound(keys.begin(), keys.end(), other) - keys.begin()].surface = true;
  }
  return cubes;
}

std::vector<Vec3> places_of(const std::vector<PlacedNode>& nodes) {
  std::vector<Vec3> places;
  places.reserve(nodes.size());
  for (const PlacedNode& n : nodes) places.push_back(n.place);
  return places;
}

/// The node that is nearest to each cube.
std::vector<std::int32_t> owners(const std::vector<PlacedNode>& cubes,
                                 const std::vector<Vec3>& places) {
  const NearestPoints tree(places);
  std::vector<std::int32_t> owner(cubes.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cubes.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      std::vector<Neighbour> found;
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        tree.nearest(cubes[i].place, 1, found);
                        owner[i] = found[0].index;
                      }
                    });
  return owner;
}

/// Gives each node all cubes that it is nearest to; nodes without any go.
void share_out(const std::vector<PlacedNode>& cubes, std::vector<PlacedNode>& nodes) {
  const std::vector<std::int32_t> owner = owners(cubes, places_of(nodes));
  for (PlacedNode& n : nodes) n.volume = n.surface = 0;
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    nodes[owner[i]].volume += cubes[i].volume;
    nodes[owner[i]].surface = nodes[owner[i]].surface || cubes[i].surface;
  }
  nodes.erase(std::remove_if(nodes.begin(), nodes.end(),
                             [](const PlacedNode& n) { return !(n.volume > 0); }),
              nodes.end());
}

/// Nodes that keep their distance from those that come before them, in a random order (Cook 1986).
std::vector<PlacedNode> scatter(const std::vector<PlacedNode>& cubes,
                                const std::vector<double>& spacing, std::uint64_t seed) {
  std::vector<std::int32_t> order(cubes.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return std::make_pair(draw(seed, a), a) < std::make_pair(draw(seed, b), b);
  });
  const double cell = *std::min_element(spacing.begin(), spacing.end());
  std::unordered_map<std::int64_t, std::vector<std::int32_t>> taken;
  const auto cell_at = [cell](const Vec3& x, int a) {
    return static_cast<std::int64_t>(std::floor(x[a] / cell));
  };
  const auto key = [](std::int64_t x, std::int64_t y, std::int64_t z) {
    constexpr std::int64_t kMiddle = 1 << 20;
    return ((z + kMiddle) << 42) + ((y + kMiddle) << 21) + (x + kMiddle);
  };
  std::vector<std::int32_t> nodes;
  for (const std::int32_t i : order) {
    const Vec3& x = cubes[i].place;
    const double apart = kApart * spacing[i];
    const auto reach = static_cast<std::int64_t>(std::ceil(apart / cell));
    const std::int64_t at[3] = {cell_at(x, 0), cell_at(x, 1), cell_at(x, 2)};
    bool is_free = true;
    for (std::int64_t dz = -reach; dz <= reach && is_free; ++dz) {
      for (std::int64_t dy = -reach; dy <= reach && is_free; ++dy) {
        for (std::int64_t dx = -reach; dx <= reach && is_free; ++dx) {
          const auto there = taken.find(key(at[0] + dx, at[1] + dy, at[2] + dz));
          if (there == taken.end()) continue;
          for (const std::int32_t n : there->second) {
            if ((cubes[n].place - x).norm() < apart) is_free = false;
          }
        }
      }
    }
    if (!is_free) continue;
    taken[key(at[0], at[1], at[2])].push_back(i);
    nodes.push_back(i);
  }
  std::sort(nodes.begin(), nodes.end());
  std::vector<PlacedNode> placed;
  for (const std::int32_t i : nodes) placed.push_back(cubes[i]);
  return placed;
}

/// Moves each node to the centre of its share a few times (Lloyd), weighted so that the spacing
/// stays: of a density s^-5 (Du, Faber, Gunzburger 1999).
void even_out(const std::vector<PlacedNode>& cubes, const std::vector<double>& spacing,
              std::vector<PlacedNode>& nodes) {
  for (int step = 0; step < kLloydSteps; ++step) {
    const std::vector<std::int32_t> owner = owners(cubes, places_of(nodes));
    std::vector<Vec3> sum(nodes.size(), Vec3::Zero());
    std::vector<double> weight(nodes.size(), 0.0);
    for (std::size_t i = 0; i < cubes.size(); ++i) {
      const double w = cubes[i].volume * std::pow(spacing[i] / spacing[0], -5);
      sum[owner[i]] += w * cubes[i].place;
      weight[owner[i]] += w;
    }
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (weight[n] > 0) nodes[n].place = sum[n] / weight[n];
    }
  }
}

std::vector<PlacedNode> graded(const std::vector<PlacedNode>& cubes, double grading, double spacing,
                               std::uint64_t seed) {
  std::vector<Vec3> surface;
  for (const PlacedNode& c : cubes) {
    if (c.surface) surface.push_back(c.place);
  }
  const NearestPoints tree(surface);
  std::vector<double> wanted(cubes.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cubes.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      std::vector<Neighbour> found;
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        tree.nearest(cubes[i].place, 1, found);
                        const double depth = std::sqrt(found[0].distance2);
                        wanted[i] = std::min(grading * spacing, spacing + kGrowth * depth);
                      }
                    });
  std::vector<PlacedNode> nodes = scatter(cubes, wanted, seed);
  even_out(cubes, wanted, nodes);
  return nodes;
}

/// The vertices to keep as nodes so that no two of a part are nearer than `apart`, those at the
/// surface and then the largest first: of each vertex the number of the one that stands for it.
std::vector<std::int32_t> thinned_out(const std::vector<PlacedNode>& nodes, double apart) {
  std::vector<std::int32_t> order(nodes.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return std::make_tuple(!nodes[a].surface, -nodes[a].volume, a) <
           std::make_tuple(!nodes[b].surface, -nodes[b].volume, b);
  });
  const std::vector<Vec3> places = places_of(nodes);
  const NearestPoints tree(places);
  std::vector<std::int32_t> kept(nodes.size(), -1);
  std::vector<double> distance2(nodes.size(), apart * apart);
  std::vector<Neighbour> found;
  for (const std::int32_t i : order) {
    if (kept[i] >= 0) continue;
    tree.within(nodes[i].place, apart, found);
    for (const Neighbour& n : found) {
      if (n.index != i && (nodes[n.index].part != nodes[i].part || kept[n.index] == n.index ||
                           !(n.distance2 < distance2[n.index]))) {
        continue;
      }
      kept[n.index] = i;
      distance2[n.index] = n.distance2;
    }
  }
  return kept;
}

std::vector<PlacedNode> vertices_of(const TetMesh& mesh, const std::string& body,
                                    std::vector<std::string>* notes, MlsMeshEdges& edges) {
  std::vector<PlacedNode> vertices(mesh.vertices.size());
  UnionFind joined(vertices.size());
  double all = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double share = 0.25 * volume(mesh, static_cast<int>(t));
    all += 4 * share;
    for (const int v : mesh.tetrahedra[t]) {
      vertices[v].volume += share;
      joined.join(v, mesh.tetrahedra[t][0]);
    }
  }
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    vertices[i].place = mesh.vertices[i];
    vertices[i].part = joined.root(static_cast<std::int32_t>(i));
  }
  for (const std::array<int, 3>& triangle : boundary(mesh)) {
    for (const int v : triangle) vertices[v].surface = true;
  }
  const double apart = kGivenApart * std::cbrt(all / vertices.size());
  const std::vector<std::int32_t> kept = thinned_out(vertices, apart);
  std::vector<PlacedNode> nodes;
  std::vector<std::int32_t> number(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (kept[i] != static_cast<std::int32_t>(i)) continue;
    number[i] = static_cast<std::int32_t>(nodes.size());
    nodes.push_back(vertices[i]);
  }
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (kept[i] != static_cast<std::int32_t>(i))
      nodes[number[kept[i]]].volume += vertices[i].volume;
  }
  for (const auto& t : mesh.tetrahedra) {
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < a; ++b) {
        const std::int32_t i = number[kept[t[a]]], j = number[kept[t[b]]];
        if (i != j) edges.push_back({std::min(i, j), std::max(i, j)});
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  if (notes != nullptr && nodes.size() < vertices.size()) {
    notes->push_back("body '" + body + "': " + std::to_string(vertices.size() - nodes.size()) +
                     " of " + std::to_string(vertices.size()) +
                     " vertices are nearer to others than " + text(apart) +
                     " m, half of what is usual there, and are one node with these: substeps would "
                     "be as short as they are near");
  }
  return nodes;
}

}  // namespace

bool has_given_nodes(const Body& body) {
  return body.shape == Shape::kMesh && is_tet_file(body.mesh);
}

std::vector<PlacedNode> place_nodes(const Body& body, const MlsOptions& options, double spacing,
                                    std::uint64_t seed, std::vector<std::string>* notes,
                                    NearGaps& gaps, MlsMeshEdges& edges) {
  if (has_given_nodes(body)) {
    return vertices_of(load_tets(body, spacing, notes), body.name, notes, edges);
  }
  if (options.placement == MlsPlacement::kRegular) return cubes_of(body, spacing, notes, gaps);
  const std::vector<PlacedNode> cubes = cubes_of(body, spacing / kSamples, notes, gaps);
  std::vector<PlacedNode> nodes = graded(cubes, options.grading, spacing, seed);
  share_out(cubes, nodes);
  return nodes;
}

}  // namespace tissue_sim
