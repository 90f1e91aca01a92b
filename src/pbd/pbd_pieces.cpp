#include "pbd/pbd_pieces.h"

#include <algorithm>

#include "fragments/piece_sums.h"

namespace tissue_sim {
namespace pbd {

UnionFind skins(const State& s) {
  UnionFind linked(s.vertices.size());
  for (const Triangle& t : s.triangles) {
    linked.join(t[0], t[1]);
    linked.join(t[0], t[2]);
  }
  return linked;
}

UnionFind joined(const State& s) {
  UnionFind linked = skins(s);
  for (const Tetrahedron& t : s.tetrahedra) {
    for (int i = 1; i < 4; ++i) linked.join(t[0], t[i]);
  }
  for (const InternalPair& p : s.internal) linked.join(p.a, p.b);
  return linked;
}

namespace {

std::vector<float> volumes(const State& s) {
  return {s.vertices.volume.begin(), s.vertices.volume.end()};
}

}  // namespace

Pieces whole_pieces(const State& s) {
  const std::vector<float> volume = volumes(s);
  PiecePoints points;
  points.count = s.vertices.size();
  points.body = [&s](std::int32_t p) { return static_cast<int>(s.vertices.body[p]); };
  points.volume = volume.data();
  points.anchored = s.vertices.anchored.data();
  Pieces pieces = one_piece_a_body(static_cast<int>(s.scene.bodies.size()), points);
  update_pieces(s, {}, pieces);
  return pieces;
}

std::vector<int> update_pieces(const State& s, const std::vector<std::int32_t>& origin,
                               Pieces& pieces) {
  for (const std::int32_t from : origin) {
    const int id = pieces.of_point[from];
    if (s.vertices.anchored[from] != 0) {
      pieces.anchored.push_back(static_cast<std::int32_t>(pieces.of_point.size()));
    }
    pieces.of_point.push_back(id);
    for (Fragment& f : pieces.all) f.point_count += f.id == id ? 1 : 0;
  }
  const std::vector<float> volume = volumes(s);
  UnionFind linked = joined(s);
  std::vector<int> fresh = tissue_sim::update_pieces(volume.data(), linked, pieces);
  const std::vector<double> of = piece_volumes(s, pieces);
  for (Fragment& f : pieces.all) f.volume = of[f.id];
  return fresh;
}

std::vector<double> piece_volumes(const State& s, const Pieces& pieces) {
  std::vector<double> columns(pieces.next_id, 0.0);
  std::vector<int> body(pieces.next_id, 0);
  for (int i = 0; i < s.vertices.size(); ++i) {
    columns[pieces.of_point[i]] += s.vertices.volume[i];
    body[pieces.of_point[i]] = s.vertices.body[i];
  }
  if (!s.tetrahedra.empty()) return columns;
  struct Skin {
    Vec3 first = Vec3::Zero(), normal = Vec3::Zero();  // twice the sum of area times normal
    double area = 0, six_volumes = 0;
  };
  std::vector<Skin> skins(pieces.next_id);
  for (const Triangle& t : s.triangles) {
    const auto& x = s.vertices.reference;
    Skin& skin = skins[pieces.of_point[t[0]]];
    if (skin.area == 0) skin.first = x[t[0]];
    const Vec3 n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    skin.normal += n;
    skin.area += n.norm();
    skin.six_volumes += n.dot(x[t[0]] - skin.first);
  }
  // The lips of a slit lie on one another: together they are closed.
  std::vector<double> left = s.volume_of_body, open(s.volume_of_body.size(), 0.0);
  const auto is_closed = [&](int id) {
    return s.closed_body[body[id]] != 0 && skins[id].six_volumes > 0 &&
           skins[id].normal.norm() < 1e-3 * skins[id].area;
  };
  for (int id = 0; id < pieces.next_id; ++id) {
    if (is_closed(id)) left[body[id]] -= skins[id].six_volumes / 6;
    if (!is_closed(id)) open[body[id]] += columns[id];
  }
  for (int id = 0; id < pieces.next_id; ++id) {
    if (is_closed(id)) {
      columns[id] = skins[id].six_volumes / 6;
    } else if (columns[id] > 0) {  // what the closed ones leave
      columns[id] *= std::max(0.0, left[body[id]]) / open[body[id]];
    }
  }
  return columns;
}

void measure_pieces(const State& s, Pieces& pieces) {
  const Vertices& v = s.vertices;
  std::vector<SumsByPiece> sums(1);
  for (int i = 0; i < v.size(); ++i) {
    sums[0].of(pieces.of_point[i]).add(v.mass[i], v.position(i), v.velocity(i));
  }
  set_motion(sums, pieces);
}

}  // namespace pbd
}  // namespace tissue_sim
