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
/// For how long an instrument's cut is tried again [poses]; tissue moves meanwhile.
constexpr std::size_t kMostPoses = 16;

/// All of a surface model that a cut changes before constraints are made anew.
struct Mesh {
  explicit Mesh(const State& s)
      : vertices(s.vertices),
        triangles(s.triangles),
        cut(s.cut),
        internal(s.internal),
        half_depth(s.half_depth),
        stroke(s.stroke),
        copy_of(s.copy_of),
        bare(s.bare),
        blade_normal(s.blade_normal),
        blade_point(s.blade_point),
        cut_edges(s.cut_edges),
        fronts(s.fronts),
        starts(s.starts),
        wounds(s.wounds.size()) {}
  void restore(State& s) const {
    s.vertices = vertices;
    s.triangles = triangles;
    s.cut = cut;
    s.internal = internal;
    s.half_depth = half_depth;
    s.stroke = stroke;
    s.copy_of = copy_of;
    s.bare = bare;
    s.blade_normal = blade_normal;
    s.blade_point = blade_point;
    s.cut_edges = cut_edges;
    s.fronts = fronts;
    s.starts = starts;
    s.wounds.resize(wounds);
  }

  Vertices vertices;
  std::vector<Triangle> triangles;
  std::vector<std::uint8_t> cut;
  std::vector<InternalPair> internal;
  std::vector<double> half_depth;
  std::vector<std::int32_t> stroke, copy_of, bare;
  std::vector<Vec3> blade_normal, blade_point;
  std::set<std::array<std::int32_t, 2>> cut_edges;
  std::vector<std::set<std::int32_t>> fronts, starts;
  std::size_t wounds;
};

struct Piece {
  Vec3 first = Vec3::Zero(), normal = Vec3::Zero();  ///< twice the sum of area times normal [m^2]
  double area = 0, six_volumes = 0;
  double angle = 4, edge = 1e300;  ///< least [rad, m]
  double slope = -1e300;           ///< cotangent of the least angle
  std::int32_t vertex = -1;        ///< one of its own

  double hole() const { return normal.norm() / area; }
};

/// By the root of what hangs together.
std::map<std::int32_t, Piece> measure(const State& s, UnionFind& linked) {
  std::map<std::int32_t, Piece> pieces;
  std::vector<Piece*> of_root(s.vertices.size(), nullptr);
  const auto& x = s.vertices.reference;
  for (const Triangle& t : s.triangles) {
    const std::int32_t root = linked.root(t[0]);
    if (of_root[root] == nullptr) of_root[root] = &pieces[root];
    Piece& p = *of_root[root];
    if (p.vertex < 0) p.first = x[t[0]];
    p.vertex = t[0];
    const Vec3 n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    const double area = n.norm();
    p.normal += n;
    p.area += area;
    p.six_volumes += n.dot(x[t[0]] - p.first);
    for (int i = 0; i < 3; ++i) {
      const Vec3 e = x[t[(i + 1) % 3]] - x[t[i]], f = x[t[(i + 2) % 3]] - x[t[i]];
      p.edge = std::min(p.edge, e.squaredNorm());
      p.slope = std::max(p.slope, e.dot(f) / area);
    }
  }
  for (auto& [root, p] : pieces) {
    p.edge = std::sqrt(p.edge);
    p.angle = std::atan2(1.0, p.slope);
  }
  return pieces;
}

/// Why a piece stays whole.
enum class Unsound { kAngle, kEdge, kHole, kVolume, kSmall, kHanging };
constexpr const char* kWhy[] = {"angles below 2.9 degrees",
                                "edges below a tenth of the mean",
                                "a surface with holes",
                                "volumes that do not add up",
                                "pieces smaller than what the mesh resolves",
                                "pieces that hang on by an edge"};

/// Whether a blade may meet anything at all while vertices move from `before` to where they are.
bool may_meet(const State& s, const std::vector<Vec3>& before,
              const std::vector<SweepPart>& parts) {
  Box sweep, tissue;
  for (const SweepPart& p : parts) {
    sweep.min = sweep.min.cwiseMin(p.box.min);
    sweep.max = sweep.max.cwiseMax(p.box.max);
  }
  for (int v = 0; v < s.vertices.size(); ++v) {
    for (const Vec3& x : {place_before(s, before, v), s.vertices.position(v)}) {
      tissue.min = tissue.min.cwiseMin(x);
      tissue.max = tissue.max.cwiseMax(x);
    }
  }
  return (tissue.max - sweep.min).minCoeff() >= 0 && (sweep.max - tissue.min).minCoeff() >= 0;
}

class SoundCut {
 public:
  SoundCut(State& s, std::vector<std::int32_t>& origin) : s_(s), origin_(origin) {
    UnionFind linked = joined(s);
    before_ = measure(s, linked);
    for (int v = 0; v < s.vertices.size(); ++v) piece_.push_back(linked.root(v));
    const double least = SoundMesh::kLeastCut * std::pow(s.mean_edge, 3);
    for (const auto& [root, p] : before_) {
      (!is_closed_body(p) || p.six_volumes / 6 > least ? open_ : small_).insert(root);
    }
  }

  /// Pieces that a whole path parts, by the links that it passes: they are not to hang on, as by an
  /// edge of the line that the trace of the blade left out.
  void expect_parts(const std::vector<Vec3>& before, const std::vector<SweepPart>& parts) {
    const int count = static_cast<int>(s_.triangles.size());
    const auto centre = [&](int t, const auto& at) {
      const Triangle& c = s_.triangles[t];
      return Vec3((at(c[0]) + at(c[1]) + at(c[2])) / 3);
    };
    const auto then = [&](std::int32_t v) { return place_before(s_, before, v); };
    const auto now = [&](std::int32_t v) { return s_.vertices.position(v); };
    std::map<Edge, int> other;
    UnionFind linked(count);
    for (int t = 0; t < count; ++t) {
      const Triangle& c = s_.triangles[t];
      for (int i = 0; i < 3; ++i) {
        const Edge e = edge_of(c[i], c[(i + 1) % 3]);
        const auto [at, is_first] = other.try_emplace(e, t);
        if (is_first || s_.cut_edges.count(e) != 0) continue;
        const int u = at->second;
        if (!passes({centre(u, then), centre(t, then), centre(u, now), centre(t, now)}, parts))
          linked.join(u, t);
      }
    }
    std::map<std::int32_t, std::map<int, double>> areas;  // of each piece's parts, doubled
    const auto& x = s_.vertices.reference;
    for (int t = 0; t < count; ++t) {
      const Triangle& c = s_.triangles[t];
      areas[piece_[c[0]]][linked.root(t)] += (x[c[1]] - x[c[0]]).cross(x[c[2]] - x[c[0]]).norm();
    }
    const double least = 2 * SoundMesh::kLeastParted * s_.mean_edge * s_.mean_edge;
    for (const auto& [piece, of] : areas) {
      const auto large = std::count_if(of.begin(), of.end(),
                                       [least](const auto& part) { return part.second > least; });
      if (large > 1) parted_.insert(piece);
    }
  }

  /// Cuts the piece that has this vertex alone.
  void take_only(std::int32_t vertex) {
    const std::int32_t piece = piece_[vertex];
    const bool is_open = open_.count(piece) != 0;
    open_.clear();
    small_.clear();
    if (is_open) open_.insert(piece);
  }
  /// Does not cut it.
  void leave_out(std::int32_t vertex) { open_.erase(piece_[vertex]); }

  /// Cuts the pieces that are left but for those that this would make unsound, which are left then.
  bool run(const BladePath& path, const std::vector<Vec3>& before, int stroke, CutReport& report) {
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
      const std::map<std::int32_t, Unsound> bad = unsound();
      if (bad.empty()) {
        open_.swap(later);
        return true;
      }
      mesh.restore(s_);
      origin_.resize(made);
      report = told;
      for (const auto& [p, why] : bad) {
        open_.erase(p);
        later.insert(p);
        why_[p] = why;
      }
    }
    open_.swap(later);
    return false;
  }

  bool is_done() const { return open_.empty(); }

  /// Remembers pieces that were left whole.
  void remember(const BladePath& path, std::vector<LeftWhole>& left_whole) const {
    for (const std::int32_t piece : open_) left_whole.push_back({path, before_.at(piece).vertex});
  }

  /// Small pieces that the blade passes stay whole: what they are.
  void meet_small(const std::vector<Vec3>& before, const std::vector<SweepPart>& parts) {
    if (small_.empty()) return;
    for (const Triangle& t : s_.triangles) {
      const std::int32_t piece = piece_[t[0]];
      if (small_.count(piece) == 0 || why_.count(piece) != 0) continue;
      for (int i = 0; i < 3; ++i) {
        const std::int32_t a = t[i], b = t[(i + 1) % 3];
        const MovingSegment edge = {place_before(s_, before, a), place_before(s_, before, b),
                                    s_.vertices.position(a), s_.vertices.position(b)};
        if (passes(edge, parts)) why_[piece] = Unsound::kSmall;
      }
    }
  }

  /// Tells of pieces that were left whole; of those that a later try did cut nothing.
  void tell(CutReport& report) const {
    std::map<Unsound, int> count;
    for (const auto& [piece, why] : why_) {
      if (why == Unsound::kSmall || open_.count(piece) != 0) ++count[why];
    }
    if (count.empty()) return;
    int all = 0;
    std::string reasons;
    for (const auto& [why, n] : count) {
      all += n;
      reasons += (reasons.empty() ? "" : ", ") + std::string(kWhy[static_cast<int>(why)]) +
                 (count.size() > 1 ? " (" + std::to_string(n) + ")" : "");
    }
    report.pieces_left_whole += all;
    if (!report.why_left_whole.empty()) report.why_left_whole += "; ";
    report.why_left_whole += std::to_string(all) +
                             (all > 1 ? " pieces stay whole where the blade met them"
                                      : " piece stays whole where the blade met it") +
                             ": a cut there would leave " + reasons;
  }

 private:
  bool is_closed_body(const Piece& p) const { return s_.closed_body[s_.vertices.body[p.vertex]]; }

  /// The piece that a vertex belonged to before the cut.
  std::int32_t piece_of(std::int32_t v) const {
    const auto count = static_cast<std::int32_t>(piece_.size());
    while (v >= count) v = origin_[origin_.size() - (s_.vertices.size() - v)];
    return piece_[v];
  }

  static bool passes(const MovingSegment& whole, const std::vector<SweepPart>& parts) {
    for (const SweepPart& part : parts) {
      const MovingSegment link = whole.during(part.begin, part.end);
      for (const SweptEdge& edge : part.edges) {
        if (!stays_aside(edge, link) && edge_passes<Vec3>(edge, link)) return true;
      }
    }
    return false;
  }

  /// Pieces, as they were, that were cut and of which something is no longer sound.
  std::map<std::int32_t, Unsound> unsound() const {
    UnionFind linked = joined(s_);
    std::map<std::int32_t, Unsound> bad;
    const std::map<std::int32_t, Piece> now = measure(s_, linked);
    std::map<std::int32_t, double> gained;  // volume of each [m^3]
    std::map<std::int32_t, int> parts;      // that each is in
    for (const auto& [root, p] : now) {
      gained[piece_of(p.vertex)] += std::max(0.0, p.six_volumes / 6);
      ++parts[piece_of(p.vertex)];
    }
    for (const std::int32_t of : parted_) {
      if (open_.count(of) != 0 && parts[of] < 2) bad.emplace(of, Unsound::kHanging);
    }
    for (const auto& [root, p] : now) {
      const std::int32_t of = piece_of(p.vertex);
      if (open_.count(of) == 0) continue;
      const Piece& was = before_.at(of);
      if (!(p.angle >= std::min(was.angle, SoundMesh::kLeastAngle))) {
        bad.emplace(of, Unsound::kAngle);
      } else if (!(p.edge >= std::min(was.edge, SoundMesh::kLeastEdge * s_.mean_edge))) {
        bad.emplace(of, Unsound::kEdge);
      } else if (is_closed_body(p) &&
                 !(p.hole() <= std::max(was.hole(), SoundMesh::kLargestHole))) {
        bad.emplace(of, Unsound::kHole);
      }
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
        bad.emplace(of, Unsound::kVolume);
    }
    return bad;
  }

  State& s_;
  std::vector<std::int32_t>& origin_;
  std::map<std::int32_t, Piece> before_;
  std::vector<std::int32_t> piece_;
  std::set<std::int32_t> open_;    ///< pieces that are to be cut
  std::set<std::int32_t> small_;   ///< pieces too small to be parted
  std::set<std::int32_t> parted_;  ///< pieces that must not be one afterwards
  std::map<std::int32_t, Unsound> why_;
};

bool rests(const BladePath& path) {
  const Pose &first = path.poses.front(), &last = path.poses.back();
  return !path.edge_at_end.empty() ||  // scissors, whose next path does not go on from this one
         (first.position == last.position &&
          first.orientation.coeffs() == last.orientation.coeffs());
}

/// Square to the blade's first way and its edge.
Vec3 aside(const BladePath& path) {
  const Pose &first = path.poses.front(), &last = path.poses.back();
  if (!path.edge_at_end.empty()) {
    const Vec3 along = first.orientation * Vec3(path.edge[1] - path.edge[0]);
    return along.cross(last * path.edge_at_end[0] - first * path.edge[0]).stableNormalized();
  }
  const Vec3 edge = first.orientation * Vec3(path.edge.back() - path.edge.front());
  return edge.cross(Vec3(last.position - first.position)).stableNormalized();
}

}  // namespace

bool cut_soundly(State& s, const BladePath& path, const std::vector<Vec3>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report) {
  const bool is_tools = stroke < static_cast<int>(s.left_whole.size());
  std::vector<LeftWhole> again, later;
  if (is_tools && !rests(path)) again.swap(s.left_whole[stroke]);
  const Vec3 begin = path.poses.front().position;
  again.erase(std::remove_if(again.begin(), again.end(),
                             [&](const LeftWhole& l) {  // the blade was taken away
                               return (l.path.poses.back().position - begin).norm() > 1e-9;
                             }),
              again.end());
  const auto run = [&](SoundCut& cut, const BladePath& along) {
    bool any = false;
    for (const double far : kAside) {
      BladePath moved = along;
      for (Pose& pose : moved.poses) pose.position += far * s.mean_edge * aside(along);
      any = cut.run(moved, before, stroke, report) || any;
      if (cut.is_done()) break;
    }
    return any;
  };
  const auto leave = [&](const SoundCut& cut, const BladePath& along) {
    cut.tell(report);
    if (is_tools && along.poses.size() < kMostPoses) cut.remember(along, later);
  };
  bool changed = false;
  const std::vector<SweepPart> parts = sweep_parts(path);
  if (may_meet(s, before, parts)) {
    SoundCut cut(s, origin);
    for (const LeftWhole& l : again) cut.leave_out(l.vertex);
    cut.meet_small(before, parts);
    if (!is_tools) cut.expect_parts(before, parts);
    changed = run(cut, path);
    leave(cut, path);
  }
  for (const LeftWhole& l : again) {
    BladePath longer = l.path;
    longer.poses.insert(longer.poses.end(), path.poses.begin() + 1, path.poses.end());
    SoundCut cut(s, origin);
    cut.take_only(l.vertex);
    changed = run(cut, longer) || changed;
    if (cut.is_done()) continue;
    SoundCut here(s, origin);  // at least what the blade sweeps now
    here.take_only(l.vertex);
    if (run(here, path)) {
      changed = true;
      here.tell(report);
    } else {
      leave(cut, longer);
    }
  }
  if (is_tools && !rests(path)) s.left_whole[stroke].swap(later);
  return changed;
}

}  // namespace pbd
}  // namespace tissue_sim
