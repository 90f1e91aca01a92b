#include "pbd/pbd_pieces.h"

#include <algorithm>
#include <map>

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
  std::vector<double> columns(pieces.next_id, 0.0), enclosed(pieces.next_id, 0.0);
  for (int i = 0; i < s.vertices.size(); ++i) {
    columns[pieces.of_point[i]] += s.vertices.volume[i];
  }
  if (!s.tetrahedra.empty()) return columns;
  std::map<std::pair<std::int32_t, std::int32_t>, int> turns;  // along each edge, from low to high
  for (const Triangle& t : s.triangles) {
    const auto& x = s.vertices.reference;
    enclosed[pieces.of_point[t[0]]] += x[t[0]].cross(x[t[1]]).dot(x[t[2]]) / 6;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t a = t[k], b = t[(k + 1) % 3];
      turns[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  std::vector<bool> open(pieces.next_id, false);
  for (const auto& [edge, sum] : turns) {
    if (sum != 0) open[pieces.of_point[edge.first]] = true;
  }
  for (int id = 0; id < pieces.next_id; ++id) {
    if (!open[id] && enclosed[id] > 0) columns[id] = enclosed[id];
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
