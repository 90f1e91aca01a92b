#include "pbd/viscosity.h"

#include <algorithm>
#include <cmath>

#include "pbd/free_flight.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr double kLeastOfCuts = 1;  // [Pa s]
constexpr double kDensity = 1000;   // [kg/m^3]
/// Edges longer than 3.5 mm damp as these do: what crumples between few vertices shook for ever.
/// Less than 1 Pa s has as much less of it.
constexpr double kLeastRate = 80;  // [1/s]
constexpr int kEdgesOfPart = 1024;

void turn(Vertices& v, int i, const Flight& f, const Vec3& spin) {
  const Vec3 add = spin.cross(v.position(i) - f.centre);
  for (int a = 0; a < 3; ++a) v.v[4 * i + a] += static_cast<float>(add[a]);
}

using Ends = std::vector<std::array<std::int32_t, 2>>;

/// Each edge of the tetrahedra once, lower end first, by that, then by the other.
Ends edges_of_tetrahedra(const State& s) {
  const auto each = [&s](const auto& of) {
    for (const Tetrahedron& t : s.tetrahedra) {
      for (int i = 0; i < 4; ++i) {
        for (int j = i + 1; j < 4; ++j) of(std::min(t[i], t[j]), std::max(t[i], t[j]));
      }
    }
  };
  std::vector<std::int32_t> end(s.vertices.size() + 1, 0), others;
  each([&](std::int32_t low, std::int32_t) { ++end[low + 1]; });
  for (int v = 0; v < s.vertices.size(); ++v) end[v + 1] += end[v];
  others.resize(end.back());
  std::vector<std::int32_t> next = end;
  each([&](std::int32_t low, std::int32_t high) { others[next[low]++] = high; });
  Ends edges;
  for (int v = 0; v < s.vertices.size(); ++v) {
    std::sort(others.begin() + end[v], others.begin() + end[v + 1]);
    for (std::int32_t k = end[v]; k < end[v + 1]; ++k) {
      if (k == end[v] || others[k] != others[k - 1]) edges.push_back({v, others[k]});
    }
  }
  return edges;
}

/// Makes the dampers' vertices and, of surfaces, colours: those of links. Others' are then the
/// first that are found: quick, and the same in a state that was restored.
void find_dampers(State& s, const std::vector<double>& viscosity) {
  s.dampers.vertices.clear();
  s.dampers.numbers.clear();
  s.dampers.colour.clear();
  if (*std::max_element(viscosity.begin(), viscosity.end()) == 0) return;
  const bool is_surface = s.tetrahedra.empty();
  const Ends of_tetrahedra = is_surface ? Ends() : edges_of_tetrahedra(s);
  const Ends& ends = is_surface ? s.links.vertices : of_tetrahedra;
  const int edges = is_surface ? s.edge_count : static_cast<int>(ends.size());
  for (int c = 0; c < edges; ++c) {
    const auto [a, b] = ends[c];
    if (viscosity[s.vertices.body[a]] == 0) continue;
    if (s.vertices.anchored[a] != 0 && s.vertices.anchored[b] != 0) continue;
    s.dampers.add(ends[c], {0.0f});
    if (is_surface) s.dampers.colour.back() = s.links.colour[c];
  }
}

}  // namespace

bool make_dampers(State& s, double duration) {
  if (s.damped_for == duration) return s.dampers.size() > 0;
  const bool is_surface = s.tetrahedra.empty();
  std::vector<double> viscosity;
  for (const Body& body : s.scene.bodies) {
    viscosity.push_back(find_material(s.scene, body.material).viscosity);
    if (is_surface && !s.wounds.empty()) {
      viscosity.back() = std::max(viscosity.back(), kLeastOfCuts);
    }
  }
  if (s.damped_for == 0) find_dampers(s, viscosity);
  s.damped_for = duration;
  const int count = s.dampers.size();
  s.cpu.for_each((count + kEdgesOfPart - 1) / kEdgesOfPart, [&](int part) {
    for (int c = part * kEdgesOfPart; c < std::min(count, (part + 1) * kEdgesOfPart); ++c) {
      const auto [a, b] = s.dampers.vertices[c];
      const double own = viscosity[s.vertices.body[a]];
      const double l2 = (s.vertices.reference[a] - s.vertices.reference[b]).squaredNorm();
      // Tissue between the two drags at the lighter one as if both were as heavy: tips of spikes
      // swung for seconds.
      const double m = s.vertices.mass[a], n = s.vertices.mass[b];
      const double uneven = (m + n) * (m + n) / (4 * m * n);
      const double least = is_surface ? kLeastRate * std::min(own, 1.0) : 0;
      const double rate = std::max(own / (kDensity * l2), least);
      s.dampers.numbers[c][0] = static_cast<float>(1 - std::exp(-rate * duration * uneven));
    }
  });
  s.dampers.pack(s.vertices.size(), levels_of(s), 0);
  return count > 0;
}

void damp_neighbours(State& s, double duration) {
  if (!make_dampers(s, duration)) return;
  const std::vector<Flight> before = flights(s);
  std::vector<Vec3> spins;
  for (const Flight& f : before) spins.push_back(spin_of(f, f.angular));
  Vertices& v = s.vertices;
  for (int i = 0; i < v.size(); ++i) {
    turn(v, i, before[s.component[i]], -spins[s.component[i]]);
  }
  project_dampers(s);
  // Pushes across an edge turn what they act on: back.
  const std::vector<Flight> after = flights(s);
  for (std::size_t c = 0; c < spins.size(); ++c) {
    spins[c] +=
        spin_of(after[c], before[c].angular - before[c].inertia * spins[c] - after[c].angular);
  }
  for (int i = 0; i < v.size(); ++i) {
    turn(v, i, after[s.component[i]], spins[s.component[i]]);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
