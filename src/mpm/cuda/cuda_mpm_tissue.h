// Tissue by the material point method in total Lagrangian form, on an NVIDIA GPU.
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

struct float4;  // CUDA's

namespace tissue_sim {

struct CudaFaces;
struct CudaShape;
struct CudaLooks;
struct CudaNodes;
struct CudaReach;
struct FacesOnHost;
struct NodePushes;
struct StateOnHost;

/// The nodes live on the GPU; lattice, bonds, blocks and pieces on the host too, where nodes around
/// a cut are taken apart between frames.
class CudaMpmTissue final : public Tissue {
 public:
  /// Throws std::runtime_error where there is no GPU, or not enough memory on it.
  explicit CudaMpmTissue(const Scene& scene, std::vector<std::string> notes = {});
  ~CudaMpmTissue() override;

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
  float substep_for(const FrameInput& input);
  int fragment_of(int point) const { return pieces_.of_point[point]; }
  /// The host's copy, whose nodes and contacts are as pull() left them or later.
  MpmState& state() { return *state_; }
  void pull();  ///< nodes and contacts from the GPU
  void push();  ///< everything but contacts to the GPU
  const Pieces& pieces() const { return pieces_; }
  // As of MpmTissue.
  const std::vector<FragmentChance>& forecast() const { return foresight_.forecast; }
  void classify_by(FragmentClassifier classifier) { foresight_.classifier = std::move(classifier); }
  int flown() const { return foresight_.flown; }
  void search_anew();  ///< lists of facets that may touch are made anew before the next substep
  /// Of each facet, those that it may touch, as of the last search.
  std::vector<std::vector<std::int32_t>> near_facets() const;
  std::size_t device_bytes() const;  ///< memory that it takes
  std::string plan() const;          ///< shape of the blocks, threads

 private:
  struct OnDevice;

  // The steps of run_frame().
  friend void run_frame<CudaMpmTissue>(CudaMpmTissue& tissue, double duration, FrameInput input);
  void begin_frame(double duration, const FrameInput& input);
  PartSubsteps choose_substeps(const FrameInput& input, double time);
  double run_part(const FramePart& part);
  Verdict judge_part(const FramePart& part);
  void reject_part(Verdict verdict);
  bool accept_part();
  void break_bonds(double share);
  void end_frame();

  /// Enqueues the substeps of a part; where tissue can tear it waits, and ends when points are past
  /// their limit (`tearing_`). Returns after how many.
  int run(const FramePart& part);
  void sum_loads();  ///< of the part that was run last, once it is done
  void make_blocks(const CudaShape& shape, int room);  ///< BlockShape::room
  void divide_anew(int room);                          ///< into blocks for what is cut
  void make_room_for_cuts();  ///< makes blocks anew that are good for whole tissue alone
  void plan_tables();         ///< how the blocks are worked on, and the tables for it
  /// While the tissue moves from `u_before` to where it is; null: it is at rest.
  void cut(const std::vector<BladePath>& paths, float4* u_before, CutReport& report);
  void read_places(float4* u_before);  ///< of points, at both times, for sweep()
  std::vector<BrokenBond> sweep(const BladePath& path, bool moves);
  /// What follows where points lost bonds; contacts come down and wait for the next search. Returns
  /// whether pieces may have come apart.
  bool take_apart(const std::vector<std::int32_t>& changed,
                  const std::vector<std::int32_t>& touched = {});
  /// As that of mpm/split/front.h.
  void pass_rim(const BladePath& path, bool moves, const std::vector<std::int32_t>& broken,
                std::vector<std::int32_t>& touched);
  std::vector<int> label_pieces();  ///< after bonds broke; returns the new ids
  void cut_by_blades();
  void keep_place_for_blades();
  /// Points whose strain is at least `share` of what their body's weakest material bears.
  std::vector<StretchedPoint> list_stretched(float share);
  std::vector<TearingPoint> find_tearing();
  /// At this share of the frame; blades have cut their way before. Returns whether any tears.
  bool tear(double share);
  void tame();                ///< see MpmTissue
  bool settle_wild_debris();  ///< the same
  void foresee();             ///< the end of a frame with a fragment network
  void upload_points();
  template <class Margin>
  bool may_meet(const std::vector<BlockMotion>& motion, const Margin& margin) const;
  CudaReach reach() const;     ///< of the frame's colliders
  void find_near();            ///< lists the cells that they may meet
  void look_for_unforeseen();  ///< enqueues what came_unforeseen() tells once it is done
  /// Whether tissue has come to a collider that find_near() did not foresee, for it went faster
  /// later.
  bool came_unforeseen() const;
  /// Enqueues the part's substeps from `begin` up to `end`; waits for a search of faces that comes
  /// due among them.
  void run_substeps(int begin, int end);
  void launch(int begin, int end, float dt);
  void upload_lattices();
  void upload_sites();   ///< which point is where in the lattices
  void upload_facets();  ///< where there are new ones, or pieces
  void send_facets();
  void make_room_for_facets();
  void begin_contacts();  ///< all anew; until any facets may touch, they take no memory
  void begin_search();    ///< enqueues a search of faces, whose figures come to the host
  /// Begins the search that the next substep would have to wait for, at the end of a frame whose
  /// figures are waited for anyway.
  void search_ahead();
  /// Takes the figures that came, and says when the next search is due: FaceContacts::until_search.
  void finish_search(float dt);
  CudaLooks looks() const;
  const CudaFaces* faces_of_launch();  ///< null where there are no contacts
  void pull_nodes();
  void pull_field(const float4* from, Array<float>* to);  ///< of the nodes
  void push_nodes();
  void push_tables();  ///< of blocks that are new; those that stay move on the GPU
  void push_points(const std::vector<std::int32_t>& changed);  ///< their bonds, whether soft
  /// The nodes that a cut of these points may change, or looks at.
  std::vector<std::int32_t> nodes_around(const std::vector<std::int32_t>& points) const;
  /// First u and mass of all of these, then v and inverse mass: they stay until the next call.
  const float4* gather(const CudaNodes& from, const std::vector<std::int32_t>& nodes);
  void pull_some(const std::vector<std::int32_t>& nodes);
  void push_some(const std::vector<std::int32_t>& nodes);
  void pull_front();  ///< how far parted nodes are apart; the host has the same ones
  void push_front();  ///< the front that the host has, behind the nodes, all of which are there
  bool has_front() const;
  /// Whether places may have to be taken apart in this frame, which the kernels of fronts alone do,
  /// for the others to keep their registers.
  bool meets_thin_tools() const;
  NodePushes clear_pushes();  ///< for a launch that pushes; slots know which nodes a front does
  void pull_contacts();
  void begin_anchors(const FrameInput& input);
  void push_anchors();  ///< rows that their faces hold: after push_tables(), or where nodes split
  void push_impulses();
  void push_lightness();
  void pull_impulses();          ///< AnchorFaces::impulse
  void upload_anchor_places();   ///< of a part
  void leave_anchors(int done);  ///< where they are after so many substeps of it
  /// What anchors hold, in a cloud: `index` of each point, or each of `stride` where it is empty.
  void put_held_points(const std::vector<std::int32_t>& index, int stride,
                       std::vector<std::uint8_t>& cloud) const;
  void launch_measure();
  void finish_measure();
  double measure_limit(int steps);  ///< see MeasureLimit; of all blocks
  void upload_colliders();
  template <class Archive>
  void each_field(Archive& archive, StateOnHost& of_device);
  void bring_faces(FacesOnHost& to) const;
  void send_faces(const FacesOnHost& from);
  /// The share of the frame at the end of the part's substep `i`.
  double share_of(int i) const { return part_.substeps.share(i + 1, part_.from, part_.to); }

  std::vector<std::string> notes_;
  std::unique_ptr<MpmState> state_;
  Pieces pieces_;
  bool pieces_measured_ = false;  ///< whether they are where the frame left them
  std::unique_ptr<OnDevice> device_;
  std::vector<BladePath> blades_;            ///< of the frame in flight, from `cut_to_` on
  double cut_to_ = 0;                        ///< share of the frame
  std::vector<BlockMotion> motion_before_;   ///< when the blades were last looked at
  FrameInput input_;                         ///< of the frame in flight
  double duration_ = 0;                      ///< of it [s]
  FramePart part_;                           ///< its last part, ...
  int done_ = 0;                             ///< ... the substeps that were done of it, ...
  std::vector<TearingPoint> tearing_;        ///< ... and the points past their limit at its end
  int substeps_ = 0;                         ///< ... so many, as long as their loads are not summed
  float before_ = 0;                         ///< the substep before these [s]
  double work_ = 0;                          ///< of instruments in it [J]
  std::optional<FrameColliders> colliders_;  ///< of the frame
  bool measured_ = false;                    ///< whether the state is as finish_measure() saw it
  Stiffening stiffening_;
  std::vector<float> modulus_;  ///< see SubstepChoice::follow()
  SubstepChoice substep_;
  FrameResult result_;
  Foresight foresight_;
};

}  // namespace tissue_sim
