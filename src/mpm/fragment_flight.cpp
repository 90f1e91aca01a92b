#include "mpm/fragment_flight.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "mpm/mpm_state.h"
#include "mpm/tear/debris.h"

namespace tissue_sim {
namespace {

/// The nodes that a piece's points see, by number, and their reference places.
void find_nodes(const MpmState& state, const Pieces& pieces, int piece, FragmentFlight& flight) {
  struct Seen {
    std::int32_t node;
    std::int16_t body, x, y, z;
  };
  std::vector<Seen> seen;
  for (std::int32_t p = 0; p < state.points.size(); ++p) {
    if (pieces.of_point[p] != piece) continue;
    const Points::Site& s = state.points.site[p];
    const LatticeBody& body = state.bodies[s.body];
    for (int k = 0; k < 27; ++k) {
      const auto cell = [](int site, int offset) {
        return static_cast<std::int16_t>(site / 2 + offset - 1);
      };
      seen.push_back({state.fields->node(body, s, k), s.body, cell(s.x, k % 3),
                      cell(s.y, k / 3 % 3), cell(s.z, k / 9)});
    }
  }
  std::sort(seen.begin(), seen.end(), [](const Seen& a, const Seen& b) { return a.node < b.node; });
  for (const Seen& s : seen) {
    if (!flight.nodes.empty() && flight.nodes.back() == s.node) continue;
    flight.nodes.push_back(s.node);
    flight.home.push_back(state.bodies[s.body].node_position(s.x, s.y, s.z));
  }
}

Vec3 spin_of(const FragmentFlight& f, const Eigen::Matrix3d& rotation) {
  return rotation * f.inertia.ldlt().solve(rotation.transpose() * f.angular);
}

Eigen::Matrix3d turn(const Vec3& by) {
  const double angle = by.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, by / angle).toRotationMatrix()
                   : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

void write_nodes(const FragmentFlight& f, Nodes& nodes) {
  const Vec3 spin = spin_of(f, f.rotation);
  for (std::size_t i = 0; i < f.nodes.size(); ++i) {
    const Vec3 r = f.rotation * f.from_centre[i];
    const Vec3 u = f.centre + r - f.home[i], v = f.velocity + spin.cross(r);
    for (int a = 0; a < 3; ++a) {
      nodes.u[a][f.nodes[i]] = static_cast<float>(u[a]);
      nodes.v[a][f.nodes[i]] = static_cast<float>(v[a]);
    }
  }
}

/// The flight that a node is of, -1 for none.
std::int32_t flight_of(const MpmState& state, std::int32_t node) {
  const std::vector<std::int32_t>& of = state.flight_of_node;
  return static_cast<std::size_t>(node) < of.size() ? of[node] : -1;  // cuts made it since
}

std::int32_t flight_of_point(const MpmState& state, std::int32_t point) {
  const Points::Site& s = state.points.site[point];
  return flight_of(state, state.fields->node(state.bodies[s.body], s, kMiddleNode));
}

/// Takes those out of the list that are marked.
void land(MpmState& state, const std::vector<std::uint8_t>& lands) {
  if (std::none_of(lands.begin(), lands.end(), [](std::uint8_t l) { return l != 0; })) return;
  std::vector<FragmentFlight> left;
  for (std::size_t i = 0; i < lands.size(); ++i) {
    if (lands[i] == 0) left.push_back(std::move(state.flights[i]));
  }
  state.flights = std::move(left);
  index_flights(state);
}

/// Which of them touch something.
std::vector<std::uint8_t> touching(const MpmState& state) {
  std::vector<std::uint8_t> touches(state.flights.size(), 0);
  for (const std::int32_t i : state.faces.active) {
    const FaceContact& c = state.faces.all[i];
    if (c.other < 0 || !c.touching) continue;
    const std::int32_t own = flight_of(state, c.nodes.row(1, 1)[1]),
                       other = flight_of(state, c.other_nodes.row(1, 1)[1]);
    if (own == other) continue;  // it touches itself
    if (own >= 0) touches[own] = 1;
    if (other >= 0) touches[other] = 1;
  }
  for (const std::vector<Touch>& of_block : state.contacts.touching) {
    for (const Touch& t : of_block) {
      const std::int32_t own = flight_of_point(state, t.point);
      if (own >= 0) touches[own] = 1;
    }
  }
  return touches;
}

}  // namespace

void index_flights(MpmState& state) {
  state.flight_of_node.clear();
  if (state.flights.empty()) return;
  state.flight_of_node.resize(state.nodes.size(), -1);
  for (std::size_t i = 0; i < state.flights.size(); ++i) {
    for (const std::int32_t n : state.flights[i].nodes) {
      state.flight_of_node[n] = static_cast<std::int32_t>(i);
    }
  }
}

bool take_off(MpmState& state, const Pieces& pieces, int piece, const Eigen::Matrix3d& F) {
  const Nodes& nodes = state.nodes;
  FragmentFlight f;
  f.piece = piece;
  find_nodes(state, pieces, piece, f);
  for (const std::int32_t n : f.nodes) {
    if (nodes.inv_mass[n] == 0) return false;
  }
  const NodesMotion before(nodes, f.nodes, f.home);
  if (!(before.mass > 0)) return false;
  f.centre = before.place;
  f.velocity = before.velocity;
  f.angular = before.angular;
  f.rotation = Eigen::Matrix3d::Identity();
  for (const Vec3& home : f.home) f.from_centre.emplace_back(F * (home - before.home));
  f.inertia = inertia_of(nodes, f.nodes, f.from_centre);
  if (!f.angular.allFinite() || !f.centre.allFinite() || !f.inertia.allFinite()) return false;
  write_nodes(f, state.nodes);
  state.flights.push_back(std::move(f));
  index_flights(state);
  return true;
}

bool touches_anything(const MpmState& state, const Pieces& pieces, int piece) {
  FragmentFlight f;
  find_nodes(state, pieces, piece, f);
  const auto is_own = [&](std::int32_t node) {
    return std::binary_search(f.nodes.begin(), f.nodes.end(), node);
  };
  for (const std::int32_t i : state.faces.active) {
    const FaceContact& c = state.faces.all[i];
    if (c.other < 0 || !c.touching) continue;
    if (is_own(c.nodes.row(1, 1)[1]) != is_own(c.other_nodes.row(1, 1)[1])) return true;
  }
  for (const std::vector<Touch>& of_block : state.contacts.touching) {
    for (const Touch& t : of_block) {
      if (pieces.of_point[t.point] == piece) return true;
    }
  }
  return false;
}

void fly(MpmState& state, const NodeStep& step) {
  if (state.flights.empty()) return;
  land(state, touching(state));
  const Vec3 gravity(step.gravity[0], step.gravity[1], step.gravity[2]);
  for (FragmentFlight& f : state.flights) {
    f.velocity = step.keep * f.velocity + step.kick * gravity;
    f.angular *= step.keep;
    f.centre += step.dt * f.velocity;
    const Eigen::Matrix3d half = turn(0.5 * step.dt * spin_of(f, f.rotation)) * f.rotation;
    f.rotation = turn(step.dt * spin_of(f, half)) * f.rotation;
    write_nodes(f, state.nodes);
  }
}

std::vector<std::int32_t> fly_frame(MpmState& state, double duration, int substeps) {
  const Nodes& nodes = state.nodes;
  // How far off momentum may be, as a share of that which the piece has in its own frame or gains:
  // floats keep it to some 1e-5 in a frame, what touches tissue loses more.
  constexpr double kTouched = 2e-3;
  const double keep = std::exp(-state.scene.damping * duration);
  std::vector<std::uint8_t> lands(state.flights.size(), 0);
  std::vector<std::int32_t> moved;
  for (std::size_t i = 0; i < state.flights.size(); ++i) {
    FragmentFlight& f = state.flights[i];
    const NodesMotion now(nodes, f.nodes, f.home);
    double extent = 0;
    for (std::size_t j = 0; j < f.nodes.size(); ++j) {
      extent += nodes.mass[f.nodes[j]] * f.from_centre[j].squaredNorm();
    }
    extent = std::sqrt(extent / now.mass);
    const Vec3 expected = keep * f.velocity + duration * state.scene.gravity;
    const double spin = f.angular.norm() / (now.mass * extent);
    const double speed = f.velocity.norm() + spin + duration * state.scene.gravity.norm() + 1e-6;
    if ((now.velocity - expected).norm() > kTouched * speed ||
        (now.angular - keep * f.angular).norm() > 5 * kTouched * now.mass * extent * speed) {
      lands[i] = 1;
      continue;
    }
    const double dt = duration / std::max(1, substeps);
    for (int step = 0; step < substeps; ++step) {
      const Eigen::Matrix3d half = turn(0.5 * dt * spin_of(f, f.rotation)) * f.rotation;
      f.rotation = turn(dt * spin_of(f, half)) * f.rotation;
    }
    f.centre = now.place;
    f.velocity = now.velocity;
    f.angular = now.angular;
    write_nodes(f, state.nodes);
    moved.insert(moved.end(), f.nodes.begin(), f.nodes.end());
  }
  land(state, lands);
  return moved;
}

void land_changed(MpmState& state, const std::vector<std::int32_t>& changed) {
  if (state.flights.empty()) return;
  std::vector<std::uint8_t> lands(state.flights.size(), 0);
  for (const std::int32_t p : changed) {
    const std::int32_t flight = flight_of_point(state, p);
    if (flight >= 0) lands[flight] = 1;
  }
  land(state, lands);
}

}  // namespace tissue_sim
