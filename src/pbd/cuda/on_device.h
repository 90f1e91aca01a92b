// What CudaPbdTissue keeps on the GPU.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "compute/cuda_graph.h"
#include "pbd/cuda/cuda_pbd_tissue.h"
#include "pbd/cuda/device_state.h"
#include "pbd/cuda/spread_banks.h"
#include "pbd/free_flight.h"

namespace tissue_sim {

struct CudaPbdTissue::OnDevice {
  template <class Kind>
  struct Set {
    DeviceArray<pbd::ConstraintBlock<Kind>> blocks;
    DeviceArray<float> multipliers;
    DeviceArray<std::int32_t> first;
    int parts = 1, colours = 0, tail = 0, tail_blocks = 0, most = 0;

    /// `spread`: in the order that reads shared memory fastest, of so many `of_parts` that share
    /// the vertices out.
    void upload(const pbd::ConstraintSet<Kind>& set, bool spread, int of_parts, int vertices,
                cudaStream_t stream) {
      parts = of_parts;
      const std::vector<std::int32_t> list = share_out(set, vertices);
      if (spread) {
        blocks.upload(pbd::spread_banks(set, list), stream);
      } else {
        blocks.upload(set.blocks, stream);
      }
      multipliers.upload(set.multipliers, stream);
      first.upload(list, stream);
      colours = static_cast<int>(set.begin.size()) - 1;
      tail = colours;
      while (tail > 0 && set.begin[tail] - set.begin[tail - 1] <= 32 / pbd::kLanes) --tail;
      tail_blocks = set.begin[colours] - set.begin[tail];
      most = 0;
      for (int k = 0; k < tail * parts; ++k) most = std::max(most, list[k + 1] - list[k]);
    }
    pbd::CudaPbdSet<Kind> set() const {
      return {blocks.data(), multipliers.data(), first.data(), parts, colours,
              tail,          tail_blocks,        most};
    }

   private:
    /// CudaPbdSet::first: by a constraint's first vertex, by which those of a colour are sorted.
    std::vector<std::int32_t> share_out(const pbd::ConstraintSet<Kind>& set, int vertices) const {
      const int share = pbd::vertices_of_part(vertices, parts);
      std::vector<std::int32_t> list = {0};
      for (std::size_t colour = 0; colour + 1 < set.begin.size(); ++colour) {
        const std::int32_t end = set.begin[colour + 1] * pbd::kLanes;
        std::int32_t k = set.begin[colour] * pbd::kLanes;
        for (int part = 1; part < parts; ++part) {
          while (k < end && set.blocks[k / pbd::kLanes].vertex[0][k % pbd::kLanes] < part * share) {
            ++k;
          }
          list.push_back(k);
        }
        list.push_back(end);
      }
      return list;
    }
  };

  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name
  int count = 0;    ///< vertices
  DeviceArray<float4> x, predicted, v;
  DeviceArray<double> mass;
  DeviceArray<std::uint8_t> pushed;
  bool host_is_current = true;

  Set<pbd::Elastic> elastics;
  Set<pbd::Strain> strains;
  Set<pbd::Distance> links;
  Set<pbd::Bending> bends;
  Set<pbd::Touch> touches;
  bool may_touch = false;
  int sweeps = 1;  ///< of a step
  int parts = 1;   ///< blocks of threads that share the vertices out
  Way wanted = Way::kFaster, way = Way::kLaunches;
  CudaGraph step_graph, projections;

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
    f.predicted = predicted.data();
    f.v = v.data();
    f.mass = mass.data();
    f.pushed = pushed.data();
    f.elastics = elastics.set();
    f.strains = strains.set();
    f.links = links.set();
    f.bends = bends.set();
    f.touches = touches.set();
    f.may_touch = may_touch;
    f.sweeps = sweeps;
    f.parts = parts;
    f.frame = frame.data();
    f.colliders = colliders.data();
    f.loads = loads.data();
    f.step = step.data();
    return f;
  }
  static int parts_of(Way way) { return way == Way::kCluster ? pbd::pbd_cluster_blocks() : 1; }
  /// Whether blocks of threads have room for what they share out.
  bool fits(Way way) const {
    if (way == Way::kCluster && parts_of(way) == 1) return false;
    return pbd::fits_pbd_blocks(field(), parts_of(way), colliders.size());
  }
  void wait(const char* action) { check_cuda(cudaStreamSynchronize(stream), action); }
};

}  // namespace tissue_sim
