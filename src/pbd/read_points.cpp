// What the tissue shows: clouds and its surface.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "fragments/piece_colour.h"
#include "frame/point_fields.h"
#include "frame/put_faces.h"
#include "frame/select_points.h"
#include "pbd/model.h"
#include "pbd/pbd_tissue.h"

namespace tissue_sim {
namespace {

using namespace pbd;  // NOLINT: this file reads its state

/// Von Mises stress of a tetrahedron's material, of the Cauchy stress [Pa].
double von_mises(const State& s, const Tetrahedron& t, const Material& m) {
  Eigen::Matrix3d p, q;
  for (int i = 0; i < 3; ++i) {
    p.col(i) = s.vertices.position(t[i + 1]) - s.vertices.position(t[0]);
    q.col(i) = s.vertices.reference[t[i + 1]] - s.vertices.reference[t[0]];
  }
  const Eigen::Matrix3d f = p * q.inverse();
  const double j = f.determinant();
  if (!(std::fabs(j) > 1e-6)) return 0;
  const Eigen::Matrix3d b = lame_mu(m) / j * f * f.transpose();
  const Eigen::Matrix3d d = b - b.trace() / 3 * Eigen::Matrix3d::Identity();
  return std::sqrt(1.5 * d.squaredNorm());
}

/// Of each vertex: the mean of its tetrahedra; of the surface model, E times the mean strain of its
/// links, which is what a stress is there [Pa].
std::vector<float> stresses(const State& s) {
  std::vector<double> sum(s.vertices.size(), 0.0), weight(s.vertices.size(), 0.0);
  const auto add = [&](std::int32_t v, double stress, double w) {
    sum[v] += w * stress;
    weight[v] += w;
  };
  for (const Tetrahedron& t : s.tetrahedra) {
    const Body& body = s.scene.bodies[s.vertices.body[t[0]]];
    const Material& m = material_at(s.scene, body, s.vertices.reference[t[0]]);
    const double stress = von_mises(s, t, m);
    for (const std::int32_t v : t) add(v, stress, 1);
  }
  for (int c = 0; s.tetrahedra.empty() && c < s.links.size(); ++c) {
    const auto& l = s.links.vertices[c];
    const Body& body = s.scene.bodies[s.vertices.body[l[0]]];
    const Material& m = material_at(s.scene, body, s.vertices.reference[l[0]]);
    const double length = (s.vertices.position(l[0]) - s.vertices.position(l[1])).norm();
    const double stress = m.young_modulus * std::fabs(length / s.links.numbers[c][0] - 1);
    for (const std::int32_t v : l) add(v, stress, 1);
  }
  std::vector<float> result(s.vertices.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] = static_cast<float>(weight[i] > 0 ? sum[i] / weight[i] : 0);
  }
  return result;
}

}  // namespace

int PbdTissue::read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) {
  check_fields(selection, point_fields());
  pull();
  const State& s = *state_;
  const std::vector<float> stress = stresses(s);
  int count = 0;
  const std::vector<std::int32_t> place = select_points(
      selection, pieces_, [&s](std::int32_t p) { return s.vertices.surface[p] != 0; }, count);
  const std::vector<const Fragment*> piece = pieces_by_id(pieces_);
  cloud.resize(static_cast<std::size_t>(count) * sizeof(Point));
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (place[i] < 0) continue;
    const Fragment& f = *piece[pieces_.of_point[i]];
    Point out;
    out.x = s.vertices.x[4 * i];
    out.y = s.vertices.x[4 * i + 1];
    out.z = s.vertices.x[4 * i + 2];
    out.rgb = piece_colour(f);
    out.id = static_cast<std::uint32_t>(i);
    out.fragment = f.id;
    out.stress = stress[i];
    const auto lost = static_cast<float>(s.vertices.cut_links[i]);
    out.damage = lost > 0 ? lost / (lost + static_cast<float>(s.vertices.whole_links[i])) : 0.0f;
    std::memcpy(cloud.data() + static_cast<std::size_t>(place[i]) * sizeof(Point), &out,
                sizeof(Point));
  }
  add_fields(selection, place, count, state_->cpu, cloud, [&v = s.vertices](int i) {
    return tissue_sim::point_fields(v.reference[i], v.position(i), v.velocity(i), v.volume[i]);
  });
  return count;
}

void PbdTissue::read_surface(SurfaceTriangles& surface) {
  pull();
  State& s = *state_;
  put_triangles(s.triangles.size(), s.cpu, surface, [&](int i) {
    const Triangle& of = s.triangles[i];
    ShownTriangle t{{}, {}, pieces_.of_point[of[0]], of[0], s.cut[i]};
    for (int k = 0; k < 3; ++k) {
      t.corner[k] = &s.vertices.x[std::size_t{4} * of[k]];
      t.rest[k] = floats(s.vertices.reference[of[k]]);
    }
    return t;
  });
}

void PbdTissue::push_surface(Span<const float> impulses) {
  pull();
  pbd::Vertices& v = state_->vertices;
  const float* impulse = impulses.data();
  for (const Triangle& t : state_->triangles) {
    for (const std::int32_t i : t) {
      for (int a = 0; a < 3; ++a) v.v[4 * i + a] += v.x[4 * i + 3] * impulse[a];
    }
    impulse += 3;
  }
  push();
}

}  // namespace tissue_sim
