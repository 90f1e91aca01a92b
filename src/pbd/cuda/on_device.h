// What CudaPbdTissue keeps on the GPU.
#pragma once

#include <string>
#include <vector>

#include "compute/cuda_graph.h"
#include "compute/lent_points.h"
#include "pbd/cuda/cuda_pbd_tissue.h"
#include "pbd/cuda/device_state.h"
#include "pbd/free_flight.h"

namespace tissue_sim {

struct CudaPbdTissue::OnDevice {
  template <class Kind>
  struct Set {
    DeviceArray<pbd::ConstraintBlock<Kind>> blocks;
    DeviceArray<float> multipliers;
    DeviceArray<std::int32_t> begin;
    int colours = 0, tail = 0, tail_blocks = 0;

    void upload(const pbd::ConstraintSet<Kind>& set, cudaStream_t stream) {
      blocks.upload(set.blocks, stream);
      multipliers.upload(set.multipliers, stream);
      begin.upload(set.begin, stream);
      colours = static_cast<int>(set.begin.size()) - 1;
      tail = colours;
      while (tail > 0 && set.begin[tail] - set.begin[tail - 1] <= 32 / pbd::kLanes) --tail;
      tail_blocks = set.begin[colours] - set.begin[tail];
    }
    pbd::CudaPbdSet<Kind> set() const {
      return {blocks.data(), multipliers.data(), begin.data(), colours, tail, tail_blocks};
    }
  };

  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name
  LentPoints lent;
  int count = 0;  ///< vertices
  DeviceArray<float4> x, moved, predicted, v;
  DeviceArray<double> mass;
  DeviceArray<std::uint8_t> pushed;
  bool host_is_current = true;

  Set<pbd::Elastic> elastics;
  Set<pbd::Strain> strains;
  Set<pbd::Distance> links;
  Set<pbd::Bending> bends;
  Set<pbd::Touch> touches;
  Set<pbd::Damper> dampers;
  DeviceArray<pbd::Triangle> triangles;  ///< of the surface, where the scene has tips
  DeviceArray<pbd::TipSweep> tip_sweeps;
  DeviceArray<std::int32_t> near;
  PinnedArray<int> near_count;           ///< the GPU writes it here
  DeviceArray<std::uint8_t> tip_memory;  ///< what finding them takes
  double mean_edge = 0;
  bool may_touch = false;
  int sweeps = 1;  ///< of a step
  Way wanted = Way::kFaster, way = Way::kLaunches;
  CudaGraph step_graph, projections, damping;

  DeviceArray<pbd::CudaPbdFrame> frame;
  DeviceArray<pbd::CudaPbdCollider> colliders;  ///< of all steps of a frame
  DeviceArray<unsigned long long> loads;
  DeviceArray<int> step;
  std::vector<Collider> host_colliders;
  PinnedArray<pbd::CudaPbdCollider> boxed;
  PinnedArray<unsigned long long> host_loads;

  // What flies freely: chunks of all that nothing holds.
  std::vector<std::int32_t> component_of_chunk;
  std::vector<double> component_mass;  ///< [kg]
  DeviceArray<pbd::CudaPbdChunk> chunks;
  DeviceArray<std::int32_t> order, component;
  DeviceArray<pbd::CudaPbdFlight> flights;  ///< before the steps, and after them
  PinnedArray<pbd::CudaPbdFlight> host_flights;
  DeviceArray<pbd::CudaPbdChange> changes;
  PinnedArray<pbd::CudaPbdChange> host_changes;

  DeviceArray<pbd::CudaPbdMeasure> measures;
  PinnedArray<pbd::CudaPbdMeasure> host_measures;

  ~OnDevice() {
    if (stream != nullptr) cudaStreamDestroy(stream);
  }
  pbd::CudaPbdField field() const {
    pbd::CudaPbdField f;
    f.count = count;
    f.x = x.data();
    f.moved = moved.data();
    f.predicted = predicted.data();
    f.v = v.data();
    f.mass = mass.data();
    f.pushed = pushed.data();
    f.elastics = elastics.set();
    f.strains = strains.set();
    f.links = links.set();
    f.bends = bends.set();
    f.touches = touches.set();
    f.dampers = dampers.set();
    f.tips = {triangles.data(), static_cast<int>(triangles.size()), tip_sweeps.data(), near.data(),
              mean_edge};
    f.may_touch = may_touch;
    f.sweeps = sweeps;
    f.frame = frame.data();
    f.colliders = colliders.data();
    f.loads = loads.data();
    f.step = step.data();
    return f;
  }
  void wait(const char* action) { check_cuda(cudaStreamSynchronize(stream), action); }
};

}  // namespace tissue_sim
