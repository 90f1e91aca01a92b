// Tissue by the material point method in total Lagrangian form, on the CPU or on an NVIDIA GPU.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mpm/device.h"
#include "mpm/substep_choice.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Lattice, bonds, blocks and pieces are the host's; nodes and contacts live where the device is.
class MpmTissue : public SteppedTissue<MpmTissue> {
 public:
  /// `notes` come before those of the scene. Throws std::runtime_error where the device is not
  /// there, or has not enough memory.
  explicit MpmTissue(const Scene& scene, std::vector<std::string> notes = {},
                     MakeMpmDevice make_device = make_cpu_mpm_device);

  FrameResult finish() override;
  int point_count() const override { return state().points.size(); }
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override {
    return device_->read_points(selection, cloud);
  }
  GpuPoints read_points_on_gpu(const PointSelection& selection) override {
    return device_->read_points_on_gpu(selection);
  }
  void read_surface(SurfaceTriangles& surface) override;
  void push_surface(Span<const float> impulses) override;
  GpuSurface surface_on_gpu(const SurfaceTriangles& read) override;
  void push_surface_on_gpu(const float* impulses) override;
  bool moves_anchors() const override { return true; }
  int fragment_count() const override { return static_cast<int>(run_->pieces.all.size()); }
  Span<const Fragment> fragments() override;
  std::uint64_t checksum() override;
  Momentum momentum() override;
  std::string device_name() const override { return device_->name(); }
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;
  const std::vector<std::string>& notes() const override { return notes_; }

  /// The host's; nodes and contacts of a GPU are as they were brought last.
  MpmState& state() const { return run_->state; }
  MpmDevice& device() const { return *device_; }
  const Pieces& pieces() const { return run_->pieces; }
  int fragment_of(int point) const { return run_->pieces.of_point[point]; }
  /// The substep that is stable in the present state however the tissue is cut: what a lone point
  /// bears, by the scene's CFL number [s].
  float stable_substep() const;
  /// The substep for the next part of a frame: SubstepChoice::longest().
  float substep_for(const FrameInput& input, const FrameColliders& colliders);
  float substep_for(const FrameInput& input) {
    return substep_for(input, {scene(), input, 1 / scene().frame_rate});
  }
  /// What the fragment network said; another classifier than its may say it.
  Foresight& foresight() { return foresight_; }

 private:
  friend struct FixedSubsteps;  // test/support/fixed_substeps.h
  template <class Archive>
  void each_field(Archive& archive);
  void pushed();  ///< nodes have other velocities than was measured

  // The steps of advance().
  friend class SteppedTissue<MpmTissue>;
  const Scene& scene() const { return run_->state.scene; }
  void begin_frame(double duration, const FrameInput& input, FrameColliders colliders);
  PartSubsteps choose_substeps(const FrameInput& input, double time);
  void save_checkpoint();
  Verdict judge_part(const FramePart& part);
  void reject_part(Verdict verdict);
  bool accept_part();
  void break_bonds(double share);
  void end_frame();

  /// What is past its limit, at this share of the frame; blades have cut their way before. Returns
  /// whether anything was cut or tore.
  bool tear(double share);
  void cut_by_blades(double share);
  /// While tissue moves, or as it is.
  void cut(const std::vector<BladePath>& paths, bool moves, CutReport& report);
  /// After the points `changed` lost bonds, and more was passed of those of `touched`. Appends ids
  /// of pieces that came apart to `fresh` if it is not null.
  void take_apart(const std::vector<std::int32_t>& changed,
                  const std::vector<std::int32_t>& touched = {}, std::vector<int>* fresh = nullptr);
  bool tame();  ///< what is ill-conditioned (mpm/tear/debris.h), whether anything was
  bool settle_ill_conditioned();  ///< of that, debris
  void measured(unsigned what);   ///< MpmDevice::measure()
  void follow();                  ///< SubstepChoice::follow()

  std::vector<std::string> notes_;
  std::unique_ptr<MpmRun> run_;
  std::unique_ptr<MpmDevice> device_;
  Foresight foresight_;
  SubstepChoice substep_;
  struct {
    FrameResult result;
    SubstepChoice substep;
  } checkpoint_;                  ///< before the last part of a frame
  bool measured_ = false;         ///< whether the state is as it was when it was measured, ...
  bool has_energies_ = false;     ///< ... whether energies were, too, ...
  bool followed_ = false;         ///< ... and whether substeps are chosen by that
  bool pieces_measured_ = false;  ///< whether they are where the frame left them
};

}  // namespace tissue_sim
