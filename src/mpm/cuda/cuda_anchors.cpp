// Anchors of tissue that lives on a GPU: the host says which rows of nodes their faces hold, as on
// the CPU; the substeps' kernels hold them.
#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "mpm/cuda/on_device.h"
#include "mpm/state_figures.h"

namespace tissue_sim {
namespace {

CudaAnchorPlace place_of(const RigidMotion& m) {
  CudaAnchorPlace p;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) p.rotation[3 * a + b] = m.rotation(a, b);
    p.translation[a] = m.translation[a];
  }
  return p;
}

/// Adds CudaHeldFaces::pull of an anchor about `origin`.
void add_pull(const RigidMotion& before, const RigidMotion& after, const Vec3& origin, double drift,
              std::vector<float4>& pull) {
  const Eigen::Matrix3d rotation =
      after.rotation - before.rotation + drift * (before.rotation - Eigen::Matrix3d::Identity());
  const Vec3 shift = after.translation - before.translation + drift * before.translation;
  const Vec3 at_origin = shift + rotation * origin;
  for (int k = 0; k < 4; ++k) {
    const Vec3 c = (k < 3 ? Vec3(rotation.col(k)) : at_origin);
    pull.push_back(
        {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2]), 0});
  }
}

void push_impulses(CudaTissue& d) {
  const auto& impulse = d.state.anchors.impulse;
  static_assert(sizeof(impulse[0]) == 3 * sizeof(double), "three numbers a row");
  d.anchors.impulse.upload(reinterpret_cast<const double*>(impulse.data()), 3 * impulse.size(),
                           d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

}  // namespace

void push_anchors(CudaTissue& d) {
  const AnchorFaces& faces = d.state.anchors;
  AnchorsOnDevice& to = d.anchors;
  const bool is_made = std::exchange(to.made.is_new, false);
  if (faces.groups.empty() && faces.held.empty() && to.chunks.size() == 0) return;
  if (!is_made) make_face_rows(d.state, d.host_tables, d.plan.max_plane_slots, to.made);
  const HostFaceRows& t = to.made;
  std::vector<CudaRowNodes> rows(faces.rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const FaceRow& r = faces.rows[i];
    std::copy_n(r.node, kRowNodes, rows[i].node);
    std::copy_n(r.weight, kRowNodes, rows[i].weight);
    std::copy_n(r.share, kRowNodes, rows[i].share);
  }
  std::vector<CudaRowGroup> groups;
  for (const FaceGroup& g : faces.groups) groups.push_back({g.first, g.count, g.inverse});
  to.first_carried.upload(t.first_carried, d.stream);
  to.chunks.upload(t.chunks, d.stream);
  to.entries.upload(t.entries, d.stream);
  launch_connect(to.entries.data(), static_cast<int>(t.entries.size()), d.tables(), d.stream);
  to.first_held.upload(t.first_held, d.stream);
  to.held.upload(t.held, d.stream);
  launch_connect(to.held.data(), static_cast<int>(t.held.size()), d.tables(), d.stream);
  to.carries_always = t.carries_always;
  to.shares.upload(t.shares, d.stream);
  to.rows.upload(t.rows, d.stream);
  to.carried.upload(t.carried, d.stream);
  to.groups.upload(groups, d.stream);
  to.row_nodes.upload(rows, d.stream);
  to.inverse.upload(faces.inverse, d.stream);
  to.room_each = t.room_each;
  to.room.resize(t.room_each * d.bundles.size());
  push_impulses(d);
}

void push_lightness(CudaTissue& d) {
  const Points& points = d.state.points;
  if (points.lightness.empty()) return;
  std::vector<float> lightness(points.lightness.begin(), points.lightness.end());
  for (std::size_t p = 0; p < lightness.size(); ++p) {
    if (points.bonds[p] != d.state.whole_bonds[p] && lightness[p] > 0) lightness[p] = 1;
  }
  d.anchors.lightness.upload(lightness, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void pull_impulses(CudaTissue& d) {
  auto& impulse = d.state.anchors.impulse;
  if (impulse.empty()) return;
  d.anchors.impulse.download(reinterpret_cast<double*>(impulse.data()), 3 * impulse.size(),
                             d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
}

void upload_anchor_places(CudaTissue& d) {
  std::vector<CudaAnchorPlace> places;
  std::vector<float4> pull;
  if (!d.run.frame->input.anchors.empty()) {
    const std::vector<Vec3>& origin = d.state.anchors.origin;
    std::vector<RigidMotion> before = d.state.anchors.now;
    for (const RigidMotion& m : before) places.push_back(place_of(m));
    for (int i = 0; i < d.loads_of; ++i) {
      std::vector<RigidMotion> after =
          anchors_at(d.state.anchors, d.run.frame->input, d.share_of(i));
      for (std::size_t k = 0; k < after.size(); ++k) {
        places.push_back(place_of(after[k]));
        add_pull(before[k], after[k], origin[k], face_drift(d.part.substeps.at(i)), pull);
      }
      before = std::move(after);
    }
  }
  if (places.empty() && d.anchors.places.size() == 0) return;
  d.anchors.places.upload(places, d.stream);
  d.anchors.pull.upload(pull, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void leave_anchors(CudaTissue& d, int done) {
  if (d.run.frame->input.anchors.empty() || done == 0) return;
  d.state.anchors.now = anchors_at(d.state.anchors, d.run.frame->input, d.share_of(done - 1));
}

void put_anchored_points(CudaTissue& d, const std::vector<std::int32_t>& index, int stride,
                         Point* cloud) {
  const std::vector<std::int32_t>& points = d.anchors.held_points;
  std::vector<AnchoredPoint> held(points.size());
  d.state.cpu->for_each(
      static_cast<int>(points.size()),
      [&](int k) {
        const std::int32_t p = points[k];
        Vec3 place;
        held[k].index = !index.empty() ? index[p] : (p % stride == 0 ? p / stride : -1);
        if (held[k].index < 0) return;
        if (!held_place(d.state, p, place)) {
          held[k].index = -1;
          return;
        }
        for (int a = 0; a < 3; ++a) held[k].x[a] = static_cast<float>(place[a]);
      },
      4096);
  d.anchored_points.upload(held, d.stream);
  launch_anchored(d.anchored_points.data(), static_cast<int>(held.size()), cloud, d.stream);
}

}  // namespace tissue_sim
