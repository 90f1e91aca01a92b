// What is measured of tissue that lives on a GPU: its figures at the end of a frame, and the
// substep that it bears.
#include <algorithm>
#include <cmath>
#include <limits>

#include "frame/out_of_control.h"
#include "math/lanczos.h"
#include "mpm/cuda/cuda_linearised_motion.h"
#include "mpm/cuda/on_device.h"
#include "mpm/fragment_forecast.h"
#include "mpm/linearised_motion.h"
#include "mpm/state_figures.h"

namespace tissue_sim {

double CudaTissue::measure_limit(const std::vector<std::uint8_t>&, int steps) {
  CudaTissue& d = *this;
  CudaFrame frame{};
  for (int i = 0; i < 2; ++i) frame.force[i] = d.force[i].data();
  frame.substeps = 1;
  frame.step.dt = frame.step.kick = 1;
  frame.arrived = d.arrived.data();
  frame.held_faces = d.anchors.view(0, 0);
  frame.held_faces.places = nullptr;
  frame.held_faces.pull = nullptr;
  frame.held_faces.impulse = nullptr;
  // Between two parts of a frame nobody needs the state before a part, nor what contact pushes
  // with.
  const std::size_t n = d.entries();
  d.checkpoint.u.resize(n);
  d.checkpoint.v.resize(n);
  DeviceArray<float4> more;
  auto* fields = reinterpret_cast<float4*>(d.pushed.data());
  if (has_front(d)) {  // which pushes
    d.front.motion_fields.resize(3 * n);
    fields = d.front.motion_fields.data();
  } else if (d.pushed.size() * sizeof(long long) < 3 * n * sizeof(float4)) {
    more.resize(3 * n);
    fields = more.data();
  }
  float4* const room[] = {d.checkpoint.u.data(), d.checkpoint.v.data(), fields, fields + n,
                          fields + 2 * n};
  std::copy(std::begin(room), std::end(room), d.motion_room.fields);
  CudaLinearisedMotion motion(
      d.present(), d.nodes(1 - d.current), n,
      kSmallMotion * static_cast<float>(d.state.scene.cell_size),
      [&](const CudaNodes& from, const CudaNodes& to) {
        frame.state[0] = from;
        frame.state[1] = to;
        if (has_front(d)) {
          frame.front = d.front.view();
          frame.pushes = clear_pushes(d);
          launch_substeps(d.plans[CudaTissue::kWithFronts], d.pushed_tables(), frame, d.stream);
        } else {
          launch_substeps(d.plan, d.tables(), frame, d.stream);
        }
      },
      d.anchors.hold_still(d.stream), d.motion_room, d.stream);
  return 2 / std::sqrt(largest_eigenvalue(motion, steps));
}

void launch_measure(CudaTissue& d) {
  d.measures.resize(d.blocks.size());
  d.host_measures.resize(d.blocks.size());
  tissue_sim::launch_measure(d.tables(), d.present(), d.plan.max_slots, d.measures.data(),
                             d.stream);
  d.measures.download(d.host_measures.data(), d.measures.size(), d.stream);
  launch_front_energy(d.front.view(), d.present(), d.front.energy.data(), d.stream);
  d.front.energy.download(d.front.host_energy.data(), d.front.energy.size(), d.stream);
}

void finish_measure(CudaTissue& d) {
  check_cuda(cudaStreamSynchronize(d.stream), "finish a frame");
  const bool searched = d.faces.search_begun;
  if (searched) finish_search(d, d.state.dt);
  d.result.elastic_energy = d.result.kinetic_energy = d.result.max_speed = 0;
  d.run.stiffening = even_stiffening(d.state, 1);
  d.state.worst_stiffening = 1;
  d.state.motion.resize(d.blocks.size());
  d.run.modulus.resize(d.blocks.size());
  for (std::size_t i = 0; i < d.blocks.size(); ++i) {
    const CudaMeasure& m = d.host_measures[i];
    d.result.elastic_energy += m.elastic_energy;
    d.result.kinetic_energy += m.kinetic_energy;
    d.state.worst_stiffening = std::max(d.state.worst_stiffening, m.worst_stiffening);
    if (!(m.speed <= d.result.max_speed)) d.result.max_speed = m.speed;
    const Block& block = *d.state.blocks.all[d.host_tables.of_host[i]];
    float& stiffening = d.run.stiffening[block.body][block.material];
    const float now = m.finite != 0 ? m.stiffening : std::numeric_limits<float>::infinity();
    stiffening = std::max(stiffening, now);
    float& square = d.run.stiffening[block.body].back();
    square = std::max(square, m.square);
    const Material& material = d.state.bodies[block.body].materials[block.material];
    d.run.modulus[d.host_tables.of_host[i]] = static_cast<float>(wave_modulus(material, now));
    d.result.blew_up = d.result.blew_up || !(now <= 1e6f);
    d.state.motion[d.host_tables.of_host[i]] = {
        {Vec3(m.min[0], m.min[1], m.min[2]), Vec3(m.max[0], m.max[1], m.max[2])}, m.speed};
  }
  const std::size_t cells = d.front.cells.size();
  for (std::size_t i = 0; i < d.front.energy.size(); ++i) {
    (i < cells ? d.result.elastic_energy : d.result.kinetic_energy) += d.front.host_energy[i];
  }
  d.result.blew_up = d.result.blew_up || is_out_of_control(d.result.max_speed);
  if (searched) d.state.faces.fastest = fastest_block(d.state);
}

// Points of tissue on a GPU that are stretched: they tear, or the fragment network looks at them.
// They are listed there; nodes come down where there are any, and what is said of them is said by
// the host.

std::vector<StretchedPoint> list_stretched(CudaTissue& d, float share) {
  d.stretched_count.resize(1);
  d.host_stretched_count.resize(1);
  d.stretched.resize(std::max<std::size_t>(d.stretched.size(), 4096));
  const auto look = [&] {
    const int room = static_cast<int>(d.stretched.size());
    launch_stretched(d.tables(), d.present(), d.plan.max_slots, share, d.stretched.data(), room,
                     d.stretched_count.data(), d.stream);
    d.stretched_count.download(d.host_stretched_count.data(), 1, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "look for tears");
    return d.host_stretched_count[0] <= room;
  };
  if (!look()) {
    d.stretched.resize(d.host_stretched_count[0]);
    look();
  }
  std::vector<StretchedPoint> stretched(d.host_stretched_count[0]);
  if (stretched.empty()) return stretched;
  d.stretched.download(stretched.data(), stretched.size(), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  std::sort(stretched.begin(), stretched.end(),
            [](const StretchedPoint& a, const StretchedPoint& b) { return a.point < b.point; });
  return stretched;
}

std::vector<StrainedPoint> CudaTissue::strained() {
  std::vector<StrainedPoint> strained =
      strained_of(state, list_stretched(*this, kRegionLevels[0]), kRegionLevels[0]);
  if (!strained.empty()) pull_nodes(*this);
  return strained;
}

}  // namespace tissue_sim
