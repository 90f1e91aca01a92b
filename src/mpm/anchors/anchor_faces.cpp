#include "mpm/anchors/anchor_faces.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

namespace tissue_sim {
namespace {

constexpr double kNearestAxis = 0.9;  // a row goes through a face where its axis is that close to
                                      // the one that is closest to the normal

int anchor_at(const std::vector<Anchor>& anchors, const Vec3& x) {
  for (std::size_t i = 0; i < anchors.size(); ++i) {
    if (anchors[i].contains(x)) return static_cast<int>(i);
  }
  return -1;
}

/// Normal of a region's face at a place on it, by size of the components.
Vec3 normal_at(const Region& r, const Vec3& x) {
  if (r.kind == Region::Kind::kBelow) return Vec3::UnitZ();
  if (r.kind == Region::Kind::kBall) return (x - r.center).cwiseAbs();
  int nearest = 0;
  double distance = 1e30;
  for (int a = 0; a < 3; ++a) {
    const double d = std::min(std::abs(x[a] - r.min[a]), std::abs(x[a] - r.max[a]));
    if (d < distance) distance = d, nearest = a;
  }
  return Vec3::Unit(nearest);
}

struct FaceCrossing {
  double t;         // along the link, 0 at its lower node to 1
  int anchor;       // of the body
  bool inside_low;  // whether the inside is at the lower end
};

/// What each node of a row counts for in what is held at a place of its cell, in cells from the
/// cell's middle towards the outside; nodes in that order, the last one is outside of the cell.
///
/// It is what a uniform stress of the points outside leaves unbalanced at the node. So such a
/// stress is borne exactly wherever the face lies, and, by virtual work, the field that is held has
/// its zero at the face. Where the last one is not to be had, `has_last` false, the spline has to
/// do.
void row_weights(float place, bool has_last, float (&weight)[kRowNodes]) {
  constexpr float kEnds[3][3] = {{0.5f, 0.5f, 0}, {0.125f, 0.75f, 0.125f}, {0, 0.5f, 0.5f}};
  const float at = std::min(std::max(2 * place + 1, 0.0f), 2.0f);
  const int half = at < 1 ? 0 : 1;
  const float inside = at - half;  // share of the half cell in which the face is
  // In proportion to the volume there, at whose ends it is the spline; and what find_free_volumes()
  // gives to the next point.
  const auto moved = (1 - inside) * static_cast<float>(share_shifted(0.5 * inside, half == 1));
  constexpr float kMoved[2][kRowNodes] = {{-0.25f, 0.5f, -0.25f, 0},
                                          {-0.125f, 0.125f, 0.125f, -0.125f}};
  for (int d = 0; d < kRowNodes; ++d) {
    const float low = d < 3 ? kEnds[half][d] : 0, high = d < 3 ? kEnds[half + 1][d] : 0;
    weight[d] = low + inside * (high - low) + moved * kMoved[has_last ? half : 0][d];
  }
}

/// Where a link between two nodes goes through a face of the anchors.
std::vector<FaceCrossing> crossings(const std::vector<Anchor>& anchors, const Vec3& a,
                                    const Vec3& b) {
  constexpr int kParts = 4;
  std::vector<FaceCrossing> found;
  const auto at = [&](double t) { return anchor_at(anchors, a + t * (b - a)); };
  int before = at(0);
  for (int i = 1; i <= kParts; ++i) {
    const int now = at(double(i) / kParts);
    if ((before >= 0) != (now >= 0)) {
      double low = double(i - 1) / kParts, high = double(i) / kParts;
      const bool inside_low = before >= 0;
      int anchor = inside_low ? before : now;
      for (int k = 0; k < 48; ++k) {
        const double middle = 0.5 * (low + high);
        const int in = at(middle);
        if (in >= 0) anchor = in;
        (in >= 0) == inside_low ? low = middle : high = middle;
      }
      found.push_back({0.5 * (low + high), anchor, inside_low});
    }
    before = now;
  }
  return found;
}

/// Calls f(point) for the points that see all three nodes of a row.
template <class F>
void for_each_point_of_row(const LatticeBody& b, const std::int32_t (&cell)[3], int axis,
                           const F& f) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (int i = 2 * cell[axis]; i < 2 * cell[axis] + 2; ++i) {
    for (int j = 0; j < 36; ++j) {
      int site[3];
      site[axis] = i;
      site[u] = 2 * cell[u] - 2 + j % 6;
      site[v] = 2 * cell[v] - 2 + j / 6;
      const int p = b.point(site[0], site[1], site[2]);
      if (p >= 0) f(p, i);
    }
  }
}

/// From a link of nodes to the tissue that moves with it, across the axis: 0 where there is tissue
/// all around, else to the nearest points. Nodes at the rim lie outside of their body, and an
/// anchor that ends where the body does holds them all the same.
Vec3 to_tissue(const LatticeBody& b, const std::array<int, 3>& low, int axis) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vec3 node = b.node_position(low[0], low[1], low[2]);
  Vec3 nearest = Vec3::Zero();
  double least = 1e30;
  int around = 0;  // columns of points
  for (int j = 0; j < 36; ++j) {
    int site[3];
    site[u] = 2 * low[u] - 2 + j % 6;
    site[v] = 2 * low[v] - 2 + j / 6;
    bool any = false;
    for (int i = 2 * low[axis]; i < 2 * low[axis] + 4 && !any; ++i) {
      site[axis] = i;
      any = b.point(site[0], site[1], site[2]) >= 0;
    }
    if (!any) continue;
    Vec3 to = b.site_position(site[0], site[1], site[2]) - node;
    to[axis] = 0;
    if (to.cwiseAbs().maxCoeff() < 0.5 * b.cell_size) ++around;
    if (to.squaredNorm() < least) least = to.squaredNorm(), nearest = to;
  }
  return around == 4 ? Vec3::Zero() : nearest;
}

/// Whether a face goes through the cubes of the points at site `i` along the link, or along them.
bool is_at_face(const FaceLink& link, int i) {
  const double at = 2 * (link.cell[link.axis] + 0.5 + (link.outside ? link.at : -link.at));
  return at > i - 1e-3 && at < i + 1 + 1e-3;
}

/// Adds where faces go through the link from a node to the next along an axis.
void add_links(const std::vector<LatticeBody>& bodies, int body, int first_anchor,
               const std::array<int, 3>& low, int axis, AnchorFaces& faces) {
  const LatticeBody& b = bodies[body];
  std::array<int, 3> high = low;
  ++high[axis];
  const Vec3 begin = b.node_position(low[0], low[1], low[2]);
  const Vec3 end = b.node_position(high[0], high[1], high[2]);
  const Vec3 aside = to_tissue(b, low, axis);
  for (const FaceCrossing& c : crossings(b.body.anchors, begin + aside, end + aside)) {
    const Vec3 x = begin + c.t * (end - begin);
    const Vec3 normal = normal_at(b.body.anchors[c.anchor], x + aside);
    if (normal[axis] < kNearestAxis * normal.maxCoeff()) continue;
    // The face lies in this cell; between two in the one with tissue outside.
    const bool lower = std::abs(c.t - 0.5) < 1e-6 ? !c.inside_low : c.t < 0.5;
    FaceLink link{body, first_anchor + c.anchor, {}, axis, 0, false, {}};
    for (int a = 0; a < 3; ++a) {
      link.cell[a] = lower ? low[a] : high[a];
      link.place[a] = static_cast<float>(x[a]);
    }
    const double place = lower ? c.t : c.t - 1;
    link.outside = c.inside_low;
    link.at = static_cast<float>(link.outside ? place : -place);
    bool near = false;
    for_each_point_of_row(b, link.cell, axis, [&](int p, int i) {
      if (!is_at_face(link, i)) return;
      near = true;
      faces.points.push_back(p);
    });
    if (near) faces.links.push_back(link);
  }
}

/// The cell in whose middle a link's k-th node is.
std::array<std::int32_t, 3> cell_of(const FaceLink& link, int k) {
  std::array<std::int32_t, 3> cell{link.cell[0], link.cell[1], link.cell[2]};
  cell[link.axis] += link.outside ? k - 1 : 1 - k;
  return cell;
}

/// The rows of a link, one for each choice of fields that points at the face see there: what was
/// cut off in front of it is not held.
void add_rows(const LatticeBody& b, const Points& points, const NodeFields& fields,
              const Nodes& nodes, const FaceLink& link, std::vector<FaceRow>& rows) {
  using Found = std::array<std::int32_t, kRowNodes>;
  std::vector<Found> found(1);
  std::array<std::int32_t, 3> n[kRowNodes];
  bool split = false;
  for (int k = 0; k < kRowNodes; ++k) {
    n[k] = cell_of(link, k);
    const int node = b.node(n[k][0], n[k][1], n[k][2]);
    found[0][k] = node;
    split = split || (node >= 0 && fields.split(node) != nullptr);
  }
  if (split) {
    found.clear();
    for_each_point_of_row(b, link.cell, link.axis, [&](int p, int i) {
      if (!is_at_face(link, i)) return;
      Found of;
      for (int k = 0; k < 3; ++k) {
        of[k] = fields.node(b, points.site[p], n[k][0], n[k][1], n[k][2]);
      }
      of[3] = -1;  // the cell's points do not see it
      if (std::find(found.begin(), found.end(), of) == found.end()) found.push_back(of);
    });
  }
  for (const auto& of : found) {
    FaceRow row{};
    float mobility = 0, weight[kRowNodes];
    row_weights(link.at, of[3] >= 0, weight);
    for (int k = 0; k < kRowNodes; ++k) {
      const float w = weight[k];
      if (of[k] < 0 || w == 0) continue;
      row.node[k] = of[k];
      row.weight[k] = w;
      row.share[k] = w * nodes.inv_mass[of[k]];
      mobility += w * row.share[k];
    }
    if (!(mobility > 0)) continue;  // all is inside
    read_own(row);
    row.anchor = link.anchor;
    std::copy_n(link.place, 3, row.place);
    rows.push_back(row);
  }
}

RigidMotion motion_of(const Pose& pose, const Vec3& origin) {
  RigidMotion m;
  m.rotation = pose.orientation.toRotationMatrix();
  m.translation = pose.position - m.rotation * origin;
  return m;
}

}  // namespace

Vec3 face_normal(const std::vector<Anchor>& anchors, const Vec3& x) {
  Vec3 nearest = Vec3::UnitZ();
  double least = 1e30;
  for (const Anchor& a : anchors) {
    Vec3 off(0, 0, x.z() - a.z);  // from the nearest place of the region
    if (a.kind == Region::Kind::kBox) off = x - x.cwiseMax(a.min).cwiseMin(a.max);
    if (a.kind == Region::Kind::kBall) off = x - a.center - a.radius * (x - a.center).normalized();
    const double distance = off.norm();
    if (distance > 0 && distance < least) least = distance, nearest = off / distance;
  }
  return nearest;
}

void find_face_links(const Scene& scene, const LatticeTissue& tissue, AnchorFaces& faces) {
  int first_anchor = 0;
  for (std::size_t i = 0; i < tissue.bodies.size(); ++i) {
    const LatticeBody& b = tissue.bodies[i];
    faces.first_of_body.push_back(first_anchor);
    if (b.body.anchors.empty()) continue;
    for (const Anchor& a : b.body.anchors) faces.origin.push_back(a.origin());
    b.for_each_node([&](int, int x, int y, int z) {
      for (int axis = 0; axis < 3; ++axis) {
        add_links(tissue.bodies, static_cast<int>(i), first_anchor, {x, y, z}, axis, faces);
      }
    });
    std::vector<int> holds(b.body.anchors.size(), 0);
    for (const FaceLink& link : faces.links) {
      if (link.body == static_cast<int>(i)) ++holds[link.anchor - first_anchor];
    }
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      if (tissue.points.anchored[p] != Points::kInAnchor) continue;
      const Points::Site& s = tissue.points.site[p];
      const Vec3 x = b.site_position(s.x, s.y, s.z);
      for (std::size_t a = 0; a < holds.size(); ++a) holds[a] += b.body.anchors[a].contains(x);
    }
    for (std::size_t a = 0; a < holds.size(); ++a) {
      if (holds[a] > 0) continue;
      throw std::invalid_argument(
          "anchors[" + std::to_string(a) + "] of body '" + b.body.name +
          "' holds no point of it: a region is in world coordinates and must reach into the body, "
          "or end at its surface (cell_size is " +
          std::to_string(scene.cell_size) + " m)");
    }
    first_anchor += static_cast<int>(b.body.anchors.size());
  }
  faces.now.resize(faces.origin.size());
  faces.at_link.assign(lattice_node_count(tissue.bodies), 0);
  for (const FaceLink& link : faces.links) {
    for (int k = 0; k < kRowNodes; ++k) {
      const auto [x, y, z] = cell_of(link, k);
      const int node = tissue.bodies[link.body].node(x, y, z);
      if (node >= 0) faces.at_link[node] = 1;
    }
  }
}

void mark_row_nodes(std::size_t node_count, AnchorFaces& faces) {
  faces.at_row.assign(node_count, 0);
  for (const FaceRow& row : faces.rows) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (row.share[k] != 0) faces.at_row[row.node[k]] = 1;
    }
  }
}

bool have_rows(const AnchorFaces& faces, const std::vector<LatticeBody>& bodies,
               const std::vector<NodeFields::Cell>& cells) {
  return std::any_of(cells.begin(), cells.end(), [&](const NodeFields::Cell& c) {
    const int node = bodies[c.body].node(c.x, c.y, c.z);
    return node >= 0 && faces.at_link[node] != 0;
  });
}

void find_face_rows(const LatticeTissue& tissue, AnchorFaces& faces) {
  if (faces.links.empty()) return;
  const std::vector<FaceRow> old_rows = std::move(faces.rows);
  const std::vector<std::array<double, 3>> old_impulse = std::move(faces.impulse);
  faces.rows.clear();
  for (const FaceLink& link : faces.links) {
    add_rows(tissue.bodies[link.body], tissue.points, *tissue.fields, tissue.nodes, link,
             faces.rows);
  }
  group_rows(tissue.nodes, faces);
  mark_row_nodes(tissue.nodes.size(), faces);
  faces.impulse.assign(faces.rows.size(), {});
  // What was carried before, in a frame, goes to rows at the same places.
  const auto place_of = [](const FaceRow& row) {
    return std::array<float, 3>{row.place[0], row.place[1], row.place[2]};
  };
  std::vector<std::pair<std::array<float, 3>, std::size_t>> at;
  for (std::size_t i = 0; i < faces.rows.size() && !old_impulse.empty(); ++i) {
    at.emplace_back(place_of(faces.rows[i]), i);
  }
  std::sort(at.begin(), at.end());
  for (std::size_t i = 0; i < old_impulse.size(); ++i) {
    const auto place = place_of(old_rows[i]);
    const auto same = std::lower_bound(at.begin(), at.end(), std::pair(place, std::size_t{0}));
    if (same == at.end() || same->first != place) continue;
    for (int a = 0; a < 3; ++a) faces.impulse[same->second][a] += old_impulse[i][a];
  }
}

void find_held_nodes(const LatticeTissue& tissue, AnchorFaces& faces) {
  faces.held.clear();
  std::vector<std::uint8_t> seen(tissue.nodes.size(), 0);
  for (std::size_t i = 0; i < tissue.bodies.size(); ++i) {
    const LatticeBody& b = tissue.bodies[i];
    if (b.body.anchors.empty()) continue;
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      if (tissue.points.anchored[p] != Points::kInAnchor) continue;
      const Points::Site& s = tissue.points.site[p];
      const int anchor = anchor_at(b.body.anchors, b.site_position(s.x, s.y, s.z));
      for (int k = 0; k < 27; ++k) {
        const int node = tissue.fields->node(b, s, k);
        if (tissue.nodes.inv_mass[node] != 0 || seen[node] != 0) continue;
        seen[node] = 1;
        const Vec3 x =
            b.node_position(s.x / 2 + k % 3 - 1, s.y / 2 + k / 3 % 3 - 1, s.z / 2 + k / 9 - 1);
        faces.held.push_back(
            {node,
             faces.first_of_body[i] + anchor,
             {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])}});
      }
    }
  }
}

Vec3 AnchorFaces::place_of_held(const Body& body, int body_number, const Vec3& X) const {
  const int anchor = anchor_at(body.anchors, X);
  if (anchor < 0) return X;
  const RigidMotion& m = now[first_of_body[body_number] + anchor];
  return m.rotation * X + m.translation;
}

std::vector<RigidMotion> anchors_at(const AnchorFaces& faces, const FrameInput& input,
                                    double share) {
  std::vector<RigidMotion> at;
  for (std::size_t i = 0; i < input.anchors.size(); ++i) {
    const AnchorMotion& m = input.anchors[i];
    const Pose pose{(1 - share) * m.begin.position + share * m.end.position,
                    m.begin.orientation.slerp(share, m.end.orientation)};
    at.push_back(motion_of(share >= 1 ? m.end : pose, faces.origin[i]));
  }
  return at;
}

void hold_group(AnchorFaces& faces, int index, float dt, const RigidMotion* before,
                const RigidMotion* after, Nodes& nodes) {
  const FaceGroup& g = faces.groups[index];
  float left[kLargestGroup][3];
  for (int i = 0; i < g.count; ++i) {
    const FaceRow& r = faces.rows[g.first + i];
    float target[3] = {}, shift[3] = {};
    if (after != nullptr) {
      const Vec3 from = before[r.anchor].displacement(r.place);
      const Vec3 to = after[r.anchor].displacement(r.place);
      for (int a = 0; a < 3; ++a) {
        target[a] = static_cast<float>(to[a]);
        shift[a] = static_cast<float>((to[a] - from[a]) / dt);
      }
    }
    for (int a = 0; a < 3; ++a) {
      float v = 0, u = 0;
      for (int k = 0; k < kRowNodes; ++k) {
        v += r.weight[k] * nodes.v[a][r.node[k]];
        u += r.weight[k] * nodes.u[a][r.node[k]];
      }
      // u has moved by dt v already: what it was off before.
      const float off = target[a] - shift[a] * dt - (u - dt * v);
      left[i][a] = shift[a] - v + face_drift(dt) / dt * off;
    }
  }
  for (int i = 0; i < g.count; ++i) {
    const FaceRow& r = faces.rows[g.first + i];
    const float* inverse = faces.inverse.data() + g.inverse + i * g.count;
    for (int a = 0; a < 3; ++a) {
      float impulse = 0;
      for (int j = 0; j < g.count; ++j) impulse += inverse[j] * left[j][a];
      faces.impulse[g.first + i][a] += impulse;
      for (int k = 0; k < kRowNodes; ++k) {
        if (r.share[k] == 0) continue;  // of a node that another group may hold just now, or none
        const float dv = r.share[k] * impulse;
        nodes.v[a][r.node[k]] += dv;
        nodes.u[a][r.node[k]] += dt * dv;
      }
    }
  }
}

void hold_still(const AnchorFaces& faces, int index, Array<float>* field) {
  const FaceGroup& g = faces.groups[index];
  float held[kLargestGroup];
  for (int a = 0; a < 3; ++a) {
    for (int i = 0; i < g.count; ++i) {
      const FaceRow& r = faces.rows[g.first + i];
      held[i] = 0;
      for (int k = 0; k < kRowNodes; ++k) held[i] += r.weight[k] * field[a][r.node[k]];
    }
    for (int i = 0; i < g.count; ++i) {
      const FaceRow& r = faces.rows[g.first + i];
      const float* inverse = faces.inverse.data() + g.inverse + i * g.count;
      float impulse = 0;
      for (int j = 0; j < g.count; ++j) impulse += inverse[j] * held[j];
      for (int k = 0; k < kRowNodes; ++k) {
        if (r.share[k] != 0) field[a][r.node[k]] -= r.share[k] * impulse;
      }
    }
  }
}

void move_held(const AnchorFaces& faces, float dt, const RigidMotion* before,
               const RigidMotion* after, Nodes& nodes) {
  for (const AnchorFaces::HeldNode& h : faces.held) {
    const Vec3 from = before[h.anchor].displacement(h.place);
    const Vec3 to = after[h.anchor].displacement(h.place);
    for (int a = 0; a < 3; ++a) {
      nodes.u[a][h.node] = static_cast<float>(to[a]);
      nodes.v[a][h.node] = static_cast<float>((to[a] - from[a]) / dt);
    }
  }
}

std::vector<Wrench> anchor_loads(const AnchorFaces& faces, double duration) {
  std::vector<Wrench> loads(faces.origin.size());
  if (!(duration > 0)) return loads;
  for (std::size_t i = 0; i < faces.rows.size(); ++i) {
    const FaceRow& r = faces.rows[i];
    const RigidMotion& m = faces.now[r.anchor];
    const Vec3 X(r.place[0], r.place[1], r.place[2]);
    const Vec3 arm = m.rotation * (X - faces.origin[r.anchor]);
    const auto& J = faces.impulse[i];
    const Vec3 force = -Vec3(J[0], J[1], J[2]) / duration;
    loads[r.anchor].force += force;
    loads[r.anchor].torque += arm.cross(force);
  }
  return loads;
}

}  // namespace tissue_sim
