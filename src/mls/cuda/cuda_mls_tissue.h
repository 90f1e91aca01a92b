// Tissue by moving least squares that lives on an NVIDIA GPU.
#pragma once

#include <memory>

#include "mls/tissue.h"

namespace tissue_sim {

/// Motion lives on the GPU, and comes to the host where something asks for it. Pairs, cuts and
/// pieces are the host's, as on the CPU: what a cut changes goes up.
class CudaMlsTissue final : public MlsTissue, DistantNodes {
 public:
  /// Throws std::runtime_error where there is no GPU, or not enough memory on it.
  explicit CudaMlsTissue(const Scene& scene, std::vector<std::string> notes = {});
  ~CudaMlsTissue() override;

  std::string device_name() const override;
  GpuPoints read_points_on_gpu(const PointSelection& selection) override;
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;

  void save_checkpoint() override;
  int run_part(const FramePart& part) override;
  void reject_part(Verdict verdict) override;

  // For tests and the benchmark.
  void pull() override;
  void push_velocities() override;
  void push();  ///< motion and contact to the GPU
  void forces_at(const float* u, float* force, float rest) override;

 protected:
  void pairs_changed(const std::vector<std::int32_t>& nodes) override;
  void pull_held() override;
  Figures measure() override;
  void measure_stress(std::vector<float>& of_node) override;

 private:
  struct OnDevice;

  void bring_motion(const std::vector<std::int32_t>& nodes) override;
  void bring_motion_around(const std::vector<EdgePlace>& /*places*/) override { pull(); }
  void send_velocities(const std::vector<std::int32_t>& nodes) override;

  void upload_nodes();
  void upload_pairs();  ///< all of them
  void upload_colliders(const FramePart& part);
  void pull_contact();
  void push_contact();
  void search_contacts(float dt, double fastest);
  void push_node_contacts();
  void pull_slips();  ///< what nodes that touch remember
  /// `of_edges`: what acted on blades' edges in each substep; or empty.
  void sum_loads(const FramePart& part, float before,
                 const std::vector<std::vector<ColliderLoad>>& of_edges);

  std::unique_ptr<OnDevice> device_;
};

}  // namespace tissue_sim
