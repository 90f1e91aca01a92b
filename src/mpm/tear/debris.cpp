#include "mpm/tear/debris.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "math/bspline.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/lattice/bonds.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Whether bonds along x hold it together with kDebrisPoints others on one side: most points, seen
/// at a glance. Points are numbered along x.
bool is_in_long_run(const Points& points, std::int32_t point) {
  static_assert(kDebrisPoints == sizeof(std::uint64_t), "a byte for each point");
  constexpr std::uint64_t kForwardInX = 0x0101010101010101 << kForwardBond;
  const auto run_from = [&](std::int32_t first) {
    if (first < 0 || first + kDebrisPoints > points.size()) return false;
    std::uint64_t bonds;
    std::memcpy(&bonds, &points.bonds[first], sizeof(bonds));
    return (bonds & kForwardInX) == kForwardInX;
  };
  return run_from(point) || run_from(point - kDebrisPoints);
}

/// The points that bonds hold together with this one; none if they are more than debris has.
struct Debris {
  std::int32_t point[kDebrisPoints];
  int count = 0;
  Debris(const LatticeBody& body, const Points& points, std::int32_t first) {
    const bool may_be = points.bonds[first] != kAllBonds && body.point_count > kDebrisPoints &&
                        !is_in_long_run(points, first);
    if (!may_be) return;
    point[count++] = first;
    for (int i = 0; i < count; ++i) {
      const Points::Site& s = points.site[point[i]];
      for (int k = 0; k < kBondCount; ++k) {
        if ((points.bonds[point[i]] >> k & 1) == 0) continue;
        const std::int32_t next = neighbour(body, s, k);
        if (std::find(begin(), end(), next) != end()) continue;
        if (count == kDebrisPoints) {
          count = 0;
          return;
        }
        point[count++] = next;
      }
    }
  }
  const std::int32_t* begin() const { return point; }
  const std::int32_t* end() const { return point + count; }
};

/// Whether cuts took all bonds along an axis from a point that had both.
bool is_in_slice(const LatticeBody& body, const Points& points, std::int32_t point) {
  const unsigned bonds = points.bonds[point];
  for (int axis = 0; axis < 3; ++axis) {
    const int k = kForwardBond + axis;
    const unsigned both = 1u << k | 1u << opposite_bond(k);
    if ((bonds & both) != 0) continue;
    if ((whole_bonds(body, points, point) & both) == both) return true;
  }
  return false;
}

/// The nodes that some points see, and their reference places.
struct NodesOf {
  std::vector<std::int32_t> node;
  std::vector<Vec3> home;
  template <class SomePoints>
  NodesOf(const LatticeBody& body, const Points& points, const NodeFields& fields,
          const SomePoints& some) {
    for (const std::int32_t p : some) {
      const Points::Site& s = points.site[p];
      for (int k = 0; k < 27; ++k) {
        const int i = fields.node(body, s, k);
        if (std::find(node.begin(), node.end(), i) != node.end()) continue;
        node.push_back(i);
        home.push_back(
            body.node_position(s.x / 2 + k % 3 - 1, s.y / 2 + k / 3 % 3 - 1, s.z / 2 + k / 9 - 1));
      }
    }
  }
};

/// What some nodes gain of speed that get momentum and angular momentum as a rigid body does [m/s].
struct RigidGain {
  std::vector<Vec3> of;
  RigidGain(const Nodes& nodes, const NodesOf& some, const NodesMotion& before,
            const Vec3& momentum, const Vec3& angular)
      : of(some.node.size()) {
    for (std::size_t i = 0; i < of.size(); ++i) {
      of[i] = some.home[i] + displacement_of(nodes, some.node[i]) - before.place;
    }
    const Vec3 spin = inertia_of(nodes, some.node, of).ldlt().solve(angular);
    for (Vec3& x : of) x = momentum / before.mass + spin.cross(x);
  }
  double most() const {
    double most = 0;
    for (const Vec3& v : of) most = v.norm() > most || std::isnan(v.norm()) ? v.norm() : most;
    return most;
  }
};

/// The rotation that maps the places X best onto x, by their sum of mass times x X^T.
Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& x_X) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(x_X, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

/// The nearest point beside a bit of debris, along the lattice, that is not soft; -1 if there is
/// none.
std::int32_t beside(const LatticeBody& body, const Points& points, const Debris& bit) {
  constexpr int kFarthest = 4;
  for (int steps = 1; steps <= kFarthest; ++steps) {
    for (const std::int32_t p : bit) {
      for (int k = 0; k < kBondCount; ++k) {
        const std::int32_t other = neighbour(body, points.site[p], k, steps);
        if (other >= 0 && !points.is_soft(other)) return other;
      }
    }
  }
  return -1;
}

/// A bit of tissue that tears comes off what is beside it no faster than the energy that is stored
/// at its limit would move it; what else it has goes to that.
void slow_down(LatticeTissue& tissue, const LatticeBody& body, const Debris& of_debris) {
  const Points& points = tissue.points;
  const Material& material = body.material_of(points, of_debris.point[0]);
  const std::int32_t other = beside(body, points, of_debris);
  if (material.tear_stretch == 0 || other < 0) return;
  const double most =
      (material.tear_stretch - 1) * std::sqrt(material.young_modulus / material.density);
  const NodesOf nodes_of_bit(body, points, *tissue.fields, of_debris),
      around(body, points, *tissue.fields, std::array<std::int32_t, 1>{other});
  const NodesMotion bit(tissue.nodes, nodes_of_bit.node, nodes_of_bit.home),
      of_other(tissue.nodes, around.node, around.home);
  const Vec3 off = bit.velocity - of_other.velocity;
  if (!(off.norm() > most)) return;
  const Vec3 momentum =
      bit.mass * of_other.mass / (bit.mass + of_other.mass) * (1 - most / off.norm()) * off;
  const Vec3 apart = bit.place - of_other.place, angular = apart.cross(momentum);
  const RigidGain gain(tissue.nodes, around, of_other, momentum, angular);
  if (apart.norm() > 2 * body.cell_size || !(gain.most() < most)) return;
  for (const std::int32_t n : nodes_of_bit.node) {
    for (int a = 0; a < 3; ++a) {
      tissue.nodes.v[a][n] -= static_cast<float>(momentum[a] / bit.mass);
    }
  }
  push(tissue, other, momentum, angular);
}

/// The anchor whose face holds some of these nodes, of which AnchorFaces::at_row says that one
/// does.
int anchor_of(const AnchorFaces& anchors, const std::vector<std::int32_t>& nodes) {
  for (const FaceRow& row : anchors.rows) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (row.share[k] == 0) continue;
      if (std::find(nodes.begin(), nodes.end(), row.node[k]) != nodes.end()) return row.anchor;
    }
  }
  return 0;
}

/// What an anchor's face holds comes to rest where that has it, or stays as it is where the nodes
/// that faces hold are not known (`anchors` null).
void make_rigid(LatticeTissue& tissue, const LatticeBody& body, const Debris& of_debris,
                const AnchorFaces* anchors) {
  const Points& points = tissue.points;
  Nodes& nodes = tissue.nodes;
  const auto beside_anchor = [&](std::int32_t p) { return points.anchored[p] != 0; };
  const bool may_be_held = std::any_of(of_debris.begin(), of_debris.end(), beside_anchor);
  if (may_be_held && anchors == nullptr) return;
  const NodesOf bit(body, points, *tissue.fields, of_debris);
  const auto held = [&](std::int32_t n) {
    return static_cast<std::size_t>(n) < anchors->at_row.size() && anchors->at_row[n] != 0;
  };
  if (may_be_held && std::any_of(bit.node.begin(), bit.node.end(), held)) {
    const RigidMotion motion =
        anchors->moves ? anchors->now[anchor_of(*anchors, bit.node)] : RigidMotion();
    for (std::size_t i = 0; i < bit.node.size(); ++i) {
      const Vec3 u = motion.rotation * bit.home[i] + motion.translation - bit.home[i];
      const std::int32_t n = bit.node[i];
      if (nodes.inv_mass[n] == 0) continue;
      for (int a = 0; a < 3; ++a) {
        nodes.u[a][n] = static_cast<float>(u[a]);
        nodes.v[a][n] = 0;
      }
    }
    return;
  }
  const Material& material = body.material_of(points, of_debris.point[0]);
  const double fastest_spin =
      kDebrisSpin * std::sqrt(material.young_modulus / material.density) / body.cell_size;
  for (const std::int32_t n : bit.node) {
    if (nodes.mass[n] > 0 && nodes.inv_mass[n] == 0) return;  // held fast
  }
  const NodesMotion before(nodes, bit.node, bit.home);
  const std::size_t count = bit.node.size();
  Eigen::Matrix3d x_X = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const double m = nodes.mass[bit.node[i]];
    const Vec3 x = bit.home[i] + displacement_of(nodes, bit.node[i]);
    x_X += m * (x - before.place) * (bit.home[i] - before.home).transpose();
  }
  if (!x_X.allFinite() || !before.angular.allFinite()) return;  // as the end of the frame will say
  const Eigen::Matrix3d R = rotation_of(x_X);
  std::vector<Vec3> x(count);
  for (std::size_t i = 0; i < count; ++i) x[i] = R * (bit.home[i] - before.home);
  const Eigen::Matrix3d inertia = inertia_of(nodes, bit.node, x);
  Vec3 spin = inertia.ldlt().solve(before.angular);
  if (spin.norm() > fastest_spin) {
    spin *= fastest_spin / spin.norm();
    const std::int32_t other = beside(body, points, of_debris);
    if (other >= 0) push(tissue, other, Vec3::Zero(), before.angular - inertia * spin);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 u = before.place + x[i] - bit.home[i], velocity = before.velocity + spin.cross(x[i]);
    for (int a = 0; a < 3; ++a) {
      nodes.u[a][bit.node[i]] = static_cast<float>(u[a]);
      nodes.v[a][bit.node[i]] = static_cast<float>(velocity[a]);
    }
  }
}

/// Takes from the nodes of a point all motion but that of a rigid body, which has their momentum,
/// linear and angular.
void calm(LatticeTissue& tissue, std::int32_t point) {
  Nodes& nodes = tissue.nodes;
  const NodesOf around(tissue.bodies[tissue.points.site[point].body], tissue.points, *tissue.fields,
                       std::array<std::int32_t, 1>{point});
  for (const std::int32_t n : around.node) {
    if (nodes.mass[n] > 0 && nodes.inv_mass[n] == 0) return;  // held fast
  }
  const NodesMotion before(nodes, around.node, around.home);
  if (!before.angular.allFinite()) return;  // as the end of the frame will say
  std::vector<Vec3> x(around.node.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = around.home[i] + displacement_of(nodes, around.node[i]) - before.place;
  }
  const Vec3 spin = inertia_of(nodes, around.node, x).ldlt().solve(before.angular);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 velocity = before.velocity + spin.cross(x[i]);
    for (int a = 0; a < 3; ++a) nodes.v[a][around.node[i]] = static_cast<float>(velocity[a]);
  }
}

}  // namespace

NodesMotion::NodesMotion(const Nodes& nodes, const std::vector<std::int32_t>& some,
                         const std::vector<Vec3>& homes) {
  const auto velocity_of = [&nodes](std::int32_t n) {
    return Vec3(nodes.v[0][n], nodes.v[1][n], nodes.v[2][n]);
  };
  for (std::size_t i = 0; i < some.size(); ++i) {
    const double m = nodes.mass[some[i]];
    mass += m;
    home += m * homes[i];
    place += m * (homes[i] + displacement_of(nodes, some[i]));
    velocity += m * velocity_of(some[i]);
  }
  home /= mass;
  place /= mass;
  velocity /= mass;
  for (std::size_t i = 0; i < some.size(); ++i) {
    angular +=
        nodes.mass[some[i]] *
        (homes[i] + displacement_of(nodes, some[i]) - place).cross(velocity_of(some[i]) - velocity);
  }
}

Eigen::Matrix3d inertia_of(const Nodes& nodes, const std::vector<std::int32_t>& some,
                           const std::vector<Vec3>& r) {
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double m = nodes.mass[some[i]];
    inertia += m * (r[i].squaredNorm() * Eigen::Matrix3d::Identity() - r[i] * r[i].transpose());
  }
  return inertia;
}

void push(LatticeTissue& tissue, std::int32_t point, const Vec3& momentum, const Vec3& angular) {
  Nodes& nodes = tissue.nodes;
  const NodesOf around(tissue.bodies[tissue.points.site[point].body], tissue.points, *tissue.fields,
                       std::array<std::int32_t, 1>{point});
  const RigidGain gain(nodes, around, NodesMotion(nodes, around.node, around.home), momentum,
                       angular);
  for (std::size_t i = 0; i < gain.of.size(); ++i) {
    const int n = around.node[i];
    if (nodes.inv_mass[n] == 0) continue;  // what holds it takes its share
    for (int a = 0; a < 3; ++a) nodes.v[a][n] += static_cast<float>(gain.of[i][a]);
  }
}

Softened soften(LatticeTissue& tissue, const std::vector<std::int32_t>& changed) {
  Softened softened;
  std::set<std::int32_t> seen;  // debris, by their lowest points
  const auto mark = [&](std::int32_t p) {
    if (tissue.points.soft.empty()) tissue.points.soft.resize(tissue.points.size(), 0);
    if (tissue.points.soft[p] == 0) softened.points.push_back(p);
    tissue.points.soft[p] = 1;
  };
  for_each_site(tissue.points, changed, [&](std::int32_t p, const Points::Site& site) {
    const LatticeBody& body = tissue.bodies[site.body];
    if (is_in_slice(body, tissue.points, p)) mark(p);
    const Debris bit(body, tissue.points, p);
    if (bit.count == 0) return;
    for (const std::int32_t of_debris : bit) mark(of_debris);
    const std::int32_t lowest = *std::min_element(bit.begin(), bit.end());
    if (seen.insert(lowest).second) softened.debris.push_back(lowest);
  });
  return softened;
}

void settle_debris(LatticeTissue& tissue, const std::vector<std::int32_t>& debris) {
  for (const std::int32_t lowest : debris) {
    const LatticeBody& body = tissue.bodies[tissue.points.site[lowest].body];
    const Debris bit(body, tissue.points, lowest);
    slow_down(tissue, body, bit);
    make_rigid(tissue, body, bit, nullptr);
  }
}

std::vector<std::int32_t> settle_ill_conditioned(LatticeTissue& tissue,
                                                 const std::set<std::int32_t>& debris,
                                                 const std::vector<std::int32_t>& bridge_ends,
                                                 const AnchorFaces& anchors) {
  std::vector<std::int32_t> settled;
  for (const std::int32_t lowest : debris) {
    const LatticeBody& body = tissue.bodies[tissue.points.site[lowest].body];
    const Debris bit(body, tissue.points, lowest);
    const bool is_ill = std::any_of(bit.begin(), bit.end(), [&](std::int32_t p) {
      return Deformation(body, tissue.points.site[p], *tissue.fields, tissue.nodes).stiffening >=
             kIllConditioned;
    });
    if (!is_ill) continue;
    make_rigid(tissue, body, bit, &anchors);
    settled.insert(settled.end(), bit.begin(), bit.end());
  }
  for (const std::int32_t p : bridge_ends) {
    if (!is_drawn_out(tissue, p) || !ends_lasting_bridge(tissue, p)) continue;
    calm(tissue, p);
    settled.push_back(p);
  }
  return settled;
}

Eigen::Matrix3d deformation_gradient(const LatticeBody& body, const Points::Site& point,
                                     const NodeFields& fields, const Nodes& nodes) {
  const int at[3] = {point.x % 2, point.y % 2, point.z % 2};
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  for (int k = 0; k < 27; ++k) {
    const int d[3] = {k % 3, k / 3 % 3, k / 9}, node = fields.node(body, point, k);
    const Vec3 u(nodes.u[0][node], nodes.u[1][node], nodes.u[2][node]);
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      F.col(a) += lattice_slope(at[a], d[a]) * lattice_weight(at[b], d[b]) *
                  lattice_weight(at[c], d[c]) / body.cell_size * u;
    }
  }
  return F;
}

Deformation::Deformation(const LatticeBody& body, const Points::Site& point,
                         const NodeFields& fields, const Nodes& nodes) {
  const Eigen::Matrix3d F = deformation_gradient(body, point, fields, nodes);
  if (!F.allFinite()) return;
  const Eigen::Vector3d s = F.jacobiSvd().singularValues();
  stretch = s[0];
  stiffening = s[0] * s[0] * s[1] * s[1] + std::fabs(F.determinant() - 1) * F.norm() / std::sqrt(3);
}

}  // namespace tissue_sim
