// Tissue by position-based dynamics on the CPU; on a GPU with what is virtual here done there
// (pbd/cuda/cuda_pbd_tissue.h).
#pragma once

#include <memory>

#include "pbd/pbd_pieces.h"
#include "pbd/pbd_state.h"
#include "tissue_sim/tissue.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

class PbdTissue : public Tissue {
 public:
  /// `notes` come before those of the scene.
  explicit PbdTissue(const Scene& scene, std::vector<std::string> notes = {});

  void advance(double duration, const FrameInput& input) override;
  FrameResult finish() override;
  int point_count() const override { return state_->vertices.size(); }
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  unsigned point_fields() const override { return ~unsigned{kStressTensor}; }
  void read_surface(SurfaceTriangles& surface) override;
  void push_surface(Span<const float> impulses) override;
  bool moves_surface() const override { return true; }
  bool moves_anchors() const override { return true; }
  int fragment_count() const override { return static_cast<int>(pieces_.all.size()); }
  Span<const Fragment> fragments() override;
  std::uint64_t checksum() override;
  Momentum momentum() override;
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;
  std::string device_name() const override;
  const std::vector<std::string>& notes() const override { return notes_; }

  /// As it is now; on a GPU what is written to it stays unknown there (CudaPbdTissue::push()).
  pbd::State& state() {
    pull();
    return *state_;
  }
  const Pieces& pieces() const { return pieces_; }

 protected:
  /// What is measured of all vertices and constraints.
  struct Figures {
    double elastic = 0, kinetic = 0;  ///< [J]
    double speed2 = 0;                ///< of the fastest, squared [m^2/s^2]
    bool finite = true;               ///< places
  };
  /// Brings the motion of the vertices to state_.
  virtual void pull() {}
  /// And back, where state_ was changed.
  virtual void push() {}
  /// A cut or a restored state changed vertices and constraints.
  virtual void state_changed() {}
  /// Steps of a frame between two searches for what touches.
  struct Part {
    int first, count, of;  ///< of: a frame's
    /// Of the frame, at the end of the part's step `i`.
    double share(int i) const { return (first + i + 1.0) / of; }
  };
  static std::vector<pbd::TipSweep> sweeps_of_tips(const FrameColliders& colliders,
                                                   const Part& part);
  /// Takes them, of h seconds each; adds what acts on tools to result_.
  virtual void run_steps(const FrameColliders& colliders, const Part& part, float h);
  virtual Figures measure();

  /// While vertices move from `before` to where they are; a stroke is what one blade does.
  template <class Archive>
  void each_field(Archive& archive);
  std::vector<Vec3> places() const;
  /// Whether it changed anything: constraints are to be made anew then.
  bool cut(const BladePath& path, int stroke, const std::vector<Vec3>& before, CutReport& report);

  /// Parts what tears, `since` [s] after the last look.
  void tear(double since);
  int steps_between_searches(const FrameColliders& colliders, int steps, float h);

  std::vector<std::string> notes_;
  std::unique_ptr<pbd::State> state_;
  Pieces pieces_;
  int next_stroke_ = 0;  // the first ones are the tools'
  bool pieces_measured_ = false;
  FrameResult result_;
};

}  // namespace tissue_sim
