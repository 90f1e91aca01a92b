// Tissue by moving least squares on nodes without a mesh, on the CPU; on a GPU with what is virtual
// here done there (mls/cuda/cuda_mls_tissue.h).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fragments/pieces.h"
#include "frame/run_frame.h"
#include "mls/state.h"
#include "mls/substep_choice.h"
#include "mls/surface.h"
#include "tissue_sim/tissue.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

class MlsTissue : public SteppedTissue<MlsTissue> {
 public:
  /// `notes` come before those of the scene.
  explicit MlsTissue(const Scene& scene, std::vector<std::string> notes = {});

  FrameResult finish() override;
  int point_count() const override { return state_->count(); }
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  void read_surface(SurfaceTriangles& surface) override;
  void push_surface(Span<const float> impulses) override;
  int fragment_count() const override { return static_cast<int>(pieces_.all.size()); }
  Span<const Fragment> fragments() override;
  std::uint64_t checksum() override;
  Momentum momentum() override;
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;
  bool moves_anchors() const override { return true; }
  unsigned point_fields() const override { return ~unsigned{kStressTensor}; }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string device_name() const override;

  // What advance() calls.
  const Scene& scene() const { return state_->scene; }
  void begin_frame(double duration, const FrameInput& input, FrameColliders colliders);
  PartSubsteps choose_substeps(const FrameInput& input, double time);
  virtual void save_checkpoint();
  MlsTissue& device() { return *this; }
  virtual int run_part(const FramePart& part);
  Verdict judge_part(const FramePart& part);
  virtual void reject_part(Verdict verdict);
  bool accept_part() { return !result_.blew_up; }
  void break_bonds(double share);
  void end_frame();

  // For tests and the benchmark.
  MlsState& state() { return *state_; }
  int fragment_of(int point) const { return pieces_.of_point[point]; }
  /// Cuts at once, without moving anything.
  CutReport cut_now(const BladePath& path);

 protected:
  /// What is measured of all nodes.
  struct Figures {
    double elastic = 0, kinetic = 0;  ///< [J]
    double speed = 0;                 ///< of the fastest [m/s]
    float stretch2 = 0;               ///< as in MlsMeasure
    bool finite = true;
  };
  /// Brings the motion of the nodes to state_.
  virtual void pull() {}
  /// Brings their velocities back from there.
  virtual void push_velocities() {}
  /// Weights, moments or springs of these nodes changed, or beside them tissue ends now.
  virtual void pairs_changed(const std::vector<std::int32_t>& /*nodes*/) {}
  /// Brings the impulses on held nodes to state_.
  virtual void pull_held() {}
  /// And how much each node has stiffened, into stiffening_.
  virtual Figures measure();
  /// Von Mises stress of each node over its shear modulus.
  virtual void measure_stress(std::vector<float>& of_node);
  /// Internal forces at displacements `u`: [4 nodes] both; `rest` as internal_forces() takes it.
  virtual void forces_at(const float* u, float* force, float rest);

  template <class Archive>
  void each_field(Archive& archive);

  /// The frame that is worked on.
  struct Frame {
    FrameInput input;
    double duration;
    FrameColliders colliders;
    Array<float> u_before;  ///< displacements when blades last cut; empty without any
    double cut_to = 0;      ///< share of the frame up to which they did
  };

  struct Checkpoint {
    Array<float> u, v, held_impulse;
    std::vector<MlsGroupContact> contact;
    MlsNodeContacts node_contacts;
    std::vector<EdgeHold> edges;
    float dt;
    double time;
    int until_list;
    FrameResult result;
  };

  void cut(const BladePath& path, const float* u_begin, CutReport& report);
  /// Crosses the pairs of these entries at these places (find_crossed()), with all that follows.
  void break_pairs(const std::vector<std::int32_t>& entries, const std::vector<float>& places,
                   CutReport& report);
  /// What a cut or a tear makes void that took pairs from these nodes.
  void forget(const std::vector<std::int32_t>& changed);
  /// Pieces anew, after these nodes lost pairs.
  void part(const std::vector<std::int32_t>& changed, CutReport& report);
  void part(const std::vector<PartedRun>& parted, CutReport& report);

  std::vector<std::string> notes_;
  std::unique_ptr<MlsState> state_;
  Pieces pieces_;
  std::optional<Frame> frame_;
  Checkpoint checkpoint_;
  MlsSubsteps substeps_;
  MlsSurface surface_;  ///< as it was last read
  std::vector<float> stiffening_;
  bool pieces_measured_ = false;
  bool may_touch_ = false;  ///< whether tissue may touch tissue: there are pieces, or cuts
  FrameResult result_;
};

}  // namespace tissue_sim
