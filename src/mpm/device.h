// What works on tissue of the material point method: a CPU (cpu/) or a GPU (cuda/).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compute/archive.h"
#include "fragments/pieces.h"
#include "frame/run_frame.h"
#include "mpm/cut_tissue.h"
#include "mpm/fragment_forecast.h"
#include "mpm/mpm_state.h"
#include "mpm/state_figures.h"
#include "mpm/tear/tear.h"
#include "tissue_sim/point.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

/// The frame that is worked on.
struct MpmFrame {
  FrameInput input;
  double duration;  ///< [s]
  FrameColliders colliders;
  bool blades;                             ///< whether there are any
  std::vector<BlockMotion> before;         ///< when they were last looked at
  double cut_to = 0;                       ///< share of the frame up to which they did
  std::vector<TearingPoint> tearing = {};  ///< points past their limit at the end of the last part
  bool watched = false;                    ///< whether its energy counts
};

/// Tissue and what a frame makes of it, which its device and the order of a frame share.
struct MpmRun {
  MpmState state;
  Pieces pieces;
  std::optional<MpmFrame> frame;
  FrameResult result;
  double work = 0;             ///< of instruments in the last part of a frame [J]
  Stiffening stiffening;       ///< as it was measured, ...
  std::vector<float> modulus;  ///< ... and this: SubstepChoice::follow()
};

/// What is measured, as bits. Whoever measures energies measures stiffness, too.
inline constexpr unsigned kMeasureMotion = 1;     ///< MpmState::motion
inline constexpr unsigned kMeasureStiffness = 2;  ///< and MpmState::worst_stiffening: half the work
inline constexpr unsigned kMeasureEnergies = 4;

class MpmDevice {
 public:
  virtual ~MpmDevice() = default;
  virtual std::string name() const = 0;

  /// Which nodes the lattices have.
  virtual NodeRange node_range() const = 0;
  /// Divides new tissue into blocks and takes it over.
  virtual void begin() = 0;
  /// The new tissue is measured, and bonds that never were are broken.
  virtual void begun() {}

  /// Measures at least this. Returns what it did.
  virtual unsigned measure(unsigned what) = 0;
  /// The longest substep of the linearised motion [s]: see MeasureLimit.
  virtual double measure_limit(const std::vector<std::uint8_t>& blocks, int steps) = 0;

  // The steps of a frame, in this order: frame/run_frame.h.
  /// Impulses of anchors are as of the frame's beginning; `move`: so are the nodes that they hold,
  /// which begin to move.
  virtual void begin_frame(const FrameInput& /*input*/, bool /*move*/) {}
  /// What is left of the frame begins: from here blades cut, and tools may meet tissue.
  virtual void begin_rest() = 0;
  /// Keeps all that a part changes until something is cut or tears.
  virtual void save_motion() = 0;
  /// The substeps of a part, until points are past their limit. Returns how many.
  virtual int run_part(const FramePart& part) = 0;
  /// measure() at the end of a part; what acted on tools in it is known from here on.
  virtual unsigned measure_part(unsigned what) { return measure(what); }
  /// Whether, in the part that was measured, tissue came to a tool that was not looked out for; not
  /// where the part was done again for that.
  virtual bool missed_contact() = 0;
  /// Back to save_motion(), if it kept all; `missed`: for missed_contact().
  virtual bool can_restore_motion() const { return true; }
  virtual void restore_motion(bool missed) = 0;
  /// Debris was settled: contacts of these points, by number, begin anew.
  virtual void settled(const std::vector<std::int32_t>& /*points*/) {}
  /// Brings the impulses of anchors.
  virtual void end_frame() {}

  // Cuts and tears. What bonds and nodes do is the host's; these bring and send what it needs.
  /// What paths cut as sweep_bonds() says, while tissue moves from where begin_rest() found it
  /// (`moves`), or as it is.
  virtual void sweep(const std::vector<BladePath>& paths, bool moves,
                     std::vector<std::int32_t>& changed, std::vector<std::int32_t>& touched,
                     CutReport& report) = 0;
  /// Before and after tissue around these points is taken apart; none: its front alone changes.
  virtual void before_parting(const std::vector<std::int32_t>& /*points*/) {}
  virtual void parted(const std::vector<std::int32_t>& /*points*/, const Apart& /*apart*/) {}
  /// Labels pieces anew after bonds broke. Returns the new ids.
  virtual std::vector<int> label_pieces() = 0;
  /// Whether that may go on while blocks are made.
  virtual bool labels_by_bonds_alone() const = 0;
  /// Brings the nodes around points; sends those that were brought last; brings all nodes.
  virtual void bring_nodes(const std::vector<std::int32_t>& /*points*/) {}
  virtual void send_nodes() {}
  virtual void bring_all_nodes() {}
  /// Sets BoundaryMesh::now, of a mesh that is the tissue's.
  virtual void place_boundary() = 0;
  /// The same where the device is: Tissue::surface_on_gpu(), push_surface_on_gpu().
  virtual GpuSurface place_boundary_on_gpu() { return {}; }
  virtual void push_boundary_on_gpu(const float* /*impulses*/) {}

  /// The points that the fragment network may look at, with their nodes brought.
  virtual std::vector<StrainedPoint> strained() = 0;

  virtual int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) = 0;
  virtual GpuPoints read_points_on_gpu(const PointSelection& /*selection*/) { return {}; }

  // Saved states: what is the device's own. After restore() all was read, and restored() works on.
  virtual void save(ArchiveWriter& archive) = 0;
  virtual void restore(ArchiveReader& archive) = 0;
  virtual void restored() = 0;
};

using MakeMpmDevice = std::unique_ptr<MpmDevice> (*)(const Scene& scene, MpmRun& run);
std::unique_ptr<MpmDevice> make_cpu_mpm_device(const Scene& scene, MpmRun& run);
std::unique_ptr<MpmDevice> make_cuda_mpm_device(const Scene& scene, MpmRun& run);

}  // namespace tissue_sim
