// What anchors hold: it goes with them, and what tissue does to them.
#include <algorithm>

#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Of all bodies' anchors, the first of a body's.
std::vector<int> first_anchors(const Scene& scene) {
  std::vector<int> first = {0};
  for (const Body& body : scene.bodies) {
    first.push_back(first.back() + static_cast<int>(body.anchors.size()));
  }
  return first;
}

/// Adds what a projection of those constraints that have a held vertex would push that one by, as
/// an impulse over the step: w is as good as 0 there, as it is for the constraint.
template <class Kind>
void add_pushes(const State& s, const ConstraintSet<Kind>& set, bool once, float inverse_h2,
                std::vector<Vec3>& force) {
  constexpr float kHeld = 1e-4f;  // of the mean of all corners
  for (int c = 0; c < set.size(); ++c) {
    const auto& corners = set.vertices[c];
    const auto is_held = [&](std::int32_t v) { return s.vertices.anchored[v] != 0; };
    if (std::none_of(corners.begin(), corners.end(), is_held)) continue;
    Vertex<float> v[Kind::kVertices];
    float number[Kind::kNumbers], lambda[ConstraintSet<Kind>::kMultipliers] = {};
    std::copy(set.numbers[c].begin(), set.numbers[c].end(), number);
    float mean = 0;
    for (int i = 0; i < Kind::kVertices; ++i) {
      const std::size_t at = 4 * static_cast<std::size_t>(corners[i]);
      const float *x = &s.vertices.x[at], *moved = &s.vertices.moved[at];
      v[i] = {x[0], x[1], x[2], x[3], {moved[0], moved[1], moved[2]}};
      mean += x[3] / Kind::kVertices;
    }
    if (mean == 0) continue;  // all are held
    for (Vertex<float>& at : v) {
      if (at.w == 0) at.w = kHeld * mean;
      // From where it is: what is left of earlier steps is no push.
      at.x += at.moved.x, at.y += at.moved.y, at.z += at.moved.z;
      at.moved = {0, 0, 0};
    }
    if (once) {
      project_kind<Kind, false>(v, number, inverse_h2, lambda);
    } else {
      project_kind<Kind, true>(v, number, inverse_h2, lambda);
    }
    for (int i = 0; i < Kind::kVertices; ++i) {
      if (!is_held(corners[i])) continue;
      const Vec3 moved(v[i].moved.x, v[i].moved.y, v[i].moved.z);
      force[corners[i]] += inverse_h2 / v[i].w * moved;
    }
  }
}

}  // namespace

double rounding_of(const State& s, int b) {
  Box box;
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (s.vertices.body[i] != b) continue;
    box.min = box.min.cwiseMin(s.vertices.reference[i]);
    box.max = box.max.cwiseMax(s.vertices.reference[i]);
  }
  return 1e-6 * (box.max - box.min).norm();
}

int holder_of(const Body& body, const Vec3& x, double within) {
  for (std::size_t a = 0; a < body.anchors.size(); ++a) {
    Region wide = body.anchors[a];
    wide.min -= Vec3::Constant(within);
    wide.max += Vec3::Constant(within);
    wide.radius += within;
    wide.z += within;
    if (wide.contains(x)) return static_cast<int>(a);
  }
  return -1;
}

void find_held(State& s) {
  s.held.clear();
  s.holder.clear();
  std::vector<double> within;
  for (std::size_t b = 0; b < s.scene.bodies.size(); ++b) {
    within.push_back(rounding_of(s, static_cast<int>(b)));
  }
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (s.vertices.anchored[i] == 0) continue;
    const int b = s.vertices.body[i];
    s.held.push_back(i);
    // What cuts made between two that are held may lie in no anchor: it goes with the first.
    s.holder.push_back(
        std::max(0, holder_of(s.scene.bodies[b], s.vertices.reference[i], within[b])));
  }
}

bool follow_anchors(State& s, Span<const AnchorMotion> anchors, double duration) {
  if (anchors.empty()) return false;
  const std::vector<int> first = first_anchors(s.scene);
  bool any = false;
  for (std::size_t k = 0; k < s.held.size(); ++k) {
    const std::int32_t i = s.held[k];
    const int b = s.vertices.body[i];
    const AnchorMotion& motion = anchors[first[b] + s.holder[k]];
    const bool stays = motion.begin.position == motion.end.position &&
                       motion.begin.orientation.coeffs() == motion.end.orientation.coeffs();
    const Vec3 there = motion.end.position +
                       motion.end.orientation * (s.vertices.reference[i] -
                                                 s.scene.bodies[b].anchors[s.holder[k]].origin());
    const Vec3 v = stays ? Vec3::Zero() : Vec3((there - s.vertices.position(i)) / duration);
    for (int a = 0; a < 3; ++a) {
      const auto speed = static_cast<float>(v[a]);
      any = any || s.vertices.v[4 * i + a] != speed;
      s.vertices.v[4 * i + a] = speed;
    }
  }
  return any;
}

std::vector<Wrench> anchor_loads(const State& s, Span<const AnchorMotion> anchors, float h) {
  const std::vector<int> first = first_anchors(s.scene);
  std::vector<Wrench> loads(first.back());
  if (s.held.empty()) return loads;
  std::vector<Vec3> force(s.vertices.size(), Vec3::Zero());
  const float inverse_h2 = 1 / (h * h);
  const bool once = sweeps_of_step(s) == 1;
  add_pushes(s, s.elastics, once, inverse_h2, force);
  add_pushes(s, s.strains, once, inverse_h2, force);
  add_pushes(s, s.links, once, inverse_h2, force);
  add_pushes(s, s.bends, once, inverse_h2, force);
  for (const Tetrahedron& t : s.tetrahedra) {  // the weight of what is not held, at what is
    const auto held = std::count_if(t.begin(), t.end(),
                                    [&](std::int32_t v) { return s.vertices.anchored[v] != 0; });
    if (held == 0 || held == 4) continue;
    const auto& x = s.vertices.reference;
    const double volume = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) / 6;
    const Vec3 centre = 0.25 * (x[t[0]] + x[t[1]] + x[t[2]] + x[t[3]]);
    const Material& m = material_at(s.scene, s.scene.bodies[s.vertices.body[t[0]]], centre);
    for (const std::int32_t v : t) force[v] += 0.25 * m.density * volume * s.scene.gravity;
  }
  for (std::size_t k = 0; k < s.held.size(); ++k) {
    const std::int32_t i = s.held[k];
    const int b = s.vertices.body[i], a = first[b] + s.holder[k];
    const Vec3 origin =
        anchors.empty() ? s.scene.bodies[b].anchors[s.holder[k]].origin() : anchors[a].end.position;
    loads[a].force += force[i];
    loads[a].torque += (s.vertices.position(i) - origin).cross(force[i]);
  }
  return loads;
}

}  // namespace pbd
}  // namespace tissue_sim
