#include "ros/state_message.h"

#include "ros/conversions.h"

namespace tissue_sim {

bool PieceCount::follow(Tissue& tissue) {
  if (tissue.fragment_count() == count) return false;
  *this = {};
  for (const Fragment& f : tissue.fragments()) {
    ++count;
    loose += f.loose;
    volume += f.volume;
  }
  return true;
}

SimulationState state_message(Simulation& simulation, const FrameReport& report,
                              const RunState& run, const PieceCount& pieces, bool checksum) {
  SimulationState m;
  m.frame = simulation.frame();
  m.time = simulation.time();
  m.frame_rate = simulation.scene().frame_rate;
  m.paused = run.paused;
  m.blew_up = run.blew_up;
  m.substeps = report.result.substeps;
  m.substep = report.result.substep;
  m.cfl = report.cfl;
  m.compute_time = report.compute_time;
  m.real_time_factor = run.real_time_factor;
  m.late_samples = run.late_samples;
  m.particles = simulation.tissue().point_count();
  m.fluid_particles = simulation.tissue().fluid_particle_count();
  m.fragments = pieces.count;
  m.loose_fragments = pieces.loose;
  m.fragment_volume = pieces.volume;
  m.device = without_commas(simulation.tissue().device_name());
  m.kinetic_energy = report.result.kinetic_energy;
  m.elastic_energy = report.result.elastic_energy;
  m.cutting_work = report.result.cutting_work;
  m.max_speed = report.result.max_speed;
  m.points_inside = report.result.points_inside;
  m.inside_depth = report.result.inside_depth;
  if (checksum) m.checksum = to_hex(simulation.tissue().checksum());
  return m;
}

}  // namespace tissue_sim
