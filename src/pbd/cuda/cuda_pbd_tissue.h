// Tissue by position-based dynamics that lives on an NVIDIA GPU.
#pragma once

#include <memory>

#include "pbd/free_flight.h"
#include "pbd/pbd_tissue.h"

namespace tissue_sim {

namespace pbd {
struct CudaPbdFlight;
struct CudaPbdFrame;
}  // namespace pbd

/// Motion lives on the GPU, and comes to the host where something asks for it. Meshes, constraints,
/// their colours, cuts and pieces are the host's, as on the CPU: what a cut changes goes up.
class CudaPbdTissue final : public PbdTissue {
 public:
  /// How the steps of a frame are launched.
  enum class Way {
    kFaster,    ///< of those below, the one that is thought to be
    kLaunches,  ///< colour by colour, for many constraints
    kOneBlock,  ///< all by one block of threads, for few
  };

  /// Throws std::runtime_error where there is no GPU, or not enough memory on it.
  explicit CudaPbdTissue(const Scene& scene, std::vector<std::string> notes = {});
  ~CudaPbdTissue() override;

  std::string device_name() const override;
  GpuPoints read_points_on_gpu(const PointSelection& selection) override;

  // For tests and the benchmark.
  void pull() override;
  void push() override;  ///< motion to the GPU
  void push_all();       ///< and constraints, after a change of them
  /// Throws std::runtime_error where that is not possible.
  void set_way(Way);
  Way way() const;  ///< one of the two
  /// As pbd::project_constraints() without multipliers, so many times; only enqueues.
  void project(float h, int times = 1);
  void wait();

 protected:
  void state_changed() override { push_all(); }
  void run_steps(const FrameColliders& colliders, const Part& part, float h) override;
  Figures measure() override;

 private:
  struct OnDevice;

  void upload_constraints();
  void upload_chunks();
  void choose_way();
  Way faster_way() const;
  int upload_touches(double duration);  ///< returns their colours
  int find_near_tips(const std::vector<pbd::TipSweep>& sweeps, double duration);  ///< how many
  void upload_frame(const FrameColliders& colliders, const Part& part,
                    const pbd::CudaPbdFrame& frame);
  void take_loads(const FrameColliders& colliders, const Part& part);
  /// What hangs together, by the sums of the chunks, but for what is held.
  std::vector<pbd::Flight> flights(const pbd::CudaPbdFlight* of_chunks) const;
  /// Momentum of what flies freely is kept, and viscosity acts.
  void keep_momentum(int steps, float h);
  void change_rigidly(const std::vector<pbd::RigidChange>& changes);

  std::unique_ptr<OnDevice> device_;
};

}  // namespace tissue_sim
