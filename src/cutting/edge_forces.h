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

#include "cutting/resisting_edge.h"
#include "tools/collider.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

/// How a method's material stands at a place.
struct EdgeSupport {
  Vec3 x, v;             ///< [m], [m/s]
  Eigen::Matrix3d F;     ///< deformation gradient
  double mobility;       ///< sum of w^2 / m over its nodes [1/kg]
  double toughness;      ///< [J/m^2]
  double young_modulus;  ///< [Pa]
};

/// A short way in the material that is `way` in the world. Where tissue is squeezed flat or turned
/// inside out, as cells are that are larger than J / E, as if it were not deformed.
inline Vec3 in_reference(const EdgeSupport& at, const Vec3& way) {
  constexpr double kFlat = 0.1;
  return at.F.determinant() > kFlat ? Vec3(at.F.inverse() * way) : way;
}

/// What a piece bears at most where its place slides along `slides`, unit [N].
inline double most_borne(const EdgePiece& piece, const Vec3& along, const EdgeSupport& at,
                         const Vec3& slides) {
  const double dull = at.young_modulus * piece.edge_radius;
  const double wide = piece.length * in_reference(at, along).norm();
  return (at.toughness + dull) * wide * slides.cross(along).norm();
}

/// In what direction and how far the edge is ahead, and its frame, in the world.
struct EdgeStand {
  Vec3 x, v;  ///< of the middle [m], [m/s]
  Vec3 along, onward;
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
  Vec3 slid = Vec3::Zero();   ///< of the material place, in the world [m]
  double work = 0;            ///< of cutting [J]
};

/// Of the piece in a substep of dt [s], on tissue with cells of this size.
inline EdgePush push_of(const EdgePiece& piece, const EdgeStand& edge, const EdgeSupport& at,
                        double cell_size, double dt, EdgeHold& hold) {
  constexpr double kStiff = 16;     // [E] for a unit of length, where substeps bear it
  constexpr double kBorne = 0.3;    // of a place's springs, times dt^2 / m
  constexpr double kSupport = 2;    // cells: pieces so near share their nodes
  constexpr double kRoom = 0.8;     // of that, at first
  constexpr double kDamping = 0.1;  // share of critical
  constexpr double kTurns = 0.25;   // cells of way in which a piece turns to where it slides
  EdgePush push;
  Vec3 d = edge.x - at.x;
  const double ahead = d.dot(edge.onward);
  if (!(ahead > 0)) {
    hold.presses = 0;
    return push;
  }
  if (hold.presses == 0) {  // comes from free space: nothing across its way holds it yet
    hold.presses = 1;
    push.begins = true;
    push.slid = d - ahead * edge.onward;
    d = ahead * edge.onward;
    const Vec3 way = edge.v - at.v;
    const Vec3 first = (way.dot(edge.onward) > 0 ? way : edge.onward).stableNormalized();
    std::copy(first.data(), first.data() + 3, hold.slides);
  }
  const double shared = std::max(1.0, kSupport * cell_size / piece.length);
  const double light = at.mobility * shared * dt * dt / kBorne;
  // It stays as it is, and with it the force, while substeps get longer or shorter.
  double& stiffness = hold.stiffness;
  if (push.begins || stiffness * light > 1) {
    stiffness = std::min(kStiff * at.young_modulus * piece.length, kRoom / light);
  }
  const double damping =
      2 * kDamping * std::sqrt(stiffness / std::max(1e-30, at.mobility * shared));
  Vec3 force = stiffness * d + damping * (edge.v - at.v);
  if (force.dot(edge.onward) <= 0) return push;
  const Vec3 slides(hold.slides[0], hold.slides[1], hold.slides[2]);
  const double most = most_borne(piece, edge.along, at, slides), size = force.norm();
  if (size > most) {
    force *= most / size;
    const Vec3 slid = d - force / stiffness;
    const Vec3 turned = (slides + slid / (kTurns * cell_size)).stableNormalized();
    if (turned.dot(edge.onward) > 0) std::copy(turned.data(), turned.data() + 3, hold.slides);
    push.slid += slid;
    push.work = std::max(0.0, force.dot(slid));
  }
  push.force = force;
  return push;
}

/// What a piece pushes: not the end of its cut itself, where tissue bears no load on a line, least
/// of all at a surface, but what lies this far ahead of it [cells].
inline constexpr double kAhead = 0.75;

/// The support that far ahead of a hold and how far that is [m]: 0 where tissue ends before.
template <class Tissue>
typename Tissue::Support support_ahead(const Tissue& tissue, EdgeHold& hold, const Vec3& onward,
                                       double& ahead) {
  ahead = kAhead * tissue.cell_size();
  EdgePlace place = hold.place;
  const Vec3 way(hold.ahead[0], hold.ahead[1], hold.ahead[2]);
  if (!tissue.put(hold.place.reference() + ahead * way, place)) {
    ahead = 0;
    place = hold.place;
  }
  typename Tissue::Support support = tissue.support(place);
  const Vec3 turned = in_reference(support.at, onward).stableNormalized();
  std::copy(turned.data(), turned.data() + 3, hold.ahead);
  return support;
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

/// Before blades go on: which pieces hold tissue, and which will on the way from the share `begin`
/// of the frame. A `Tissue` knows the method's:
///   cell_size()
///   look_near(box)          that what find() says of is near there; false where nothing is
///   find(x, place)          the material place at x [m]; false where none is
///   put(X, place)           moves a place to X in reference space; false where no tissue is there
///   is_whole(place, X, normal)   whether anything at a reference place still crosses the plane of
///   a
///                           blade with this normal, in reference space
///   support(place)          a Tissue::Support of its place, with `at`, an EdgeSupport
///   push(support, impulse)  gives the nodes of a support an impulse [N s]
///   each(n, f)              calls f(i) for i below n, on whatever threads
template <class Tissue>
void look_for_edges(Tissue& tissue, const FrameInput& input, double begin, ResistingEdges& edges) {
  constexpr double kStep = 0.125, kBeyond = 1.5;  // cells; of the way in a frame
  constexpr double kAside = 0.125, kBack = 1;  // cells that an edge goes aside, back from its cut
  constexpr int kMostSteps = 64, kHalvings = 5;
  const double cell = tissue.cell_size();
  const auto still_holds = [&](const EdgePiece& piece, const Pose& pose, EdgeHold& hold) {
    if (!hold.holds()) return false;
    const Vec3 onward = pose.orientation * piece.onward;
    double reach = 0;
    const EdgeSupport at = support_ahead(tissue, hold, onward, reach).at;
    const Vec3 d = pose * piece.middle + reach * onward - at.x;
    const double ahead = d.dot(onward);
    if (hold.presses == 0 &&
        ((d - ahead * onward).norm() > kAside * cell || ahead < -kBack * cell)) {
      return false;
    }
    return is_at_end(tissue, hold.place, at, pose.orientation * Vec3::UnitY(), onward);
  };
  std::vector<std::size_t> seek;
  Box box;
  for (std::size_t i = 0; i < edges.pieces.size(); ++i) {
    const EdgePiece& piece = edges.pieces[i];
    if (!input.tools[piece.tool].present) {
      edges.holds[i] = {};
      continue;
    }
    const Pose from = edges.blade_of(piece, input, begin);
    if (still_holds(piece, from, edges.holds[i])) continue;
    edges.holds[i] = {};
    if (!edges.seeks(piece, input, begin)) continue;
    seek.push_back(i);
    const Vec3 a = from * piece.middle, b = edges.blade_of(piece, input, 1) * piece.middle;
    for (const Vec3& x : {a, Vec3(a + kBeyond * (b - a))}) {
      box.min = box.min.cwiseMin(x - Vec3::Constant(cell));
      box.max = box.max.cwiseMax(x + Vec3::Constant(cell));
    }
  }
  if (seek.empty() || !tissue.look_near(box)) return;
  tissue.each(static_cast<int>(seek.size()), [&](int k) {
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
      const EdgeSupport at = tissue.support(there).at;
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
  });
}

/// Before a substep of dt seconds, of which the nodes feel `kick`, with the scene's `colliders`
/// where they will be: pushes nodes, adds what acts on the blades to `loads`. Returns the work of
/// cutting [J].
template <class Tissue>
double push_by_edges(Tissue& tissue, const std::vector<Collider>& colliders, double dt, double kick,
                     ResistingEdges& edges, std::vector<ColliderLoad>& loads) {
  struct Pushed {
    std::size_t collider;
    EdgePush push;
    Vec3 x;
    typename Tissue::Support support;
  };
  std::vector<Pushed> all;
  // What all pieces meet is as it was when the substep began.
  for (std::size_t i = 0; i < edges.holds.size(); ++i) {
    EdgeHold& hold = edges.holds[i];
    if (!hold.holds()) continue;
    const EdgePiece& piece = edges.pieces[i];
    std::size_t c = 1;
    while (colliders[c].tool != piece.tool) ++c;
    c += piece.side;
    EdgeStand stand = stand_of(piece, colliders[c]);
    double reach = 0;
    auto support = support_ahead(tissue, hold, stand.onward, reach);
    stand.x += reach * stand.onward;
    Pushed pushed{c, {}, stand.x, std::move(support)};
    const EdgeSupport& at = pushed.support.at;
    pushed.push = push_of(piece, stand, at, tissue.cell_size(), dt, hold);
    if (!pushed.push.slid.isZero(0)) {
      const Vec3 X = hold.place.reference() + in_reference(at, pushed.push.slid);
      const float* r = colliders[c].rotation;  // of the blade's y
      const Vec3 across(r[1], r[4], r[7]);
      const EdgePlace before = hold.place;
      if (!tissue.put(X, hold.place)) {
        // What is left of the tissue there is cut, too: up to a cell beyond it.
        const Vec3 from = before.reference(), way = X - from;
        const double share = std::min(1.0, tissue.cell_size() / way.norm());
        hold.place = before;
        for (int a = 0; a < 3; ++a) hold.place.at[a] = from[a] + share * way[a];
        hold.lets_go = 1;
      } else if (!is_at_end(tissue, hold.place, at, across, stand.onward)) {
        hold.lets_go = 1;
      }
      if (pushed.push.begins) hold.swept = hold.place;
    }
    if (!pushed.push.force.isZero(0)) all.push_back(std::move(pushed));
  }
  double work = 0;
  for (const Pushed& p : all) {
    tissue.push(p.support, kick * p.push.force);
    const Vec3& force = p.push.force;
    const float at[3] = {float(p.x[0]), float(p.x[1]), float(p.x[2])};
    const float on[3] = {float(force[0]), float(force[1]), float(force[2])};
    loads[p.collider].push(colliders[p.collider], at, on, 0);
    work += p.push.work;
  }
  return work;
}

/// What edges sweep where they hold on, of tissue as it is: from where their places were when they
/// were swept last to where they are. After that they are swept.
template <class Tissue>
std::vector<BladePath> held_paths(const Tissue& tissue, const FrameInput& input, double end,
                                  ResistingEdges& edges) {
  std::vector<BladePath> paths;
  for (std::size_t first = 0, last = 0; first < edges.holds.size(); first = last) {
    last = first + 1;
    if (edges.holds[first].place.body < 0) continue;
    const auto goes_on = [&](std::size_t i) {
      const EdgePiece &a = edges.pieces[i - 1], &b = edges.pieces[i];
      return a.tool == b.tool && a.side == b.side && a.onward == b.onward &&
             edges.holds[i].place.body >= 0;
    };
    while (last < edges.holds.size() && goes_on(last)) ++last;
    BladePath path{{}, {Pose(), Pose()}, {}};
    bool slid = false;
    for (std::size_t i = first; i < last; ++i) {
      EdgeHold& hold = edges.holds[i];
      path.edge.push_back(tissue.support(hold.swept).at.x);
      path.edge_at_end.push_back(tissue.support(hold.place).at.x);
      slid = slid || hold.swept.reference() != hold.place.reference();
      hold.swept = hold.place;
    }
    if (!slid) continue;
    // Up to where the next pieces would be: those hold nothing, or meet these at the tip.
    const EdgePiece& piece = edges.pieces[first];
    const Vec3 by = edges.blade_of(piece, input, end).orientation * piece.along * piece.length;
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
