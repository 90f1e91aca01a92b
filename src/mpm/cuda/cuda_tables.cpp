// The tables of tissue that lives on a GPU, when it is new or was cut.
#include <algorithm>

#include "mpm/cuda/on_device.h"
#include "mpm/cuda/parts_on_device.h"

namespace tissue_sim {
namespace {

/// What the tables and the state take on the GPU, `of_places` of that where the surface is; clouds
/// and contacts between tissue come on top.
std::size_t bytes_of(const HostTables& t, std::size_t nodes, std::size_t points, std::size_t held,
                     std::size_t most_held, std::size_t of_places) {
  constexpr int sums = 3 * (kPushStride + kInertiaStride);
  const std::size_t of_contact = sums * sizeof(long long) * nodes + 6 * t.lanes;
  constexpr std::size_t of_connecting = 16;  // two numbers a slot, and as much again to sort them
  return t.blocks.size() * (sizeof(CudaBlock) + sizeof(CudaMeasure)) +
         t.bundles.size() * sizeof(CudaBundle) + t.columns.size() * sizeof(CudaColumn) +
         t.slots * (of_connecting + 16 + sizeof(uint4) + 2 * sizeof(float4)) + 8 * t.lanes +
         t.lanes / 2 + (6 * sizeof(float4) + 1) * nodes + points + 17 * held +
         most_held * sizeof(HeldPoint) + of_places + (held > 0 ? of_contact : 0);
}

/// Says how much memory the tissue takes, where the GPU has less.
void check_memory(const CudaTissue& d, std::size_t wanted) {
  const std::size_t all = device_bytes_held, held = all - std::min(all, d.others_hold);
  if (wanted <= held) return;
  std::size_t free = 0, total = 0;
  check_cuda(cudaMemGetInfo(&free, &total), "be asked");
  if (wanted <= free + held) return;
  const auto megabytes = DeviceArray<char>::megabytes;
  throw OutOfMemory("the GPU's memory does not suffice: the scene needs " + megabytes(wanted) +
                    ", " + megabytes(free + held) + " of " + megabytes(total) +
                    " are free; raise cell_size or set device to cpu");
}

/// How the blocks are worked on, and the tables for it.
void plan_tables(CudaTissue& d) {
  d.plan.threads = d.shape.threads;
  d.plan.small = d.shape.small;
  d.plan.pairs = d.shape.pairs();
  d.plan.max_slots = d.plan.max_plane_slots = d.plan.max_held = 0;
  const std::vector<Block*>& blocks = d.state.blocks.all;
  for (const Block* b : blocks) {
    const int plane = (b->nx + 2) * (b->ny + 2);
    d.plan.max_slots = std::max(d.plan.max_slots, plane * (b->nz + 2));
    d.plan.max_plane_slots = std::max(d.plan.max_plane_slots, plane);
  }
  for (const LatticeBody& b : d.state.bodies) {
    for (const Material& m : b.materials) {
      const bool neo_hookean = m.law == Law::kNeoHookean;
      d.plan.neo_hookean = d.plan.neo_hookean || neo_hookean;
      d.plan.fixed_corotated = d.plan.fixed_corotated || !neo_hookean;
      d.plan.viscous = d.plan.viscous || m.viscosity > 0;
    }
  }
  const auto choose = [&d](std::size_t count) {
    for (int way = 0; way < CudaTissue::kWays; ++way) {
      CudaPlan& plan = d.plans[way];
      if (way > 0) plan = d.plans[way - 1];
      plan.pushes = way >= CudaTissue::kWithTools;
      plan.touches = way >= CudaTissue::kWithTissue;
      plan.fronts = way >= CudaTissue::kWithFronts;
      plan.resident = resident_blocks(plan, static_cast<int>(count));
    }
  };
  choose(blocks.size());
  std::vector<std::vector<int>> bundles;
  CudaPlan& push_plan = d.plans[CudaTissue::kWithTools];
  if (!(d.plan.cached && push_plan.cached)) {
    const auto at_once = static_cast<std::size_t>(
        std::max(1, std::min(most_at_once(d.plan), most_at_once(push_plan))));
    if (blocks.size() > at_once) {
      push_plan.max_plane_slots = most_plane_slots(d.plan.max_plane_slots);
      const BundleSize limits = {d.shape.columns(), push_plan.max_plane_slots,
                                 most_slots(push_plan)};
      bundles = bundle_in_rounds(blocks_to_bundle(blocks), at_once,
                                 d.plan.small ? at_once : blocks.size(), limits);
    }
    if (bundles.empty()) {
      bundles = single_blocks(blocks, d.plan.small ? at_once : blocks.size(), *d.state.cpu);
    }
  } else {
    bundles = single_blocks(blocks, blocks.size(), *d.state.cpu);
  }
  const auto processors = static_cast<std::size_t>(d.limits.processors);
  if (d.state.blocks.has_halves() && (d.state.blocks.room == 0 || bundles.size() > processors)) {
    divide_anew(d, 0);  // all or none: there is no room for halves any more
    plan_tables(d);
    return;
  }
  HostTables& t = d.host_tables;
  make_tables(d.state, bundles, t);
  d.plan.max_slots = t.max_slots;
  d.plan.max_plane_slots = t.max_plane_slots;
  d.plan.max_columns = t.max_columns;
  make_face_rows(d.state, t, t.max_plane_slots, d.anchors.made);
  d.plan.max_held = d.anchors.made.most_held;
  choose(t.bundles.size());
  if (std::any_of(d.plans, d.plans + CudaTissue::kWays,
                  [](const CudaPlan& plan) { return plan.resident == 0; })) {
    throw std::runtime_error("the GPU has too little shared memory");
  }
}

}  // namespace

void push(CudaTissue& d) {
  d.host_tables.number.clear();  // all blocks are new
  push_tables(d);
  d.bonds.upload(d.state.points.bonds, d.stream);
  if (!d.state.points.soft.empty()) d.soft.upload(d.state.points.soft, d.stream);
  push_outer_points(d);
  push_lightness(d);
  push_nodes(d);
  push_anchors(d);
}

void push_outer_points(CudaTissue& d) {
  if (!d.outer_points) return;
  const auto count = static_cast<std::size_t>(d.state.points.size());
  std::vector<float4> place(count), plane(d.place_parts > 1 ? count : 0);
  std::vector<float> area(count);
  d.state.cpu->for_each(
      static_cast<int>(count),
      [&](int p) {
        const CudaOuterPlace at = d.outer_points->of(d.state, p);
        place[p] = at.place;
        area[p] = at.area;
        if (!plane.empty()) plane[p] = at.plane;
      },
      4096);
  d.outer.upload(place, d.stream);
  d.area.upload(area, d.stream);
  d.planes.upload(plane, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void push_tables(CudaTissue& d) {
  plan_tables(d);
  const HostTables& t = d.host_tables;
  const std::size_t n = d.state.nodes.size();
  const auto points = static_cast<std::size_t>(d.state.points.size());
  const Scene& scene = d.state.scene;
  const int colliders = collider_count(scene) - (scene.ground.enabled ? 0 : 1);
  d.held_by = std::min(colliders, 2);
  d.place_parts = has_thin_tools(scene) ? kPlaceParts : 1;
  const std::size_t held = points * d.place_parts * d.held_by;
  const std::size_t most_held = CudaTissue::Checkpoint::most_held(held);
  const std::size_t of_places =
      held > 0 ? points * (sizeof(float) + sizeof(float4) * (d.place_parts > 1 ? 2 : 1)) : 0;
  check_memory(d, bytes_of(t, n, points, held, most_held, of_places));
  check_cuda(cudaStreamSynchronize(d.stream), "finish a frame");
  d.blocks.upload(t.blocks, d.stream);
  d.bundles.upload(t.bundles, d.stream);
  d.columns.upload(t.columns, d.stream);
  d.bodies.upload(t.bodies, d.stream);
  if (t.all_new) {
    d.of_blocks.upload(t.made, d.stream);
  } else {
    d.made.upload(t.made, d.stream);
    d.origins.upload(t.origin, d.stream);
    d.spare.resize(t.slots, t.lanes);
    launch_move_tables(d.blocks.data(), d.origins.data(), static_cast<int>(t.blocks.size()),
                       d.of_blocks, d.made, d.spare, d.stream);
    d.of_blocks.swap(d.spare);
  }
  const std::size_t slots = t.slots;
  d.slot_parts.resize(slots);
  d.first_parts.resize(slots);
  d.parts.resize(slots);
  d.most_sharing.resize(1);
  connect_slots({d.of_blocks.slot_node.data(), d.slot_parts.data(), d.first_parts.data(),
                 d.parts.data(), slots},
                n, d.connect_room, d.most_sharing.data(), d.stream);
  d.pushed_parts.resize(slots);
  if (d.marks.size() != n) {
    d.marks.resize(n);
    d.marks.clear(d.stream);
  }
  d.front.marked = false;
  for (auto& force : d.force) {
    force.resize(slots);
    force.clear(d.stream);
  }
  if (d.with.size() != held) {
    d.with.resize(held);
    d.with.clear(d.stream);
    d.hold.resize(held);
    d.hold.clear(d.stream);
  }
  d.checkpoint.resize(n, d.with.size());
  d.arrived.resize(kArrivedWords);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  if (d.most_sharing[0] > kMostSharing) {
    throw std::runtime_error("a node is shared by more than " + std::to_string(kMostSharing) +
                             " blocks, as many as the GPU's tables hold: set device to cpu");
  }
}

void make_blocks(CudaTissue& d, const CudaShape& shape, int room) {
  d.shape = shape;
  d.shape.blocks.uniform = true;
  d.shape.blocks.has_rows = false;
  d.shape.blocks.room = room;
  d.state.blocks = tissue_sim::make_blocks(d.state, d.shape.blocks, *d.state.cpu);
  // Where there are more, the first cuts take what is left.
  constexpr double kFewRegions = 0.8;
  if (static_cast<double>(d.state.blocks.regions.size()) > kFewRegions * room) {
    d.state.blocks.room = 0;
  }
  d.host_tables.number.clear();
  list_facets(d.state);
}

void divide_anew(CudaTissue& d, int room) {
  make_blocks(d, d.cut_shape, room);
  // Until they are measured, any block may be where any of the tissue is.
  std::vector<std::vector<BlockMotion>*> bounds = {&d.state.motion};
  if (d.run.frame) bounds.push_back(&d.run.frame->before);
  for (std::vector<BlockMotion>* const motion : bounds) {
    BlockMotion all;
    for (const BlockMotion& m : *motion) {
      all.box.min = all.box.min.cwiseMin(m.box.min);
      all.box.max = all.box.max.cwiseMax(m.box.max);
      if (!(m.speed <= all.speed)) all.speed = m.speed;
    }
    motion->assign(d.state.blocks.all.size(), all);
  }
}

void make_room_for_cuts(CudaTissue& d) {
  if (d.shape == d.cut_shape) return;
  divide_anew(d, d.limits.processors);
}

}  // namespace tissue_sim
