#include "pbd/sound_cut.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "pbd/pbd_pieces.h"
#include "pbd/surface_mesh.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// How far aside a cut is tried again [mean edges].
constexpr double kAside[] = {0, 0.1, -0.1};

/// All of a surface model that a cut changes before constraints are made anew.
struct Mesh {
  explicit Mesh(const State& s)
      : vertices(s.vertices),
        triangles(s.triangles),
        internal(s.internal),
        half_depth(s.half_depth),
        stroke(s.stroke),
        copy_of(s.copy_of),
        bare(s.bare),
        blade_normal(s.blade_normal),
        blade_point(s.blade_point),
        cut_edges(s.cut_edges),
        wounds(s.wounds.size()) {}
  void restore(State& s) const {
    s.vertices = vertices;
    s.triangles = triangles;
    s.internal = internal;
    s.half_depth = half_depth;
    s.stroke = stroke;
    s.copy_of = copy_of;
    s.bare = bare;
    s.blade_normal = blade_normal;
    s.blade_point = blade_point;
    s.cut_edges = cut_edges;
    s.wounds.resize(wounds);
  }

  Vertices vertices;
  std::vector<Triangle> triangles;
  std::vector<InternalPair> internal;
  std::vector<double> half_depth;
  std::vector<std::int32_t> stroke, copy_of, bare;
  std::vector<Vec3> blade_normal, blade_point;
  std::set<std::array<std::int32_t, 2>> cut_edges;
  std::size_t wounds;
};

struct Piece {
  Vec3 first = Vec3::Zero(), normal = Vec3::Zero();  ///< twice the sum of area times normal [m^2]
  double area = 0, six_volumes = 0;
  double angle = 4, edge = 1e300;  ///< least [rad, m]
  std::int32_t vertex = -1;        ///< one of its own

  double hole() const { return normal.norm() / area; }
};

/// By the root of what hangs together.
std::map<std::int32_t, Piece> measure(const State& s, UnionFind& linked) {
  std::map<std::int32_t, Piece> pieces;
  const auto& x = s.vertices.reference;
  for (const Triangle& t : s.triangles) {
    Piece& p = pieces[linked.root(t[0])];
    if (p.vertex < 0) p.first = x[t[0]];
    p.vertex = t[0];
    const Vec3 n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    p.normal += n;
    p.area += n.norm();
    p.six_volumes += n.dot(x[t[0]] - p.first);
    p.angle = std::min(p.angle, smallest_angle(x[t[0]], x[t[1]], x[t[2]]));
    for (int i = 0; i < 3; ++i) p.edge = std::min(p.edge, (x[t[i]] - x[t[(i + 1) % 3]]).norm());
  }
  return pieces;
}

class SoundCut {
 public:
  SoundCut(State& s, std::vector<std::int32_t>& origin) : s_(s), origin_(origin) {
    UnionFind linked = joined(s);
    before_ = measure(s, linked);
    for (int v = 0; v < s.vertices.size(); ++v) piece_.push_back(linked.root(v));
    // What is too small to be parted needs no look.
    const double least = SoundMesh::kLeastCut * std::pow(s.mean_edge, 3);
    for (const auto& [root, p] : before_) {
      if (!is_closed_body(p) || p.six_volumes / 6 > least) open_.insert(root);
    }
  }

  /// Cuts the pieces that are left but for those that this would make unsound, which are left then.
  bool run(const BladePath& path, const Array<float>& before, int stroke, CutReport& report) {
    std::set<std::int32_t> later;
    while (!open_.empty()) {
      const Mesh mesh(s_);
      const std::size_t made = origin_.size();
      const CutReport told = report;
      std::vector<std::uint8_t> whole;
      for (int v = 0; v < s_.vertices.size(); ++v) whole.push_back(open_.count(piece_of(v)) == 0);
      if (!cut_surface(s_, path, before, stroke, origin_, report, &whole)) {
        open_.swap(later);
        return false;
      }
      after_cut(s_, origin_);
      const std::set<std::int32_t> bad = unsound();
      if (bad.empty()) {
        open_.swap(later);
        return true;
      }
      mesh.restore(s_);
      origin_.resize(made);
      report = told;
      for (const std::int32_t p : bad) {
        open_.erase(p);
        later.insert(p);
      }
    }
    open_.swap(later);
    return false;
  }

  bool is_done() const { return open_.empty(); }

 private:
  bool is_closed_body(const Piece& p) const { return s_.closed_body[s_.vertices.body[p.vertex]]; }

  /// The piece that a vertex belonged to before the cut.
  std::int32_t piece_of(std::int32_t v) const {
    const auto count = static_cast<std::int32_t>(piece_.size());
    while (v >= count) v = origin_[origin_.size() - (s_.vertices.size() - v)];
    return piece_[v];
  }

  /// Pieces, as they were, that were cut and of which something is no longer sound.
  std::set<std::int32_t> unsound() const {
    UnionFind linked = joined(s_);
    std::set<std::int32_t> bad;
    const std::map<std::int32_t, Piece> now = measure(s_, linked);
    std::map<std::int32_t, double> gained;  // volume of each [m^3]
    for (const auto& [root, p] : now)
      gained[piece_of(p.vertex)] += std::max(0.0, p.six_volumes / 6);
    for (const auto& [root, p] : now) {
      const std::int32_t of = piece_of(p.vertex);
      if (open_.count(of) == 0) continue;
      const Piece& was = before_.at(of);
      bool is_sound = p.angle >= std::min(was.angle, SoundMesh::kLeastAngle) &&
                      p.edge >= std::min(was.edge, SoundMesh::kLeastEdge * s_.mean_edge);
      if (is_closed_body(p)) {
        is_sound = is_sound && p.hole() <= std::max(was.hole(), SoundMesh::kLargestHole);
      }
      if (!is_sound) bad.insert(of);
    }
    // Walls on both sides of a wound are the same surface, or nearly so.
    std::vector<double> excess(s_.volume_of_body.size(), 0.0);
    for (auto& [of, volume] : gained) {
      const Piece& was = before_.at(of);
      volume -= was.six_volumes / 6;
      excess[s_.vertices.body[was.vertex]] += was.six_volumes / 6 + volume;
    }
    for (const auto& [of, volume] : gained) {
      const Piece& was = before_.at(of);
      const int body = s_.vertices.body[was.vertex];
      const double all = s_.volume_of_body[body], over = excess[body] - all;
      if (!is_closed_body(was) || std::fabs(over) < SoundMesh::kVolumeError * all) continue;
      if (open_.count(of) != 0 && over * volume > 0 && std::fabs(volume) > 1e-6 * all)
        bad.insert(of);
    }
    return bad;
  }

  State& s_;
  std::vector<std::int32_t>& origin_;
  std::map<std::int32_t, Piece> before_;
  std::vector<std::int32_t> piece_;
  std::set<std::int32_t> open_;  ///< pieces that are to be cut
};

/// Square to the blade's first way and its edge.
Vec3 aside(const BladePath& path) {
  const Pose &first = path.poses.front(), &last = path.poses.back();
  const Vec3 edge = first.orientation * Vec3(path.edge.back() - path.edge.front());
  return edge.cross(Vec3(last.position - first.position)).stableNormalized();
}

}  // namespace

bool cut_soundly(State& s, const BladePath& path, const Array<float>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report) {
  SoundCut cut(s, origin);
  bool changed = false;
  for (const double far : kAside) {
    BladePath moved = path;
    for (Pose& pose : moved.poses) pose.position += far * s.mean_edge * aside(path);
    changed = cut.run(moved, before, stroke, report) || changed;
    if (cut.is_done()) break;
  }
  return changed;
}

}  // namespace pbd
}  // namespace tissue_sim
