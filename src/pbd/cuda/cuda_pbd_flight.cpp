// Momentum of what flies freely (free_flight.h), summed up on the GPU by chunks.
#include <algorithm>

#include "pbd/cuda/on_device.h"
#include "pbd/viscosity.h"

namespace tissue_sim {
namespace {

/// Vertices of a chunk at most: what a block of threads, or a warp of the one block that there is,
/// sums up for keep_momentum().
constexpr int kChunk = 1024, kChunkOfWarp = 128;

}  // namespace

void CudaPbdTissue::upload_chunks() {
  OnDevice& d = *device_;
  const pbd::State& s = *state_;
  std::vector<std::vector<std::int32_t>> of(s.components);
  std::vector<bool> is_free(s.components, true);
  d.component_mass.assign(s.components, 0);
  for (int i = 0; i < d.count; ++i) {
    const std::int32_t c = s.component[i];
    of[c].push_back(i);
    d.component_mass[c] += s.vertices.mass[i];
    if (s.vertices.anchored[i] != 0) is_free[c] = false;
  }
  const int most = d.way == Way::kLaunches ? kChunk : kChunkOfWarp;
  std::vector<std::int32_t> order;
  std::vector<pbd::CudaPbdChunk> chunks;
  d.component_of_chunk.clear();
  for (std::int32_t c = 0; c < s.components; ++c) {
    if (!is_free[c]) continue;
    const auto begin = static_cast<std::int32_t>(order.size());
    order.insert(order.end(), of[c].begin(), of[c].end());
    const auto end = static_cast<std::int32_t>(order.size());
    for (std::int32_t at = begin; at < end; at += most) {
      chunks.push_back({at, std::min(end, at + most), of[c].front()});
      d.component_of_chunk.push_back(c);
    }
  }
  d.order.upload(order, d.stream);
  d.chunks.upload(chunks, d.stream);
  d.component.upload(s.component, d.stream);
  d.flights.resize(2 * chunks.size());
  d.host_flights.resize(2 * chunks.size());
  d.wait("receive data");
}

std::vector<pbd::Flight> CudaPbdTissue::flights(const pbd::CudaPbdFlight* of_chunks) const {
  const OnDevice& d = *device_;
  std::vector<pbd::Flight> of(d.component_mass.size());
  for (pbd::Flight& f : of) f.is_free = false;
  std::vector<Eigen::Matrix3d> second(of.size(), Eigen::Matrix3d::Zero());
  std::vector<Vec3> moment(of.size(), Vec3::Zero());
  for (std::size_t k = 0; k < d.component_of_chunk.size(); ++k) {
    const pbd::CudaPbdFlight& sum = of_chunks[k];
    const std::int32_t c = d.component_of_chunk[k];
    pbd::Flight& f = of[c];
    f.is_free = true;
    f.centre = Vec3(sum.origin);  // the same of all its chunks, until all are summed up
    moment[c] += Vec3(sum.moment);
    f.linear += Vec3(sum.linear);
    f.angular += Vec3(sum.angular);
    const double* q = sum.second;
    Eigen::Matrix3d m;
    m << q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2];
    second[c] += m;
  }
  for (std::size_t c = 0; c < of.size(); ++c) {
    pbd::Flight& f = of[c];
    f.mass = d.component_mass[c];
    if (!f.is_free) continue;
    const Vec3 from_origin = moment[c] / f.mass;
    f.centre += from_origin;
    f.angular -= from_origin.cross(f.linear);
    second[c] -= f.mass * from_origin * from_origin.transpose();
    f.inertia = second[c].trace() * Eigen::Matrix3d::Identity() - second[c];
  }
  return of;
}

void CudaPbdTissue::keep_momentum(int steps, float h) {
  OnDevice& d = *device_;
  pbd::State& s = *state_;
  const std::size_t chunks = d.component_of_chunk.size();
  const pbd::CudaPbdFlight* sums = d.host_flights.data();
  const std::vector<pbd::Flight> now = flights(sums + chunks);
  std::vector<pbd::Flight> flying = now;
  for (std::size_t k = 0; k < chunks; ++k) {
    if (sums[chunks + k].pushed != 0) flying[d.component_of_chunk[k]].is_free = false;
  }
  std::vector<pbd::RigidChange> changes = pbd::missing_motion(s, flights(sums), flying, steps, h);
  const double duration = steps * h;
  const bool are_known = s.damped_for == duration;
  if (!pbd::make_dampers(s, duration)) {
    change_rigidly(changes);
    return;
  }
  // damp_neighbours(); what moves rigidly is taken off together with what is given above.
  if (!are_known) {
    d.dampers.upload(s.dampers, d.stream);
    d.damping.clear();
  }
  std::vector<Vec3> spins, left;  // left: angular momentum without that spin
  for (std::size_t c = 0; c < changes.size(); ++c) {
    pbd::RigidChange& change = changes[c];
    const Vec3 angular = change.keep * now[c].angular + now[c].inertia * change.spin;
    spins.push_back(spin_of(now[c], angular));
    left.push_back(angular - now[c].inertia * spins[c]);
    change.is_free = true;
    change.linear += change.spin.cross(now[c].centre - change.centre);
    change.centre = now[c].centre;
    change.spin -= spins[c];
  }
  change_rigidly(changes);
  if (d.damping.is_empty()) {
    d.damping.record(d.stream, [&] {
      launch_pbd_dampers(d.field(), s.dampers.begin, d.stream);
      const pbd::CudaPbdFlights all{d.chunks.data(), static_cast<int>(chunks), d.order.data()};
      launch_pbd_flights(d.field(), all, d.flights.data(), d.stream);
    });
  }
  d.damping.launch(d.stream);
  d.flights.download(d.host_flights.data(), chunks, d.stream);
  d.wait("damp neighbours");
  const std::vector<pbd::Flight> after = flights(sums);
  for (std::size_t c = 0; c < changes.size(); ++c) {
    changes[c] = {true, 1, after[c].centre, Vec3::Zero(),
                  spins[c] + spin_of(after[c], left[c] - after[c].angular)};
  }
  change_rigidly(changes);
}

void CudaPbdTissue::change_rigidly(const std::vector<pbd::RigidChange>& changes) {
  OnDevice& d = *device_;
  // The GPU reads them where they are: what was launched before was waited for.
  d.host_changes.resize(changes.size());
  pbd::CudaPbdChange* packed = d.host_changes.data();
  bool any = false;
  for (std::size_t c = 0; c < changes.size(); ++c) {
    packed[c].is_free = changes[c].is_free ? 1 : 0;
    packed[c].keep = changes[c].keep;
    any = any || changes[c].is_free;
    for (int a = 0; a < 3; ++a) {
      packed[c].centre[a] = changes[c].centre[a];
      packed[c].linear[a] = changes[c].linear[a];
      packed[c].spin[a] = changes[c].spin[a];
    }
  }
  if (!any) return;
  const bool few = d.way != Way::kLaunches;
  if (!few) d.changes.upload(packed, changes.size(), d.stream);
  launch_pbd_changes(d.field(), d.component.data(), few ? packed : d.changes.data(), d.stream);
}

}  // namespace tissue_sim
