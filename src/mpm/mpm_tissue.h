// Tissue by the material point method in total Lagrangian form, on the CPU.
#pragma once

#include <memory>
#include <optional>

#include "fragments/pieces.h"
#include "frame/run_frame.h"
#include "mpm/fragment_forecast.h"
#include "mpm/mpm_state.h"
#include "mpm/state_figures.h"
#include "mpm/substep_choice.h"
#include "mpm/tear/tear.h"
#include "tissue_sim/tissue.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

class MpmTissue final : public Tissue {
 public:
  /// `notes` come before those of the scene.
  explicit MpmTissue(const Scene& scene, std::vector<std::string> notes = {});

  void advance(double duration, const FrameInput& input) override;
  FrameResult finish() override;
  int point_count() const override { return state_->points.size(); }
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  void read_surface(SurfaceTriangles& surface) override;
  bool moves_anchors() const override {
    return state_->scene.mpm.boundary == MpmBoundary::kSurface;
  }
  int fragment_count() const override { return static_cast<int>(pieces_.all.size()); }
  Span<const Fragment> fragments() override;
  std::uint64_t checksum() override;
  Momentum momentum() override;
  std::string device_name() const override;
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;
  const std::vector<std::string>& notes() const override { return notes_; }

  // For tests and the benchmark.
  /// Advances by `substeps` of `dt` seconds each; 0 only cuts.
  void advance(int substeps, float dt, const FrameInput& input);
  /// The substep that is stable in the present state however the tissue is cut: what a lone point
  /// bears, by the scene's CFL number [s].
  float stable_substep() const;
  void save_checkpoint();     ///< of what a part of a frame changes until something is cut or tears
  void restore_checkpoint();  ///< and measures it
  /// The substep for the next part of a frame: SubstepChoice::longest().
  float substep_for(const FrameInput& input);
  int fragment_of(int point) const { return pieces_.of_point[point]; }
  const Pieces& pieces() const { return pieces_; }
  MpmState& state() { return *state_; }
  /// What the fragment network said at the end of the last frame; nothing without one.
  const std::vector<FragmentChance>& forecast() const { return foresight_.forecast; }
  /// Lets another classifier than the network's say what is part of a fragment soon.
  void classify_by(FragmentClassifier classifier) { foresight_.classifier = std::move(classifier); }
  /// How many pieces have flown since the beginning, for the network had foreseen them.
  int flown() const { return foresight_.flown; }

 private:
  template <class Archive>
  void each_field(Archive& archive);

  /// The frame that is worked on.
  struct Frame {
    FrameInput input;
    double duration;
    FrameColliders colliders;
    std::vector<Box> reach;           ///< of the colliders
    bool blades;                      ///< whether there are any
    double cut_to = 0;                ///< share of the frame up to which they did
    std::vector<BlockMotion> before;  ///< when they were last looked at
    bool again = false;               ///< a part is done again: see came_unforeseen()
    std::vector<TearingPoint> tearing =
        {};                ///< points past their limit at the end of the last part
    int done = 0;          ///< substeps of it
    bool watched = false;  ///< whether its energy was measured
  };

  /// What a part of a frame changes until something is cut or tears.
  struct Checkpoint {
    Motion motion;
    FaceContacts faces;
    FrameResult result;
    std::vector<BlockMotion> of_blocks;  ///< run_frame()'s, as what follows
    SubstepChoice substep;
  };

  // The steps of run_frame().
  friend void run_frame<MpmTissue>(MpmTissue& tissue, double duration, FrameInput input);
  void begin_frame(double duration, const FrameInput& input);
  PartSubsteps choose_substeps(const FrameInput& input, double time);
  double run_part(const FramePart& part);
  Verdict judge_part(const FramePart& part);
  void reject_part(Verdict verdict);
  bool accept_part();
  void break_bonds(double share);
  void end_frame();

  /// The substeps of a part, until points are past their limit (`tearing_`). Returns how many.
  int run(const FramePart& part);
  /// What is past its limit, at this share of the frame; blades have cut their way before.
  void tear(double share);
  void cut_by_blades(double share);
  void cut(const std::vector<BladePath>& paths, const Array<float>* u_before,
           const std::vector<BlockMotion>& before, CutReport& report);
  bool tame();                ///< what is wild (mpm/tear/deformation.h), whether anything was
  bool settle_wild_debris();  ///< of that, debris
  /// Energies and how much the tissue has stiffened, from what `read` finds of each block.
  template <class Read>
  void measure(const Read& read);
  void measure_stiffness();  ///< alone: half the work
  void measure_energies();   ///< and stiffness

  std::vector<std::string> notes_;
  std::unique_ptr<MpmState> state_;
  Pieces pieces_;
  Foresight foresight_;
  std::optional<Frame> frame_;  ///< the one that is worked on
  Checkpoint checkpoint_;       ///< before the last part of it
  Stiffening stiffening_;
  std::vector<float> modulus_;    ///< see SubstepChoice::follow()
  bool measured_ = false;         ///< whether the state is as it was when it was measured
  bool has_energies_ = false;     ///< whether energies were, too
  double work_ = 0;               ///< of instruments in the last part of a frame [J]
  bool pieces_measured_ = false;  ///< whether they are where the frame left them
  SubstepChoice substep_;
  FrameResult result_;
};

}  // namespace tissue_sim
