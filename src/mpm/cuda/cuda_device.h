// Tissue of the material point method on an NVIDIA GPU.
#pragma once

#include "mpm/device.h"

namespace tissue_sim {

struct CudaTissue;
struct StateOnHost;

class CudaMpmDevice final : public MpmDevice {
 public:
  /// Throws std::runtime_error where there is no GPU, or not enough memory on it.
  CudaMpmDevice(const Scene& scene, MpmRun& run);
  ~CudaMpmDevice() override;
  CudaTissue& tissue() const { return *tissue_; }

  std::string name() const override;
  NodeRange node_range() const override { return NodeRange::kBox; }
  void begin() override;
  void begun() override;
  unsigned measure(unsigned what) override;
  double measure_limit(const std::vector<std::uint8_t>& blocks, int steps) override;
  void begin_frame(const FrameInput& input, bool move) override;
  void begin_rest() override;
  void save_motion() override;
  int run_part(const FramePart& part) override;
  unsigned measure_part(unsigned what) override;
  bool missed_contact() override { return missed_; }
  bool can_restore_motion() const override;
  void restore_motion(bool missed) override;
  void end_frame() override;
  void sweep(const std::vector<BladePath>& paths, bool moves, std::vector<std::int32_t>& changed,
             std::vector<std::int32_t>& touched, CutReport& report) override;
  void before_parting(const std::vector<std::int32_t>& points) override;
  void parted(const std::vector<std::int32_t>& points, const Apart& apart) override;
  std::vector<int> label_pieces() override;
  bool labels_by_bonds_alone() const override { return false; }
  void bring_nodes(const std::vector<std::int32_t>& points) override;
  void send_nodes() override;
  void bring_all_nodes() override;
  void place_boundary() override;
  bool fly(double duration, Foresight& foresight, std::vector<StrainedPoint>& strained) override;
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  GpuPoints read_points_on_gpu(const PointSelection& selection) override;
  void save(ArchiveWriter& archive) override;
  void restore(ArchiveReader& archive) override;
  void restored() override;

 private:
  std::unique_ptr<CudaTissue> tissue_;
  std::unique_ptr<StateOnHost> to_restore_;
  bool missed_ = false;  ///< missed_contact()
};

std::unique_ptr<MpmDevice> make_cuda_mpm_device(const Scene& scene, MpmRun& run);

}  // namespace tissue_sim
