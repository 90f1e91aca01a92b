// Between Python's values and the core's.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "tissue_sim/simulation.h"

namespace tissue_sim {

namespace py = pybind11;

/// A scene from a dictionary, YAML text, or the path of a file: an os.PathLike, or one line that
/// ends with .yaml or .yml. Throws as scene_from_yaml() and load_scene() do.
Scene to_scene(const py::object& scene);
/// YAML as dictionaries, lists, numbers, strings. Throws std::invalid_argument for what is no YAML.
py::object from_yaml(const std::string& text);

/// Three numbers; `what` stands in front of what is wrong with others (std::invalid_argument).
Vec3 to_vector(const py::handle& value, const std::string& what);
/// From 3 numbers (x y z), 7 (x y z qx qy qz qw) or a 4 x 4 matrix.
Pose to_pose(const py::handle& value, const std::string& what);
/// x y z qx qy qz qw.
py::array from_pose(const Pose& pose);
/// The edge, n x 3, and the poses that it sweeps over, as a pair.
BladePath to_path(const py::handle& edge_and_poses, const std::string& what);

/// An array that reads the memory of `owner` and keeps it; it cannot be written.
template <class Owner>
py::array view(const std::shared_ptr<Owner>& owner, const py::dtype& type,
               std::vector<py::ssize_t> shape, const void* data) {
  const py::capsule base(new std::shared_ptr<Owner>(owner),
                         [](void* p) { delete static_cast<std::shared_ptr<Owner>*>(p); });
  py::array array(type, std::move(shape), {}, data, base);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// What read_points() writes for these fields, and the fields by name.
py::dtype point_type(const PointSelection& selection);
unsigned to_fields(const std::vector<std::string>& names);

/// The classes of frames and what they report.
void bind_reports(py::module& module);

}  // namespace tissue_sim
