// One step: predict, project, take velocities from where vertices are.
#include <cmath>
#include <numeric>

#include "pbd/pbd_pieces.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kVerticesOfPart = 2048, kConstraintsOfPart = 2048;
/// Fewer vertices than this are in a processor's cache anyway.
constexpr int kLeastChunked = 8192;

template <class F>
void for_vertices(State& s, const F& f) {
  const int n = s.vertices.size();
  s.cpu.for_each((n + kVerticesOfPart - 1) / kVerticesOfPart, [&](int part) {
    const int end = std::min(n, (part + 1) * kVerticesOfPart);
    for (int i = part * kVerticesOfPart; i < end; ++i) f(i);
  });
}

/// One colour after the other, or `backward`: chunks of a level side by side, and of the last
/// level, which is one chunk, `blocks_of_part` of a colour. `moved`: what it changes.
template <class Kind>
void project_all(State& s, ConstraintSet<Kind>& set, Project<Kind> project, int blocks_of_part,
                 float inverse_h2, bool keep, bool backward, float* moved) {
  if (set.blocks.empty()) return;
  const auto run = [&](int first, int n) {
    float* multipliers = nullptr;
    if (keep && Kind::kMultipliers > 0) {
      multipliers = set.multipliers.data() +
                    static_cast<std::size_t>(first) * ConstraintSet<Kind>::kMultipliers * kLanes;
    }
    project(set.blocks.data() + first, n, inverse_h2, s.vertices.x.data(), moved, multipliers);
  };
  const int levels = static_cast<int>(set.chunks.size());
  const auto project_level = [&](int level) {
    const std::int32_t* begin = set.begin.data();
    for (int l = 0; l < level; ++l) begin += set.chunks[l] * set.colours;
    if (level + 1 < levels) {
      s.cpu.for_each(set.chunks[level], [&](int chunk) {
        const std::int32_t* of = begin + chunk * set.colours;
        for (int k = 0; k < set.colours; ++k) {
          const int c = backward ? set.colours - 1 - k : k;
          if (of[c + 1] > of[c]) run(of[c], of[c + 1] - of[c]);
        }
      });
      return;
    }
    for (int k = 0; k < set.colours; ++k) {
      const int c = backward ? set.colours - 1 - k : k, count = begin[c + 1] - begin[c];
      if (count < 2 * blocks_of_part) {
        const FlushDenormals flush;
        run(begin[c], count);
        continue;
      }
      s.cpu.for_each((count + blocks_of_part - 1) / blocks_of_part, [&](int part) {
        const int first = part * blocks_of_part;
        run(begin[c] + first, std::min(blocks_of_part, count - first));
      });
    }
  };
  for (int l = 0; l < levels; ++l) project_level(backward ? levels - 1 - l : l);
}

template <class Kind>
void project_all(State& s, ConstraintSet<Kind>& set, Project<Kind> project, int blocks_of_part,
                 float inverse_h2, bool keep, bool backward) {
  project_all(s, set, project, blocks_of_part, inverse_h2, keep, backward, s.vertices.moved.data());
}

template <class Kind>
void forget(ConstraintSet<Kind>& set) {
  std::fill(set.multipliers.begin(), set.multipliers.end(), 0.0f);
}

}  // namespace

StepNumbers step_numbers(const Scene& scene, float h) {
  const Vec3& g = scene.gravity;
  return {h,
          1 / h,
          1 / (h * h),
          static_cast<float>(std::exp(-scene.damping * h)),
          {static_cast<float>(g.x()), static_cast<float>(g.y()), static_cast<float>(g.z())}};
}

void project_constraints(State& s, float h, bool keep, bool backward) {
  const float inverse_h2 = 1 / (h * h);
  const auto tetrahedra = [&] {
    project_all(s, s.elastics, s.project->elastic, 32, inverse_h2, keep, backward);
    project_all(s, s.strains, s.project->strain, 32, inverse_h2, false, backward);
  };
  if (!backward) tetrahedra();
  if (!backward) project_all(s, s.links, s.project->distance, 128, inverse_h2, keep, false);
  project_all(s, s.bends, s.project->bending, 32, inverse_h2, keep, backward);
  if (backward) project_all(s, s.links, s.project->distance, 128, inverse_h2, keep, true);
  if (backward) tetrahedra();
}

void project_dampers(State& s) {
  project_all(s, s.dampers, s.project->damper, 128, 0, false, false, s.vertices.v.data());
}

std::vector<std::int32_t> levels_of(const State& s) {
  return s.vertices.size() < kLeastChunked ? std::vector<std::int32_t>() : s.levels;
}

int sweeps_of_step(const State& s) {
  const int asked = s.scene.pbd.iterations;
  const bool is_cut_surface = s.tetrahedra.empty() && !s.wounds.empty();
  return is_cut_surface ? asked + asked % 2 : asked;
}

void step(State& s, float h, std::vector<ColliderLoad>& loads) {
  Vertices& vertices = s.vertices;
  float *x = vertices.x.data(), *moved = vertices.moved.data();
  float *predicted = vertices.predicted.data(), *v = vertices.v.data();
  const StepNumbers numbers = step_numbers(s.scene, h);
  for_vertices(
      s, [&](int i) { predict(numbers, x + 4 * i, moved + 4 * i, predicted + 4 * i, v + 4 * i); });
  const int sweeps = sweeps_of_step(s);
  const bool keep = sweeps > 1;
  if (keep) {
    forget(s.links);
    forget(s.bends);
    forget(s.elastics);
  }
  for (int i = 0; i < sweeps; ++i) project_constraints(s, h, keep, i % 2 == 1);
  project_all(s, s.touches, s.project->touch, 32, 1 / (h * h), false, false);
  project_contacts(s, h, loads);
  for_vertices(s, [&](int i) {
    take_velocity(numbers, x + 4 * i, moved + 4 * i, predicted + 4 * i, v + 4 * i);
  });
}

int add_vertex(State& s, Vec3 reference, int body) {
  Vertices& v = s.vertices;
  const int index = v.size();
  v.reference.push_back(reference);
  v.mass.push_back(0);
  v.volume.push_back(0);
  v.body.push_back(static_cast<std::int16_t>(body));
  v.anchored.push_back(0);
  v.surface.push_back(0);
  v.cut_links.push_back(0);
  v.whole_links.push_back(0);
  s.half_depth.push_back(0);
  s.stroke.push_back(-1);
  s.copy_of.push_back(index);
  s.blade_normal.push_back(Vec3::Zero());
  s.blade_point.push_back(reference);
  for (Array<float>* of : {&v.x, &v.moved, &v.predicted, &v.v})
    of->resize(4 * (index + 1));  // cuts padding
  for (int a = 0; a < 3; ++a) {
    v.x[4 * index + a] = static_cast<float>(reference[a]);
  }
  return index;
}

void pack(State& s) {
  Vertices& v = s.vertices;
  const int n = v.size();
  for (Array<float>* of : {&v.x, &v.moved, &v.predicted, &v.v}) {
    of->resize(4 * n);
    of->resize(4 * (n + kPadding), 0.0f);
  }
  for (int i = 0; i < n; ++i) {
    v.x[4 * i + 3] = v.anchored[i] != 0 ? 0.0f : static_cast<float>(1 / v.mass[i]);
  }
  for (int lane = 0; lane < kLanes; ++lane) {  // the corners of a tetrahedron: nothing is 0 / 0
    for (int k = 1; k < 4; ++k) v.x[4 * (n + 4 * lane + k) + k - 1] = 1;
  }
  UnionFind linked = joined(s);
  s.component.resize(n);
  s.pushed.assign(n, 0);
  s.components = 0;
  for (int i = 0; i < n; ++i) {  // the root is the lowest, and has its number
    const std::int32_t root = linked.root(i);
    s.component[i] = root == i ? s.components++ : s.component[root];
  }
  find_held(s);
  const std::vector<std::int32_t> levels = levels_of(s);
  s.cpu.for_each(4, [&](int set) {
    if (set == 0) s.links.pack(n, levels);
    if (set == 1) s.bends.pack(n, levels);
    if (set == 2) s.strains.pack(n, levels);
    if (set == 3) s.elastics.pack(n, levels);
  });
  s.damped_for = 0;
}

namespace {

/// The same on any number of threads: summed up one by one.
template <class Kind>
double sum_energy(State& s, const ConstraintSet<Kind>& set) {
  const int count = set.size();
  std::vector<double> of(count);
  s.cpu.for_each((count + kConstraintsOfPart - 1) / kConstraintsOfPart, [&](int part) {
    for (int c = part * kConstraintsOfPart; c < std::min(count, (part + 1) * kConstraintsOfPart);
         ++c) {
      Vertex<float> v[Kind::kVertices];
      for (int i = 0; i < Kind::kVertices; ++i) {
        const std::size_t at = 4 * static_cast<std::size_t>(set.vertices[c][i]);
        const float *x = &s.vertices.x[at], *moved = &s.vertices.moved[at];
        v[i] = {x[0], x[1], x[2], x[3], {moved[0], moved[1], moved[2]}};
      }
      float number[Kind::kNumbers];
      std::copy(set.numbers[c].begin(), set.numbers[c].end(), number);
      of[c] = Kind::energy(v, number);
    }
  });
  return std::accumulate(of.begin(), of.end(), 0.0);
}

}  // namespace

double elastic_energy(State& s) {
  return sum_energy(s, s.links) + sum_energy(s, s.bends) + sum_energy(s, s.elastics);
}

}  // namespace pbd
}  // namespace tissue_sim
