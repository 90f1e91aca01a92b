#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "convert.h"

namespace tissue_sim {

void bind_reports(py::module& m) {
  py::class_<ToolRequest>(m, "ToolRequest", "Where a tool shall be at the end of a frame.")
      .def(py::init([](const py::object& pose, std::optional<double> jaw, bool placed,
                       std::optional<double> grip_pressure) {
             return ToolRequest{to_pose(pose, "the pose"), jaw, placed, grip_pressure};
           }),
           py::arg("pose"), py::arg("jaw") = py::none(), py::arg("placed") = false,
           py::arg("grip_pressure") = py::none(),
           "pose: (3,) x y z [m], (7,) x y z qx qy qz qw, or a (4, 4) matrix; world frame.\n"
           "jaw: between a grasper's jaws [rad], as before if None; below 0 squeezes with more.\n"
           "placed: it does not move there from where it was, it is put there.\n"
           "grip_pressure: of a grasper's jaws at most, from now on [Pa].")
      .def_property_readonly(
          "pose", [](const ToolRequest& r) { return from_pose(r.pose); },
          "(7,) x y z qx qy qz qw [m]")
      .def_readonly("jaw", &ToolRequest::jaw, "[rad] or None")
      .def_readonly("placed", &ToolRequest::placed)
      .def_readonly("grip_pressure", &ToolRequest::grip_pressure, "[Pa] or None");
  py::class_<ToolMotion>(m, "ToolMotion", "Motion of a tool over one frame.")
      .def_readonly("present", &ToolMotion::present, "False until its first pose came")
      .def_property_readonly(
          "begin", [](const ToolMotion& t) { return from_pose(t.begin); },
          "(7,) x y z qx qy qz qw [m]")
      .def_property_readonly(
          "end", [](const ToolMotion& t) { return from_pose(t.end); }, "(7,) x y z qx qy qz qw [m]")
      .def_readonly("jaw_begin", &ToolMotion::jaw_begin, "[rad]")
      .def_readonly("jaw_end", &ToolMotion::jaw_end, "[rad]");
  py::class_<Wrench>(m, "Wrench", "Force and moment about a stated point, world axes.")
      .def_readonly("force", &Wrench::force, "(3,) [N]")
      .def_readonly("torque", &Wrench::torque, "(3,) [N m]");
  py::class_<ToolLoad>(m, "ToolLoad", "What the tissue did to a tool during one frame, at its tip.")
      .def_readonly("mean", &ToolLoad::mean, "Wrench, mean over the frame's substeps")
      .def_readonly("peak_force", &ToolLoad::peak_force, "largest of a substep [N]")
      .def_readonly("grip", &ToolLoad::grip, "what each jaw presses with [N]")
      .def_readonly("grip_area", &ToolLoad::grip_area, "and on which area of tissue [m^2]")
      .def_readonly("points_inside", &ToolLoad::points_inside,
                    "of tissue, in the tool deeper than contact gives way")
      .def_readonly("inside_depth", &ToolLoad::inside_depth, "of the deepest of them [m]");
  py::class_<CutReport>(m, "CutReport", "What one frame's cutting did.")
      .def_readonly("bonds_broken", &CutReport::bonds_broken)
      .def_readonly("points_separated", &CutReport::points_separated)
      .def_readonly("new_fragments", &CutReport::new_fragments, "ids that appeared")
      .def_readonly("pieces_left_whole", &CutReport::pieces_left_whole)
      .def_readonly("why_left_whole", &CutReport::why_left_whole);
  py::class_<FrameResult>(m, "FrameResult", "What one frame brought.")
      .def_readonly("loads", &FrameResult::loads, "ToolLoad of each tool, in the scene's order")
      .def_readonly("points_inside", &FrameResult::points_inside)
      .def_readonly("inside_depth", &FrameResult::inside_depth, "[m]")
      .def_readonly("cut_reports", &FrameResult::cut_reports, "CutReport of each cut asked for")
      .def_readonly("anchor_loads", &FrameResult::anchor_loads,
                    "Wrench of the tissue on each anchor, about its origin, mean of the frame")
      .def_readonly("blade_report", &FrameResult::blade_report, "what instruments' edges cut")
      .def_readonly("tear_report", &FrameResult::tear_report, "what tore by itself")
      .def_readonly("substeps", &FrameResult::substeps)
      .def_readonly("substep", &FrameResult::substep, "the longest [s]")
      .def_readonly("kinetic_energy", &FrameResult::kinetic_energy, "[J]")
      .def_readonly("elastic_energy", &FrameResult::elastic_energy, "[J]")
      .def_readonly("cutting_work", &FrameResult::cutting_work, "[J]")
      .def_readonly("max_speed", &FrameResult::max_speed, "of a point [m/s]")
      .def_readonly("blew_up", &FrameResult::blew_up);
  py::class_<AppliedInput>(m, "AppliedInput", "What was applied in a frame: Simulation.repeat().")
      .def_readonly("frame", &AppliedInput::frame)
      .def_readonly("tools", &AppliedInput::tools, "ToolMotion of each tool");
  py::class_<FrameReport>(m, "FrameReport")
      .def_readonly("input", &FrameReport::input)
      .def_readonly("result", &FrameReport::result)
      .def_readonly("cfl", &FrameReport::cfl, "longest substep * wave speed / cell size")
      .def_readonly("compute_time", &FrameReport::compute_time, "wall time that it took [s]")
      .def_readonly("notes", &FrameReport::notes, "of tools that are placed within tissue");
  py::class_<SettleReport>(m, "SettleReport")
      .def_readonly("at_rest", &SettleReport::at_rest)
      .def_readonly("time", &SettleReport::time, "that it took [s]")
      .def_readonly("speed", &SettleReport::speed, "of the fastest point at the end [m/s]");
  py::class_<Momentum>(m, "Momentum", "Of all tissue, world axes.")
      .def_readonly("mass", &Momentum::mass, "[kg]")
      .def_readonly("centre", &Momentum::centre, "(3,) of the mass [m]")
      .def_readonly("linear", &Momentum::linear, "(3,) [kg m/s]")
      .def_readonly("angular", &Momentum::angular, "(3,) about the centre of mass [kg m^2/s]");
}

}  // namespace tissue_sim
