// What CudaMlsTissue keeps on the GPU.
#pragma once

#include <string>
#include <vector>

#include "compute/lent_points.h"
#include "mls/cuda/cuda_mls_tissue.h"
#include "mls/cuda/device_state.h"

namespace tissue_sim {

struct CudaMlsTissue::OnDevice {
  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name
  LentPoints lent;
  int count = 0;  ///< nodes
  std::vector<std::int32_t> host_offset;

  DeviceArray<float4> place, u[2], v[2], stress, force;
  SomeMotion some;
  int current = 0;  ///< which of the two is the present motion
  bool host_is_current = true;
  DeviceArray<std::int32_t> offset, other;
  DeviceArray<float> weight, spring, inverse_moment, volume_mu, volume_lambda, volume_eta, kappa,
      mass, inv_mass, edge;
  DeviceArray<std::uint8_t> neo_hookean, outer, whole;
  DeviceArray<ContactSpring> contact;
  bool has_springs = false, viscous = false;

  DeviceArray<Collider> colliders;  ///< of all substeps of a part
  DeviceArray<std::uint32_t> touching;
  DeviceArray<float4> hold;
  DeviceArray<unsigned long long> loads;
  std::vector<Collider> host_colliders;
  std::vector<unsigned long long> host_loads;
  int collider_count = 0;
  Box box;           ///< of the nodes, as of the last measure [m]
  double speed = 0;  ///< of the fastest [m/s]

  DeviceArray<std::int16_t> anchor;    ///< empty where nothing is held
  DeviceArray<MlsAnchorPose> anchors;  ///< of all substeps of a part
  std::vector<MlsAnchorPose> host_anchors;
  DeviceArray<float4> held_impulse;

  DeviceArray<CudaMlsNodeChange> node_changes;
  DeviceArray<CudaMlsEntryChange> entry_changes;

  DeviceArray<CudaMlsFace> faces;
  DeviceArray<std::int32_t> contact_node, contact_at, contact_begin, contact_other;
  DeviceArray<float> contact_rest;
  bool may_touch = false;  ///< nodes may, with MlsContact::kNodes
  DeviceArray<MlsKnowsFace> contact_knows;
  DeviceArray<MlsSlip> contact_slip;
  DeviceArray<MlsContactFace> contact_face;
  DeviceArray<float4> contact_force;
  int touching_count = 0;  ///< of nodes that may touch others

  DeviceArray<CudaMlsMeasure> measures;
  std::vector<CudaMlsMeasure> host_measures;
  DeviceArray<float> of_node;  ///< room for a figure of each node

  struct Checkpoint {
    DeviceArray<float4> u, v, hold, held_impulse;
    DeviceArray<std::uint32_t> touching;
    MlsNodeContacts node_contacts;
    DeviceArray<MlsSlip> slip;
    std::vector<EdgeHold> edges;
    float dt = 0;
    double time = 0;
    FrameResult result;
  } checkpoint;

  ~OnDevice() {
    if (stream != nullptr) cudaStreamDestroy(stream);
  }
  CudaMlsMotion motion(int which) const { return {u[which].data(), v[which].data()}; }
  CudaMlsMotion present() const { return motion(current); }
  CudaMlsField field() const {
    CudaMlsField f;
    f.count = count;
    f.place = place.data();
    f.offset = offset.data();
    f.other = other.data();
    f.weight = weight.data();
    f.spring = has_springs ? spring.data() : nullptr;
    f.whole = whole.data();
    f.inverse_moment = inverse_moment.data();
    f.volume_mu = volume_mu.data();
    f.volume_lambda = volume_lambda.data();
    f.volume_eta = volume_eta.data();
    f.kappa = kappa.data();
    f.neo_hookean = neo_hookean.data();
    f.mass = mass.data();
    f.inv_mass = inv_mass.data();
    f.contact = contact.data();
    f.edge = edge.data();
    f.outer = outer.data();
    f.stress = stress.data();
    f.viscous = viscous;
    return f;
  }
  CudaMlsNodeContacts contacts(float dt) {
    CudaMlsNodeContacts c;
    if (may_touch) {
      c.begin = contact_begin.data();
      c.other = contact_other.data();
      c.rest = contact_rest.data();
    }
    c.count = touching_count;
    if (touching_count == 0) return c;
    c.node = contact_node.data();
    c.at = contact_at.data();
    c.knows = contact_knows.data();
    c.begin = contact_begin.data();
    c.other = contact_other.data();
    c.slip = contact_slip.data();
    c.of_node = faces.data();
    c.face = contact_face.data();
    c.force = contact_force.data();
    c.dt = dt;
    return c;
  }
  void wait(const char* action) { check_cuda(cudaStreamSynchronize(stream), action); }
};

}  // namespace tissue_sim
