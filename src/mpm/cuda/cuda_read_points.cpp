// Clouds of tissue that lives on a GPU.
#include <algorithm>
#include <cstring>
#include <vector>

#include "fragments/piece_colour.h"
#include "frame/select_points.h"
#include "mpm/cuda/on_device.h"
#include "mpm/lattice/bonds.h"
#include "mpm/state_figures.h"

namespace tissue_sim {

namespace {

void upload_points(CudaTissue& d) {
  if (!d.points_changed) return;
  const Points& points = d.state.points;
  if (d.whole.size() == 0) {
    std::vector<std::uint8_t> whole(points.size());
    for (int p = 0; p < points.size(); ++p) {
      whole[p] = static_cast<std::uint8_t>(
          __builtin_popcount(whole_bonds(d.state.bodies[points.site[p].body], points, p)));
    }
    d.whole.upload(whole, d.stream);
  }
  std::vector<std::uint32_t> colour(d.pieces.next_id, 0);
  for (const Fragment& f : d.pieces.all) colour[f.id] = piece_colour(f);
  d.colour.upload(colour, d.stream);
  d.piece.upload(d.pieces.of_point, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  d.points_changed = false;
}

/// Which points a cloud has, and where they are in it: `place`, or each of the stride.
int choose_points(CudaTissue& d, const PointSelection& selection,
                  std::vector<std::int32_t>& place) {
  const Points& points = d.state.points;
  const int stride = std::max(1, selection.stride);
  int count = (points.size() + stride - 1) / stride;
  if (selection.surface_only || selection.loose_only || selection.fields != 0) {
    place = select_points(
        selection, d.pieces, [&](std::int32_t p) { return points.bonds[p] != kAllBonds; }, count);
  }
  return count;
}

/// Enqueues that the GPU writes them.
void write_points(CudaTissue& d, int stride, const std::vector<std::int32_t>& place, Point* cloud) {
  upload_points(d);
  CudaCloud c;
  c.stride = std::max(1, stride);
  c.place = nullptr;
  if (!place.empty()) {
    d.place.upload(place, d.stream);
    c.place = d.place.data();
  }
  c.points = cloud;
  c.piece = d.piece.data();
  c.colour = d.colour.data();
  c.whole = d.whole.data();
  launch_cloud(d.tables(), d.present(), d.plan.max_slots, c, d.stream);
  put_anchored_points(d, place, c.stride, cloud);
}

}  // namespace

GpuPoints CudaTissue::read_points_on_gpu(const PointSelection& selection) {
  CudaTissue& d = *this;
  if (selection.fields != 0) {  // which the host makes
    std::vector<std::uint8_t> cloud;
    const int count = read_points(selection, cloud);
    return d.lent.lend(cloud, count, d.stream);
  }
  std::vector<std::int32_t> place;
  const int count = choose_points(d, selection, place);
  std::uint8_t* const cloud = d.lent.take(count * sizeof(Point)).data();
  if (count > 0) write_points(d, selection.stride, place, reinterpret_cast<Point*>(cloud));
  return d.lent.lend(count, d.stream);
}

int CudaTissue::read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) {
  CudaTissue& d = *this;
  std::vector<std::int32_t> place;
  const int count = choose_points(d, selection, place);
  if (count == 0) {
    cloud.clear();
    return 0;
  }
  d.cloud.resize(count);
  d.host_cloud.resize(count);
  write_points(d, selection.stride, place, d.cloud.data());
  // In parts: while one is under way, the host copies the one before.
  const int parts = static_cast<int>(d.cloud_came.size());
  const auto begin_of = [&](int part) {
    return static_cast<int>(static_cast<std::int64_t>(count) * part / parts);
  };
  for (int i = 0; i < parts; ++i) {
    const int first = begin_of(i);
    check_cuda(cudaMemcpyAsync(d.host_cloud.data() + first, d.cloud.data() + first,
                               (begin_of(i + 1) - first) * sizeof(Point), cudaMemcpyDeviceToHost,
                               d.stream),
               "send a cloud");
    d.cloud_came[i].record(d.stream);
  }
  // While the points are under way: the memory of a new message is touched for the first time.
  cloud.resize(static_cast<std::size_t>(count) * sizeof(Point));
  for (int i = 0; i < parts; ++i) {
    d.cloud_came[i].wait();
    const int part = begin_of(i), size = begin_of(i + 1) - part;
    constexpr int kChunk = 4096;  // points, an eighth of a megabyte
    d.state.cpu->for_each((size + kChunk - 1) / kChunk, [&](int k) {
      const int first = part + k * kChunk, n = std::min(kChunk, part + size - first);
      std::memcpy(cloud.data() + static_cast<std::size_t>(first) * sizeof(Point),
                  d.host_cloud.data() + first, static_cast<std::size_t>(n) * sizeof(Point));
    });
  }
  if (selection.fields != 0) {
    pull_nodes(d);
    add_point_fields(d.state, selection, place, count, cloud);
  }
  return count;
}

}  // namespace tissue_sim
