// Edges of blades in tissue that resists them: docs/cutting.md.
//
// A piece of an edge holds on to the material place at the end of its cut by a spring, in tissue
// that is whole there. Where the spring's force comes to what toughness bears the place slides
// along the force, as friction's does, and that far the cut goes on. With s the way in which the
// place slid of late, t along the edge and w the piece's length in the material the most that it
// bears is
//   J w |s x t|,
// so that each step of the place costs J times the area that it sweeps, in whatever direction:
// a straight push bears J w, and slicing gives Atkins' shares of it. Were s the force's own
// direction, a force that turns along the edge would soften what bears it, and a slicing piece
// stick and slip. Pieces do not pull: an edge that goes back leaves the place where it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "compute/simd.h"
#include "cutting/edge_corners.h"
#include "cutting/edge_pushes.h"
#include "cutting/resisting_edge.h"
#include "tools/collider.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

/// How a method's material stands at a place.
struct EdgeSupport {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();          ///< [m], [m/s]
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();  ///< deformation gradient
  double mobility = 0;                              ///< sum of w^2 / m over its nodes [1/kg]
  double toughness = 0;                             ///< [J/m^2]
  double young_modulus = 0;                         ///< [Pa]
  double poisson_ratio = 0;
};

/// The nodes that say how it stands there, and what of that stays as long as no cut goes on.
struct EdgeStencil {
  using Weights = Vec<4>;  ///< of a value; of its slopes in reference space [1/m]

  Vec3 place = Vec3::Zero();  ///< in reference space [m]
  double mobility = 0, toughness = 0, young_modulus = 0, poisson_ratio = 0;
  std::vector<std::int32_t> nodes;
  std::vector<Weights> weights;

  void clear() {
    mobility = 0;
    nodes.clear();
    weights.clear();
  }
  void add(std::int32_t node, const Weights& weight, double inv_mass) {
    nodes.push_back(node);
    weights.push_back(weight);
    mobility += double(weight[0]) * weight[0] * inv_mass;
  }
};

/// At the place that is `beside` [m] off the stencil's, in reference space: as far as it is linear.
template <class Tissue>
EdgeSupport support_of(const Tissue& tissue, const EdgeStencil& stencil,
                       const Vec3& beside = Vec3::Zero()) {
  EdgeStencil::Weights u[3] = {};
  float v[3] = {};
  for (std::size_t k = 0; k < stencil.nodes.size(); ++k) {
    float moved[3], speed[3];
    tissue.motion(stencil.nodes[k], moved, speed);
    const EdgeStencil::Weights w = stencil.weights[k];
    for (int a = 0; a < 3; ++a) {
      u[a] += moved[a] * w;
      v[a] += w[0] * speed[a];
    }
  }
  EdgeSupport at{Vec3::Zero(),         Vec3(v[0], v[1], v[2]), Eigen::Matrix3d::Identity(),
                 stencil.mobility,     stencil.toughness,      stencil.young_modulus,
                 stencil.poisson_ratio};
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) at.F(a, b) += u[a][1 + b];
    at.x[a] = stencil.place[a] + u[a][0];
  }
  at.x += at.F * beside;
  return at;
}

/// At a place.
template <class Tissue>
EdgeSupport support_at(const Tissue& tissue, const EdgePlace& place) {
  EdgeStencil stencil;
  tissue.see(place, stencil);
  return support_of(tissue, stencil);
}

/// From short ways in the world to those in the material. Where tissue is squeezed flat or turned
/// inside out, as cells are that are larger than J / E, as if it were not deformed.
inline Eigen::Matrix3d to_reference(const EdgeSupport& at) {
  constexpr double kFlat = 0.1;
  const Vec3 xy = at.F.col(0).cross(at.F.col(1));
  const double volume = xy.dot(at.F.col(2));
  if (!(volume > kFlat)) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d inverse;
  inverse.row(0) = at.F.col(1).cross(at.F.col(2)).transpose();
  inverse.row(1) = at.F.col(2).cross(at.F.col(0)).transpose();
  inverse.row(2) = xy.transpose();
  return inverse * (1 / volume);
}
inline Vec3 in_reference(const EdgeSupport& at, const Vec3& way) { return to_reference(at) * way; }

/// What a piece bears at most where its place slides along `slides`, unit [N].
inline double most_borne(const EdgePiece& piece, const Vec3& along, const EdgeSupport& at,
                         const Eigen::Matrix3d& to_reference, const Vec3& slides) {
  const double dull = at.young_modulus * piece.edge_radius;
  const double wide = piece.length * (to_reference * along).norm();
  return (at.toughness + dull) * wide * slides.cross(along).norm();
}

/// Half of how wide an edge is to the tissue that it presses [m]. Thinner ones than this share of
/// J / E sink in deeper than edges do here: docs/cutting.md.
inline double width_of_tip(const EdgePiece& piece, const EdgeSupport& at) {
  constexpr double kThinnest = 0.66;
  const double thinnest = kThinnest * (at.toughness / at.young_modulus + piece.edge_radius);
  return std::max(thinnest, piece.tip_radius);
}

/// The spring of a unit of an edge's length [Pa]: what tissue sinks by because the edge, half so
/// wide, is narrower than nodes show. Under a line load q that is 2 q ln(spread / width) / (pi E*)
/// (Johnson, Contact Mechanics, 5.6).
inline double stiffness_of_tip(const EdgeSupport& at, double width, double spread) {
  constexpr double kPi = EIGEN_PI;
  const double plane = at.young_modulus / (1 - at.poisson_ratio * at.poisson_ratio);
  return kPi * plane / (2 * std::log(spread / width));
}

/// In what direction and how far the edge is ahead, and its frame, in the world.
struct EdgeStand {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();  ///< of the middle [m], [m/s]
  Vec3 along = Vec3::Zero(), onward = Vec3::Zero();
};
inline EdgeStand stand_of(const EdgePiece& piece, const Collider& c) {
  const auto turned = [&c](const Vec3& a) {
    Vec3 r;
    for (int i = 0; i < 3; ++i) {
      r[i] = c.rotation[3 * i] * a[0] + c.rotation[3 * i + 1] * a[1] + c.rotation[3 * i + 2] * a[2];
    }
    return r;
  };
  Vec3 middle = piece.middle;
  if (c.kind == Collider::kPlate) middle.x() += 0.5 * c.width;  // its origin is at its middle
  const Vec3 arm = turned(middle);
  const Vec3 spin(c.spin[0], c.spin[1], c.spin[2]);
  EdgeStand s;
  s.x = Vec3(c.position[0], c.position[1], c.position[2]) + arm;
  s.v = Vec3(c.velocity[0], c.velocity[1], c.velocity[2]) + spin.cross(arm);
  s.along = turned(piece.along);
  s.onward = turned(piece.onward);
  return s;
}

/// What a piece does in a substep.
struct EdgePush {
  Vec3 force = Vec3::Zero();  ///< on the tissue [N]
  bool begins = false;        ///< to press
  Vec3 slid = Vec3::Zero();   ///< of the material place, in reference space [m]
  double work = 0;            ///< of cutting [J]
};

/// Of the piece in a substep of dt [s], on tissue with cells of this size.
inline EdgePush push_of(const EdgePiece& piece, const EdgeStand& edge, const EdgeSupport& at,
                        double cell_size, double spread, double dt, EdgeHold& hold) {
  constexpr double kStiff = 16;    // [E] for a unit of length, where cells show how wide it is
  constexpr double kBorne = 0.75;  // of a place's springs, times dt^2 / m; of stiff ones:
  constexpr double kStiffBorne = 0.3;
  constexpr double kSupport = 2;    // cells: pieces so near share their nodes
  constexpr double kRoom = 0.8;     // of that, at first
  constexpr double kDamping = 0.1;  // share of critical
  constexpr double kTurns = 0.25;   // cells of way in which a piece turns to where it slides
  EdgePush push;
  const Eigen::Matrix3d in_material = to_reference(at);
  Vec3 d = edge.x - at.x;
  const double ahead = d.dot(edge.onward);
  if (!(ahead > 0)) {
    hold.presses = 0;
    return push;
  }
  if (hold.presses == 0) {  // comes from free space: nothing across its way holds it yet
    hold.presses = 1;
    push.begins = true;
    push.slid = in_material * (d - ahead * edge.onward);
    d = ahead * edge.onward;
    const Vec3 way = edge.v - at.v;
    const Vec3 first = (way.dot(edge.onward) > 0 ? way : edge.onward).stableNormalized();
    std::copy(first.data(), first.data() + 3, hold.slides);
  }
  const double width = width_of_tip(piece, at);
  // Edges of scissors meet: what is between them is no wider than they are.
  const bool is_thin = piece.tip_radius > 0 && width < spread;
  const double shared = std::max(1.0, kSupport * cell_size / piece.length);
  const double light = at.mobility * shared * dt * dt / (is_thin ? kBorne : kStiffBorne);
  // It stays as it is, and with it the force, while substeps get longer or shorter.
  double& stiffness = hold.stiffness;
  if (push.begins || stiffness * light > 1) {
    const double most = kStiff * at.young_modulus;
    const double tip = is_thin ? std::min(most, stiffness_of_tip(at, width, spread)) : most;
    stiffness = std::min(tip * piece.length, kRoom / light);
  }
  const double damping =
      2 * kDamping * std::sqrt(stiffness / std::max(1e-30, at.mobility * shared));
  Vec3 force = stiffness * d + damping * (edge.v - at.v);
  if (force.dot(edge.onward) <= 0) return push;
  const Vec3 slides(hold.slides[0], hold.slides[1], hold.slides[2]);
  const double most = most_borne(piece, edge.along, at, in_material, slides), size = force.norm();
  if (size > most) {
    force *= most / size;
    const Vec3 slid = d - force / stiffness;
    const Vec3 turned = (slides + slid / (kTurns * cell_size)).normalized();
    if (turned.dot(edge.onward) > 0) std::copy(turned.data(), turned.data() + 3, hold.slides);
    push.slid += in_material * slid;
    push.work = std::max(0.0, force.dot(slid));
  }
  push.force = force;
  return push;
}

/// What a piece pushes: not the end of its cut itself, where tissue bears no load on a line, least
/// of all at a surface, but what lies this far ahead of it [cells].
inline constexpr double kAhead = 0.75;

/// What is seen that far ahead of a hold, and how far that is [m]: 0 where tissue ends before.
template <class Tissue>
double see_ahead(const Tissue& tissue, const EdgeHold& hold, EdgeStencil& stencil) {
  const double ahead = kAhead * tissue.cell_size();
  EdgePlace place = hold.place;
  const Vec3 way(hold.ahead[0], hold.ahead[1], hold.ahead[2]);
  const bool is_there = tissue.put(hold.place.reference() + ahead * way, place);
  tissue.see(is_there ? place : hold.place, stencil);
  return is_there ? ahead : 0;
}

/// Turns what is ahead of a hold to where that is in tissue that stands so.
inline void turn_ahead(const EdgeSupport& at, const Vec3& onward, EdgeHold& hold) {
  const Vec3 turned = in_reference(at, onward).stableNormalized();
  std::copy(turned.data(), turned.data() + 3, hold.ahead);
}

/// Whether a piece that holds on there is at the end of its cut: nothing is cut there, or half a
/// cell ahead.
template <class Tissue>
bool is_at_end(const Tissue& tissue, const EdgePlace& place, const EdgeSupport& at,
               const Vec3& across, const Vec3& onward) {
  const Vec3 X = place.reference(), normal = at.F.transpose() * across;
  if (tissue.is_whole(place, X, normal)) return true;
  const Vec3 ahead = in_reference(at, onward).stableNormalized();
  return tissue.is_whole(place, X + 0.5 * tissue.cell_size() * ahead, normal);
}

inline void add(const Vec3& x, Box& box) {
  box.min = box.min.cwiseMin(x);
  box.max = box.max.cwiseMax(x);
}
inline double distance2(const Box& box, const Vec3& x) {
  return (x - x.cwiseMax(box.min).cwiseMin(box.max)).squaredNorm();
}

/// Before blades go on: which pieces hold tissue, and which will on the way from the share `begin`
/// of the frame. A `Tissue` knows the method's:
///   cell_size()
///   spread()                over how much its nodes spread a load on a line, at least [m]
///   look_near(box)          that what find() says of is near there; false where nothing is
///   find(x, place)          the material place at x [m]; false where none is
///   put(X, place)           moves a place to X in reference space; false where no tissue is there
///   is_whole(place, X, normal)   whether anything at a reference place still crosses the plane of
///                           a blade with this normal, in reference space
///   see(place, stencil)     what a place sees
///   motion(node, u, v)      how a node moved [m], [m/s]
///   push(node, way, impulse)   gives a node this share of an impulse [N s]
///   each(n, f, grain)       calls f(i) for i below n, so many at a time, on whatever threads
template <class Tissue>
void look_for_edges(Tissue& tissue, const FrameInput& input, double begin, ResistingEdges& edges) {
  constexpr double kStep = 0.125, kBeyond = 1.5;  // cells; of the way in a frame
  constexpr double kAside = 0.125, kBack = 1;  // cells that an edge goes aside, back from its cut
  constexpr int kMostSteps = 64, kHalvings = 5, kGrain = 16;
  const double cell = tissue.cell_size();
  edges.bring_held();
  const auto still_holds = [&](const EdgePiece& piece, const Pose& pose, EdgeHold& hold) {
    const Vec3 onward = pose.orientation * piece.onward;
    EdgeStencil stencil;
    const double reach = see_ahead(tissue, hold, stencil);
    const EdgeSupport at = support_of(tissue, stencil);
    turn_ahead(at, onward, hold);
    const Vec3 d = pose * piece.middle + reach * onward - at.x;
    const double ahead = d.dot(onward);
    if (hold.presses == 0 &&
        ((d - ahead * onward).norm() > kAside * cell || ahead < -kBack * cell)) {
      return false;
    }
    return is_at_end(tissue, hold.place, at, pose.orientation * Vec3::UnitY(), onward);
  };
  std::vector<std::size_t> held, seek;
  for (std::size_t i = 0; i < edges.pieces.size(); ++i) {
    EdgeHold& hold = edges.holds[i];
    if (hold.holds() && input.tools[edges.pieces[i].tool].present) {
      held.push_back(i);
    } else {
      hold = {};
    }
  }
  tissue.each(
      static_cast<int>(held.size()),
      [&](int k) {
        const EdgePiece& piece = edges.pieces[held[k]];
        EdgeHold& hold = edges.holds[held[k]];
        if (still_holds(piece, edges.blade_of(piece, input, begin), hold)) return;
        if (hold.place.reference() != hold.swept.reference()) {
          hold.lets_go = 2;
        } else {
          hold = {};
        }
      },
      kGrain);
  Box box;
  for (std::size_t i = 0; i < edges.pieces.size(); ++i) {
    const EdgePiece& piece = edges.pieces[i];
    if (edges.holds[i].place.body >= 0 || !input.tools[piece.tool].present ||
        !edges.seeks(piece, input, begin)) {
      continue;
    }
    seek.push_back(i);
    const Vec3 a = edges.blade_of(piece, input, begin) * piece.middle;
    const Vec3 b = edges.blade_of(piece, input, 1) * piece.middle;
    for (const Vec3& x : {a, Vec3(a + kBeyond * (b - a))}) {
      box.min = box.min.cwiseMin(x - Vec3::Constant(cell));
      box.max = box.max.cwiseMax(x + Vec3::Constant(cell));
    }
  }
  if (seek.empty() || !tissue.look_near(box)) return;
  const auto look = [&](int k) {
    const EdgePiece& piece = edges.pieces[seek[k]];
    EdgeHold& hold = edges.holds[seek[k]];
    const Pose from = edges.blade_of(piece, input, begin);
    const Vec3 a = from * piece.middle;
    const Vec3 way = kBeyond * (edges.blade_of(piece, input, 1) * piece.middle - a);
    const Vec3 normal = from.orientation * Vec3::UnitY();
    const int steps =
        std::min(kMostSteps, static_cast<int>(std::ceil(way.norm() / (kStep * cell))));
    EdgePlace found;
    Vec3 ahead = Vec3::Zero();
    const auto is_there = [&](double share) {
      EdgePlace there;
      if (!tissue.find(a + share * way, there)) return false;
      const EdgeSupport at = support_at(tissue, there);
      if (!(at.toughness > 0) ||
          !tissue.is_whole(there, there.reference(), at.F.transpose() * normal)) {
        return false;
      }
      found = there;
      ahead = in_reference(at, from.orientation * piece.onward).stableNormalized();
      return true;
    };
    const double step = steps > 0 ? 1.0 / steps : 0;
    for (int i = 0; i <= steps; ++i) {
      if (!is_there(i * step)) continue;
      double low = (i - 1) * step, high = i * step;
      for (int n = 0; i > 0 && n < kHalvings; ++n) {
        const double middle = 0.5 * (low + high);
        (is_there(middle) ? high : low) = middle;
      }
      hold.place = hold.swept = found;
      std::copy(ahead.data(), ahead.data() + 3, hold.ahead);
      return;
    }
  };
  tissue.each(static_cast<int>(seek.size()), look, kGrain);
}

/// What pushes tissue in the substeps of a part of a frame. Places move with what slides, and what
/// they see is seen anew after some way.
template <class Tissue>
class PushingEdges final : public EdgePushes {
 public:
  PushingEdges(const Tissue& tissue, const std::vector<Collider>& colliders, ResistingEdges& edges)
      : tissue_(tissue), colliders_(colliders), edges_(edges) {}

  double push(double dt, double kick, std::vector<ColliderLoad>& loads) override {
    if (all_.empty()) gather();
    if (edges_.distant != nullptr) {
      nodes_.insert(nodes_.end(), fresh_nodes_.begin(), fresh_nodes_.end());
      fresh_nodes_.clear();
      edges_.distant->bring_motion(nodes_);
    }
    // What all meet is as it was when the substep began.
    tissue_.each(
        static_cast<int>(all_.size()), [&](int i) { meet(dt, all_[i]); }, kGrain);
    double work = 0;
    for (Pushing& p : all_) {
      const Vec3& force = p.push.force;
      if (!p.hold.holds()) continue;
      if (!force.isZero(0)) {
        const Vec3 impulse = kick * force;
        for (std::size_t k = 0; k < p.stencil.nodes.size(); ++k) {
          tissue_.push(p.stencil.nodes[k], p.stencil.weights[k][0], impulse);
        }
        const float at[3] = {float(p.x[0]), float(p.x[1]), float(p.x[2])};
        const float on[3] = {float(force[0]), float(force[1]), float(force[2])};
        loads[p.collider].push(colliders_[p.collider], at, on, 0);
        work += p.push.work;
      }
      if (p.push.begins || p.moved.squaredNorm() > kSeesAnew * kSeesAnew * cell_ * cell_) {
        move_place(p);
        if (p.hold.holds()) see(p);
      }
    }
    if (edges_.distant != nullptr) edges_.distant->send_velocities(nodes_);
    return work;
  }

  void end() override {
    for (Pushing& p : all_) {
      if (p.hold.holds()) move_place(p);
    }
    all_.clear();
  }

 private:
  static constexpr double kSeesAnew = 1.0 / 16;  // cells
  static constexpr int kGrain = 16;

  struct Pushing {
    Pushing(const EdgePiece& of, EdgeHold& holds, std::size_t by)
        : piece(of), hold(holds), collider(by) {}
    const EdgePiece& piece;
    EdgeHold& hold;
    std::size_t collider;
    EdgeStencil stencil;
    double reach = 0;           ///< of the stencil ahead of the place [m]
    Vec3 moved = Vec3::Zero();  ///< the place, since it was put down; in reference space [m]
    EdgeStand stand;
    EdgeSupport at;
    EdgePush push;
    Vec3 x = Vec3::Zero();  ///< where it pushes [m]
  };

  void gather() {
    std::size_t collider = 1;
    for (std::size_t i = 0; i < edges_.holds.size(); ++i) {
      if (!edges_.holds[i].holds()) continue;
      const EdgePiece& piece = edges_.pieces[i];
      while (colliders_[collider].tool != piece.tool) ++collider;
      all_.emplace_back(piece, edges_.holds[i], collider + piece.side);
      see(all_.back());
    }
  }
  void see(Pushing& p) {
    p.stencil.clear();
    p.reach = see_ahead(tissue_, p.hold, p.stencil);
    if (edges_.distant == nullptr) return;
    for (const std::int32_t node : p.stencil.nodes) {
      if (is_seen_.size() <= static_cast<std::size_t>(node)) is_seen_.resize(node + 1);
      if (!std::exchange(is_seen_[node], true)) fresh_nodes_.push_back(node);
    }
  }
  void meet(double dt, Pushing& p) const {
    if (!p.hold.holds()) return;
    p.stand = stand_of(p.piece, colliders_[p.collider]);
    p.at = support_of(tissue_, p.stencil, p.moved);
    p.stand.x += p.reach * p.stand.onward;
    p.x = p.stand.x;
    p.push = push_of(p.piece, p.stand, p.at, cell_, tissue_.spread(), dt, p.hold);
    p.moved += p.push.slid;
  }
  /// The piece's place to where it slid.
  void move_place(Pushing& p) const {
    EdgeHold& hold = p.hold;
    turn_ahead(p.at, p.stand.onward, hold);
    if (p.moved.isZero(0)) return;
    const float* r = colliders_[p.collider].rotation;  // of the blade's y
    const Vec3 across(r[1], r[4], r[7]);
    const EdgePlace before = hold.place;
    if (!tissue_.put(before.reference() + p.moved, hold.place)) {
      // What is left of the tissue there is cut, too: up to a cell beyond it.
      const Vec3 from = before.reference();
      const double share = std::min(1.0, cell_ / p.moved.norm());
      hold.place = before;
      for (int a = 0; a < 3; ++a) hold.place.at[a] = from[a] + share * p.moved[a];
      hold.lets_go = 1;
    } else if (!is_at_end(tissue_, hold.place, p.at, across, p.stand.onward)) {
      hold.lets_go = 1;
    }
    if (p.push.begins) hold.swept = hold.place;
    p.moved.setZero();
  }

  Tissue tissue_;
  const std::vector<Collider>& colliders_;
  ResistingEdges& edges_;
  const double cell_ = tissue_.cell_size();
  std::vector<Pushing> all_;
  // Where nodes are not the host's: those that were seen in this part of the frame, and since the
  // last substep.
  std::vector<std::int32_t> nodes_, fresh_nodes_;
  std::vector<char> is_seen_;
};

/// Where the cut of pieces that hold on side by side ends: the line through their places [m, in
/// reference space], without its small corners and so far behind that no piece is behind it; at the
/// places themselves of those that let go, beside which nothing comes later.
inline std::vector<Vec3> end_of_cut(const EdgeHold* first, const EdgeHold* last, double corner) {
  std::vector<Vec3> line;
  for (const EdgeHold* h = first; h != last; ++h) {
    line.push_back(h->place.reference() - corner * Vec3(h->ahead[0], h->ahead[1], h->ahead[2]));
  }
  const std::vector<std::size_t> kept = corners_of({&line}, corner);
  for (std::size_t k = 0; k + 1 < kept.size(); ++k) {
    const std::size_t a = kept[k], b = kept[k + 1];
    for (std::size_t i = a + 1; i < b; ++i) {
      const double share = static_cast<double>(i - a) / static_cast<double>(b - a);
      line[i] = (1 - share) * line[a] + share * line[b];
    }
  }
  for (const EdgeHold* h = first; h != last; ++h) {
    if (h->lets_go != 0) line[h - first] = h->place.reference();
  }
  return line;
}

/// What edges sweep where they hold on, of tissue as it is: from where their cut ended when they
/// were swept last to where it ends, once a place went on by a little or lets go. Nothing is cut
/// that was not paid for, and the next path begins where this one ends.
template <class Tissue>
std::vector<BladePath> held_paths(const Tissue& tissue, const FrameInput& input, double end,
                                  ResistingEdges& edges) {
  constexpr double kCorner = 0.03, kLeast = 0.05, kStraight = 0.002;  // cells
  const double cell = tissue.cell_size();
  std::vector<BladePath> paths;
  edges.bring_held();
  for (std::size_t first = 0, last = 0; first < edges.holds.size(); first = last) {
    last = first + 1;
    if (edges.holds[first].place.body < 0) continue;
    const auto goes_on = [&](std::size_t i) {
      const EdgePiece &a = edges.pieces[i - 1], &b = edges.pieces[i];
      return a.tool == b.tool && a.side == b.side && a.onward == b.onward &&
             edges.holds[i].place.body >= 0;
    };
    while (last < edges.holds.size() && goes_on(last)) ++last;
    EdgeHold* const holds = &edges.holds[0];
    const auto slid = [&](const EdgeHold& h) {
      const double way = (h.place.reference() - h.swept.reference()).norm();
      return way > (2 * kCorner + kLeast) * cell || (h.lets_go != 0 && way > 0);
    };
    if (std::none_of(holds + first, holds + last, slid)) continue;
    const EdgePiece& piece = edges.pieces[first];
    const Quat blade = edges.blade_of(piece, input, end).orientation;
    const std::vector<Vec3> line = end_of_cut(holds + first, holds + last, kCorner * cell);
    std::vector<Vec3> before, after;
    for (std::size_t i = first; i < last; ++i) {
      EdgeHold& hold = holds[i];
      before.push_back(support_at(tissue, hold.swept).x -
                       2 * kStraight * cell * (blade * piece.onward));
      hold.swept = hold.place;
      if (!tissue.put(line[i - first],
                      hold.swept)) {  // beyond the tissue: as its last point sees it
        hold.swept = hold.place;
        std::copy(line[i - first].data(), line[i - first].data() + 3, hold.swept.at);
      }
      after.push_back(support_at(tissue, hold.swept).x);
    }
    BladePath path{{}, {Pose(), Pose()}, {}};
    for (const std::size_t i : corners_of({&before, &after}, kStraight * cell)) {
      path.edge.push_back(before[i]);
      path.edge_at_end.push_back(after[i]);
    }
    // Up to where the next pieces would be: those hold nothing, or meet these at the tip.
    const Vec3 by = blade * piece.along * piece.length;
    for (std::vector<Vec3>* edge : {&path.edge, &path.edge_at_end}) {
      edge->insert(edge->begin(), edge->front() - by);
      edge->push_back(edge->back() + by);
    }
    paths.push_back(std::move(path));
  }
  for (EdgeHold& hold : edges.holds) {
    if (hold.lets_go != 0) hold = {};
  }
  return paths;
}

}  // namespace tissue_sim
