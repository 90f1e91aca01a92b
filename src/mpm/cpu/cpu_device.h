// Tissue of the material point method on the CPU.
#pragma once

#include "mpm/device.h"

namespace tissue_sim {

class CpuMpmDevice final : public MpmDevice {
 public:
  explicit CpuMpmDevice(MpmRun& run) : run_(run), state_(run.state) {}

  std::string name() const override;
  NodeRange node_range() const override { return NodeRange::kSeen; }
  void begin() override;
  unsigned measure(unsigned what) override;
  double measure_limit(const std::vector<std::uint8_t>& blocks, int steps) override;
  void begin_rest() override;
  void save_motion() override;
  int run_part(const FramePart& part) override;
  bool missed_contact() override;
  void restore_motion(bool missed) override;
  void settled(const std::vector<std::int32_t>& points) override;
  void sweep(const std::vector<BladePath>& paths, bool moves, std::vector<std::int32_t>& changed,
             std::vector<std::int32_t>& touched, CutReport& report) override;
  std::vector<int> label_pieces() override;
  bool labels_by_bonds_alone() const override { return true; }
  std::vector<StrainedPoint> strained() override;
  void place_boundary() override;
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  void save(ArchiveWriter& archive) override;
  void restore(ArchiveReader& archive) override;
  void restored() override;

 private:
  void measure_blocks(bool energies);

  MpmRun& run_;
  MpmState& state_;
  struct {
    Motion motion;
    FaceContacts faces;
    std::vector<BlockMotion> of_blocks;
  } saved_;             ///< save_motion()
  bool again_ = false;  ///< a part is done again: see missed_contact()
};

}  // namespace tissue_sim
