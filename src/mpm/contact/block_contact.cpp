#include "mpm/contact/block_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "contact/push_tool.h"
#include "mpm/contact/face_places.h"
#include "mpm/contact/place_parts.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/cell_points.h"
#include "mpm/surface/facet_motion.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

/// Spring of a point of unit volume; stiffness and damping both grow with the volume.
ContactSpring unit_spring(const LatticeBody& body, int material) {
  const Material& m = body.materials[material];
  const auto modulus = static_cast<float>(lame_lambda(m) + 2 * lame_mu(m));
  const float edge = 0.5f * static_cast<float>(body.cell_size);
  return contact_spring(modulus, static_cast<float>(m.density), edge, 1.0f);
}

bool comes_before(const Touch& a, const Touch& b) {
  return std::tie(a.collider, a.cell, a.key, a.part) < std::tie(b.collider, b.cell, b.key, b.part);
}

/// cof F n, which carries normals.
void cofactor_times(const float (&F)[9], const float (&n)[3], float (&to)[3]) {
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    to[i] = 0;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      to[i] += (F[3 * i1 + j1] * F[3 * i2 + j2] - F[3 * i1 + j2] * F[3 * i2 + j1]) * n[j];
    }
  }
}

/// The place of a point in its cell: x + 2 y + 4 z.
int sub_position(const Points::Site& site) {
  return (site.x & 1) + 2 * (site.y & 1) + 4 * (site.z & 1);
}

/// Lane of the first point of the cell in which the block has a point, -1 where it has it not.
int first_lane(const Block& block, std::int32_t point, const Points::Site& site) {
  const int y = site.y / 2 - block.y, z = site.z / 2 - block.z;
  if (z < 0 || z >= block.nz) return -1;
  for (const Block::Run& run : block.runs) {
    const int i = site.x / 2 - block.cell_x(run.x), lane = 8 * z * block.stride + run.lane + i;
    if (run.y == y && i >= 0 && i < run.count &&
        block.point[lane + sub_position(site) * block.stride] == point) {
      return lane;
    }
  }
  return -1;
}

bool overlap(const Box& a, const Box& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

/// Substeps between two lists of the cells near colliders, and how much nearer than predicted
/// either may come in that time [cells].
constexpr int kListLasts = 8;
constexpr double kListMargin = 0.5;
/// Whether what a collider presses a point with has a bound: kMostOfHeld.
bool is_bounded(const TouchingTissue& state, const Collider& collider, std::int32_t p) {
  const bool at_face = state.points.anchored[p] != 0 && state.points.free_volume_of(p) > 0;
  return collider.kind == Collider::kJaw || at_face;
}

/// The places of a block where a collider touches it.
const std::vector<SurfacePlace>& places_for(const Collider& collider, const Block& block) {
  return collider.kind == Collider::kPlane ? block.merged : block.surface;
}

constexpr double kSurfaceReach = 0.5;  // from the points of a cell to its surface, at most [cells]

/// How much nearer a block's points and a collider may come in a substep [m].
double approach(const TouchingTissue& state, int block, const Collider& collider, float dt) {
  return kListMargin * state.scene.cell_size / kListLasts +
         (state.motion[block].speed + speed(collider)) * dt;
}

float largest_inv_mass(const Nodes& nodes, const CellNodes& cell) {
  float largest = 0;
  for (int row = 0; row < 9; ++row) {
    for (int x = 0; x < 3; ++x) {
      const std::int32_t node = cell.row(row % 3, row / 3)[x];
      if (node >= 0) largest = std::max(largest, nodes.inv_mass[node]);
    }
  }
  return largest;
}

}  // namespace

void forget_near(Contacts& contacts, std::size_t blocks) {
  contacts.near.assign(blocks, {});
  contacts.cells.assign(blocks, {});
  contacts.parts.assign(blocks, {});
  contacts.changes.assign(blocks, {});
  contacts.touching.resize(blocks);
  contacts.until_list = 0;
}

void find_near_colliders(TouchingTissue& state, const std::vector<Box>& reach, double duration,
                         const std::vector<BlockMotion>& before) {
  Contacts& contacts = state.contacts;
  const int count = static_cast<int>(state.blocks.all.size());
  forget_near(contacts, count);
  state.cpu->for_each(count, [&](int i) {
    Box box = state.motion[i].box;
    if (!before.empty()) {
      box.min = box.min.cwiseMin(before[i].box.min);
      box.max = box.max.cwiseMax(before[i].box.max);
    }
    const double margin =
        state.motion[i].speed * duration + (0.5 + kSurfaceReach) * state.scene.cell_size;
    box.min.array() -= margin;
    box.max.array() += margin;
    for (std::size_t c = 0; c < reach.size(); ++c) {
      if (overlap(box, reach[c])) contacts.near[i].push_back(static_cast<std::uint8_t>(c));
    }
  });
}

bool missed_contact(const TouchingTissue& state, const std::vector<Box>& reach) {
  for (std::size_t i = 0; i < state.motion.size(); ++i) {
    const std::vector<std::uint8_t>& near = state.contacts.near[i];
    Box box = state.motion[i].box;
    box.min.array() -= kSurfaceReach * state.scene.cell_size;
    box.max.array() += kSurfaceReach * state.scene.cell_size;
    for (std::size_t c = 0; c < reach.size(); ++c) {
      if (!overlap(box, reach[c])) continue;
      if (std::find(near.begin(), near.end(), c) == near.end()) return true;
    }
  }
  return false;
}

void list_contacts(TouchingTissue& state) {
  Contacts& contacts = state.contacts;
  const std::vector<std::vector<Touch>> before = std::move(contacts.touching);
  contacts.touching.clear();
  forget_near(contacts, state.blocks.all.size());
  if (before.empty()) return;  // on a GPU
  for (std::size_t i = 0; i < state.blocks.all.size(); ++i) {
    const Block& block = *state.blocks.all[i];
    std::vector<Touch>& touches = contacts.touching[i];
    for (int b = state.blocks.origin[i].begin; b < state.blocks.origin[i].end; ++b) {
      for (Touch touch : before[b]) {
        const Points::Site& site = state.points.site[touch.point];
        touch.cell = first_lane(block, touch.point, site);
        if (touch.cell < 0) continue;
        const int sub = sub_position(site);
        touch.key = static_cast<std::uint8_t>(
            touch.key >= kPointKey ? kPointKey + sub : 8 * (sub + 1) + touch.key % 8);
        touches.push_back(touch);
      }
    }
    std::sort(touches.begin(), touches.end(), comes_before);
  }
  tidy_inertia(state, true);
}

void begin_anew(Contacts& contacts, const std::vector<std::int32_t>& points) {
  if (points.empty()) return;
  for (std::vector<Touch>& touches : contacts.touching) {
    for (Touch& touch : touches) {
      if (!std::binary_search(points.begin(), points.end(), touch.point)) continue;
      touch.begun = std::numeric_limits<float>::max();
    }
  }
}

bool is_list_due(Contacts& contacts) {
  const bool due = contacts.until_list == 0;
  contacts.until_list = due ? kListLasts - 1 : contacts.until_list - 1;
  return due;
}

void list_near_cells(TouchingTissue& state, int index, float dt) {
  std::vector<NearCell>& cells = state.contacts.cells[index];
  std::vector<NearPart>& parts = state.contacts.parts[index];
  cells.clear();
  parts.clear();
  if (state.contacts.near[index].empty()) return;
  const Block& block = *state.blocks.all[index];
  const LatticeBody& body = state.bodies[block.body];
  BlockScratch& scratch = state.scratch.local();
  const std::size_t lanes = block.lane_count();
  if (scratch.values.size() < 3 * lanes) scratch.values.resize(3 * lanes);
  if (scratch.lanes.size() < lanes) scratch.lanes.resize(lanes);
  float* x = scratch.values.data();
  state.kernels->positions(block, block_field(state, block), state.nodes.u, scratch, x);
  std::vector<std::uint8_t> points(static_cast<std::size_t>(block.nz) * block.stride);  // of cells
  std::vector<std::uint8_t> near(points.size());
  for (const std::uint8_t c : state.contacts.near[index]) {
    const Collider& collider = state.colliders[c];
    const bool is_blade = collider.kind == Collider::kBlade;
    const bool is_plane = collider.kind == Collider::kPlane;
    const double margin = kListLasts * approach(state, index, collider, dt) +
                          (is_blade ? 0 : kSurfaceReach * body.cell_size);
    const Box box = bounds(collider);
    float min[3], max[3];
    for (int a = 0; a < 3; ++a) {
      min[a] = static_cast<float>(box.min[a] - margin);
      max[a] = static_cast<float>(box.max[a] + margin);
    }
    std::fill(points.begin(), points.end(), std::uint8_t{0});
    std::fill(near.begin(), near.end(), std::uint8_t{0});
    const int found = state.kernels->lanes_in_box(x, lanes, min, max, scratch.lanes.data());
    for (int f = 0; f < found; ++f) {
      const int lane = scratch.lanes[f];
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      // The flats of a blade push where it has cut.
      const bool in_body = state.points.bonds[p] == kAllBonds;
      if (is_blade && in_body) continue;
      // What an anchor holds rests on nothing.
      if (is_plane && !(state.points.free_volume_of(p) > 0)) continue;
      const float at[3] = {x[lane], x[lanes + lane], x[2 * lanes + lane]};
      // Where the flats of a blade end, its gap does: there the box must do.
      if (!is_blade && gap(collider, at).distance > margin) continue;
      const int row = lane / block.stride, cell = row / 8 * block.stride + lane % block.stride;
      near[cell] = 1;
      // Others touch over their places on the surface.
      if (is_blade || in_body) points[cell] |= 1u << row % 8;
    }
    const std::vector<SurfacePlace>& places = places_for(collider, block);
    const int along = parts_along(collider, static_cast<float>(body.cell_size));
    auto place = places.begin();
    for (int z = 0, i = 0; z < block.nz; ++z) {
      for (int lane = 0; lane < block.stride; ++lane, ++i) {
        if (near[i] == 0) continue;
        const std::int32_t cell = z * 8 * block.stride + lane;
        while (place != places.end() && place->cell < cell) ++place;
        const auto first = place;
        while (place != places.end() && place->cell == cell) ++place;
        const int count = is_blade ? 0 : static_cast<int>(place - first);
        if (points[i] == 0 && count == 0) continue;
        const auto first_part = static_cast<std::int32_t>(parts.size());
        if (count > 0) parts.resize(parts.size() + count_parts(&*first, count, along));
        const int node = z * block.plane + block.cell[lane];
        const Vec3 middle = reference_place(body, block, node, {});
        cells.push_back({cell,
                         node,
                         c,
                         points[i],
                         static_cast<std::int32_t>(first - places.begin()),
                         count,
                         {static_cast<float>(middle[0]), static_cast<float>(middle[1]),
                          static_cast<float>(middle[2])},
                         first_part});
      }
    }
  }
}

namespace {

/// What one block's contact adds up to.
struct BlockPush {
  TouchingTissue& state;
  const Block& block;
  const LatticeBody& body;
  float dt;
  float* force;
  std::vector<Touch>::const_iterator held, held_end;
  std::vector<InertiaChange>& changes;
  std::vector<Touch> touching = {};

  /// What the point had before, if it touched the collider then.
  bool find_held(Touch& touch) {
    while (held != held_end && comes_before(*held, touch)) let_go(*held++);
    if (held == held_end || comes_before(touch, *held)) return false;
    touch = *held++;
    return true;
  }
  void let_go_of_rest() {
    while (held != held_end) let_go(*held++);
  }
  void let_go(const Touch& touch) {
    if (touch.inertia == 0) return;
    const Collider& collider = state.colliders[touch.collider];
    const auto& places = places_for(collider, block);
    const auto place = std::lower_bound(places.begin(), places.end(), touch,
                                        [](const SurfacePlace& p, const Touch& t) {
                                          return std::tie(p.cell, p.key) < std::tie(t.cell, t.key);
                                        });
    const int along =
        parts_along(*place, parts_along(collider, static_cast<float>(body.cell_size)));
    change(-1, false, along > 1 ? part_of(*place, along, touch.part) : *place, touch, nullptr);
  }
  void change(float sign, bool begins, const SurfacePlace& place, const Touch& touch,
              const float* velocity) {
    InertiaChange c{sign, begins, place.node, touch.collider, {}, {}, touch.inertia, {}};
    for (int a = 0; a < 3; ++a) {
      c.place[a] = place.place[a];
      c.normal[a] = touch.along[a];
      if (velocity != nullptr) c.velocity[a] = velocity[a];
    }
    changes.push_back(c);
  }
};

/// Pushes on `points` of a cell. Returns whether any touches; else `clear` becomes the distance of
/// the nearest.
bool push_points(BlockPush& b, const NearCell& cell, unsigned points, const Collider& collider,
                 ColliderLoad& load, float& clear) {
  const auto quarter = static_cast<float>(0.25 * b.body.cell_size);
  const CellNodes nodes(b.block, cell.node);
  Vec<4> u[8], v[8], pushes[8];
  values_at_points(b.state.nodes.u, nodes, u);
  bool touches = false;
  for (; points != 0; points &= points - 1) {
    const int s = __builtin_ctz(points), lane = cell.lane + s * b.block.stride;
    const float at[3] = {cell.middle[0] + (s & 1 ? quarter : -quarter) + u[s][0],
                         cell.middle[1] + (s & 2 ? quarter : -quarter) + u[s][1],
                         cell.middle[2] + (s & 4 ? quarter : -quarter) + u[s][2]};
    const Gap g = gap(collider, at);
    if (g.distance >= 0) {
      clear = std::min(clear, clearance(collider, at));
      continue;
    }
    if (!touches) {
      touches = true;
      values_at_points(b.state.nodes.v, nodes, v);
      std::fill_n(pushes, 8, Vec<4>{});
    }
    const std::int32_t p = b.block.point[lane];
    Touch touch{{}, cell.lane, p, static_cast<std::uint8_t>(kPointKey + s), cell.collider, 0, {}};
    if (!b.find_held(touch)) to_local(collider, at, touch.hold);
    const ContactSpring unit = unit_spring(b.body, b.state.points.material_of(p));
    const float moves = b.block.volume[lane];  // none of what an anchor holds does
    const float volume = moves > 0 ? moves : b.state.points.volume[p];
    const float velocity[3] = {v[s][0], v[s][1], v[s][2]};
    float push[3];
    push_point({unit.stiffness * volume, unit.damping * volume}, at, velocity, collider, g, touch,
               push);
    if (is_bounded(b.state, collider, p)) {
      const Material& m = b.body.material_of(b.state.points, p);
      const float most = kMostOfHeld * static_cast<float>(m.young_modulus) * 4 * quarter * quarter;
      const float scale = most / std::sqrt(dot(push, push));
      if (scale < 1) {
        for (float& f : push) f *= scale;
      }
    }
    b.touching.push_back(touch);
    if (moves > 0) pushes[s] = Vec<4>{push[0], push[1], push[2], 0.0f};
    load.push(collider, at, push, 1);
    load.count_inside(collider, g.distance);
  }
  if (touches) spread(b.block, cell.node, pushes, b.force);
  return touches;
}

/// Fields of the nodes, so many components in all, at a place in a cell.
template <int kCount>
TISSUE_SIM_INLINE void values_at(const float* const (&of)[kCount], const CellNodes& cell,
                                 bool has_whole_rows, const AxisWeights& weights,
                                 float (&value)[kCount]) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  Vec<4> sum[kCount] = {};
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      const std::int32_t* n = cell.row(y, z);
      const float w = wz[z] * wy[y];
      if (has_whole_rows) {
        for (int c = 0; c < kCount; ++c) sum[c] += w * load<4>(of[c] + *n);
      } else {
        for (int c = 0; c < kCount; ++c) {
          sum[c] += w * Vec<4>{of[c][n[0]], of[c][n[1]], of[c][n[2]], 0.0f};
        }
      }
    }
  }
  for (int c = 0; c < kCount; ++c) {
    value[c] = wx[0] * sum[c][0] + wx[1] * sum[c][1] + wx[2] * sum[c][2];
  }
}

/// Sum of the squares of the 27 weights.
float squared(const AxisWeights& weights) {
  float product = 1;
  for (int a = 0; a < 9; a += 3) {
    const float* w = weights.of + a;
    product *= w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  }
  return product;
}

/// Substeps until what is so far from a collider may touch it, which comes `nearer` in each [m].
std::uint8_t clear_substeps(float distance, float nearer) {
  return static_cast<std::uint8_t>(std::min<float>(kListLasts, distance / nearer));
}

/// Pushes on the places of a cell on the surface. Adds to `points` those that the collider may
/// hold, for it holds places of theirs: that face away, or so deep that places around are not
/// enough.
class SurfacePush {
 public:
  SurfacePush(BlockPush& block, NearCell& of, const Collider& by, float nearer, ColliderLoad& load,
              unsigned& points)
      : b_(block),
        cell_(of),
        collider_(by),
        nearer_(nearer),
        load_(load),
        points_(points),
        nodes_(b_.block, cell_.node),
        whole_rows_(has_whole_rows(nodes_)),
        h_(static_cast<float>(b_.body.cell_size)),
        unit_area_(0.25f * h_ * h_),
        beside_(collider_.kind == Collider::kJaw ? kBeside * h_ : 0) {}

  void push(NearPart* part) {
    NearPart* const first = part;
    const std::vector<SurfacePlace>& places = places_for(collider_, b_.block);
    PlaceParts parts(places.data() + cell_.first_place, cell_.place_count,
                     parts_along(collider_, h_));
    for (; parts.next(); ++part) {
      if (part->clear > 0) {
        clear_ = std::min<int>(clear_, --part->clear);
      } else {
        push_part(parts, *part);
      }
    }
    if (clear_ == 0) return;
    cell_.clear = static_cast<std::uint8_t>(clear_);
    for (NearPart* of_cell = first; of_cell < part; ++of_cell) of_cell->clear -= clear_;
  }

 private:
  // Cosines: of a surface that faces the tool, and of an added mass that still fits.
  static constexpr float kFacing = -0.1f, kTurned = 0.98f;
  static constexpr float kDeep = 0.2f;     // from where on a point is looked at by itself [cells]
  static constexpr float kBeside = 0.25f;  // how close to a jaw tissue takes part of what it
                                           // presses with [cells]: places are no denser than that

  void push_part(PlaceParts& parts, NearPart& part) {
    const SurfacePlace& place = parts.place();
    const AxisWeights weights(place.place);
    Touch touch{{},        cell_.lane,     place.point,
                place.key, cell_.collider, static_cast<std::uint8_t>(parts.part()),
                {}};
    const bool is_held = b_.find_held(touch);
    float moved[6] = {}, at[3];  // displacement and velocity
    measure(weights, is_held, moved);
    for (int a = 0; a < 3; ++a) at[a] = cell_.middle[a] + place.place[a] * h_ + moved[a];
    const Gap g = gap(collider_, at);
    if (g.distance >= 0) {
      if (is_held) b_.let_go(touch);
      return pass_by(place, g, part);
    }
    clear_ = 0;
    if (!is_held) {
      if (faces_away(place, g)) {  // the far side of something thin
        points_ |= place.points;
        return;
      }
      to_local(collider_, at, touch.hold);
      touch.begun = -g.distance;
      measure(weights, true, moved);
    }
    if (g.distance < -kDeep * h_) points_ |= place.points;
    learn_material(place.point);
    PushedPlace pushed{at, moved + 3, place.area, static_cast<float>(parts.count())};
    if (is_bounded(b_.state, collider_, place.point)) {
      pushed.most = kMostOfHeld * young_modulus_ * place.area;
    }
    const ToolPush push = push_tool(
        tissue_, pushed, collider_, g, is_held, b_.dt,
        [&](float per_mass) { return mobility_over(per_mass, weights, part); }, touch);
    if (b_.state.points.free_volume_of(place.point) > 0) {
      spread(b_.block, cell_.node, weights, push.force, b_.force);
      add_mass(place, g, at, push.across, touch);
    }
    b_.touching.push_back(touch);
    load_.push(collider_, at, push.force, place.area / unit_area_);
  }

  /// Displacement there; with `all` velocity, too.
  void measure(const AxisWeights& weights, bool all, float (&moved)[6]) const {
    const Nodes& n = b_.state.nodes;
    if (all) {
      const float* const of[6] = {n.u[0].data(), n.u[1].data(), n.u[2].data(),
                                  n.v[0].data(), n.v[1].data(), n.v[2].data()};
      return values_at(of, nodes_, whole_rows_, weights, moved);
    }
    const float* const of[3] = {n.u[0].data(), n.u[1].data(), n.u[2].data()};
    float only[3];
    values_at(of, nodes_, whole_rows_, weights, only);
    std::copy_n(only, 3, moved);
  }

  bool faces_away(const SurfacePlace& place, const Gap& g) const {
    float F[9], n[3], along = 0, length = 0;
    deformation_gradient_at(b_.state.nodes.u, nodes_, b_.body.cell_size, place.place, F);
    cofactor_times(F, place.normal, n);
    for (int a = 0; a < 3; ++a) {
      along += n[a] * g.normal[a];
      length += n[a] * n[a];
    }
    return along > kFacing * std::sqrt(length);
  }

  /// The collider does not touch the place, but a jaw may be so near that it counts.
  void pass_by(const SurfacePlace& place, const Gap& g, NearPart& part) {
    part.clear = clear_substeps(std::max(0.0f, g.distance - beside_), nearer_);
    clear_ = std::min<int>(clear_, part.clear);
    if (g.distance >= beside_) return;
    if (part.side == NearPart::kUnknown) {
      part.side = faces_away(place, g) ? NearPart::kAway : NearPart::kTowards;
    }
    if (part.side == NearPart::kTowards) {
      load_.points += (1 - g.distance / beside_) * place.area / unit_area_;
    }
  }

  void learn_material(std::int32_t point) {
    const int own = b_.state.points.material_of(point);
    if (own == material_) return;
    material_ = own;
    const Material& m = b_.body.materials[own];
    young_modulus_ = static_cast<float>(m.young_modulus);
    tissue_ = pushed_tissue(static_cast<float>(lame_lambda(m) + 2 * lame_mu(m)),
                            static_cast<float>(m.density), h_, collider_.radius, b_.dt);
  }

  float mobility_over(float per_mass, const AxisWeights& weights, NearPart& part) {
    if (cell_.lightest < 0) cell_.lightest = largest_inv_mass(b_.state.nodes, nodes_);
    if (!(per_mass * cell_.lightest * squared(weights) > 1)) return 0;  // it is that at most
    if (part.mobility < 0) {
      part.mobility = static_cast<float>(mobility(b_.state.nodes, nodes_, weights));
    }
    return per_mass * part.mobility;
  }

  /// Beside a spring that begins, or whose normal turned.
  void add_mass(const SurfacePlace& place, const Gap& g, const float* at, float across,
                Touch& touch) {
    float along = 0;
    for (int a = 0; a < 3; ++a) along += touch.along[a] * g.normal[a];
    const bool begins = touch.inertia == 0;
    if (!begins && along >= kTurned) return;
    if (!begins) b_.change(-1, false, place, touch, nullptr);
    const float dt = b_.state.contacts.inertia.dt;
    touch.inertia = kInertia * across * (dt * dt);
    std::copy_n(g.normal, 3, touch.along);
    float of_collider[3];
    velocity_at(collider_, at, of_collider);
    b_.change(1, begins, place, touch, of_collider);
  }

  BlockPush& b_;
  NearCell& cell_;
  const Collider& collider_;
  float nearer_;
  ColliderLoad& load_;
  unsigned& points_;
  CellNodes nodes_;
  bool whole_rows_;
  float h_, unit_area_, beside_;
  int material_ = -1, clear_ = kListLasts;
  PushedTissue tissue_{};
  float young_modulus_ = 0;
};

}  // namespace

void add_contact(TouchingTissue& state, int index, float dt, float* force,
                 std::vector<ColliderLoad>& loads) {
  Contacts& contacts = state.contacts;
  const Block& block = *state.blocks.all[index];
  contacts.changes[index].clear();
  BlockPush b{state,
              block,
              state.bodies[block.body],
              dt,
              force,
              contacts.touching[index].cbegin(),
              contacts.touching[index].cend(),
              contacts.changes[index]};
  b.touching.reserve(contacts.touching[index].size());
  int last = -1;
  float nearer = 0;
  for (NearCell& cell : contacts.cells[index]) {
    const Collider& collider = state.colliders[cell.collider];
    if (cell.collider != last) {
      last = cell.collider;
      nearer = static_cast<float>(approach(state, index, collider, dt));
    }
    ColliderLoad& load = loads[cell.collider];
    // Points within the body touch where a tool is so thin that it came between places of the
    // surface, all that lost bonds touch a blade; others where their places do not hold them:
    // a flake between two cuts has none at its edge.
    unsigned points = 0;
    if (cell.clear > 0) {
      --cell.clear;
    } else if (cell.place_count > 0) {
      SurfacePush(b, cell, collider, nearer, load, points)
          .push(contacts.parts[index].data() + cell.first_part);
    }
    const bool all = cell.points_clear == 0;
    if (all) {
      points |= cell.points;
    } else {
      --cell.points_clear;
    }
    if (points == 0) continue;
    float clear = std::numeric_limits<float>::max();
    const bool touches = push_points(b, cell, points, collider, load, clear);
    if (all && !touches) cell.points_clear = clear_substeps(clear, nearer);
  }
  // A point that no longer touches forgets where it was held.
  b.let_go_of_rest();
  contacts.touching[index] = std::move(b.touching);
}

}  // namespace tissue_sim
