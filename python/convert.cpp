#include "convert.h"

#include <pybind11/stl.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
#include <stdexcept>

namespace tissue_sim {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::string shape_of(const py::array& a) { return py::str(a.attr("shape")); }

[[noreturn]] void refuse(const std::string& what, const std::string& why) {
  throw std::invalid_argument(what + " " + why);
}

Doubles to_doubles(const py::handle& value, const std::string& what) {
  const auto array = py::array::ensure(value);
  if (!array) {
    PyErr_Clear();
    refuse(what, "is no array of numbers: " + std::string(py::repr(value)));
  }
  const char kind = array.dtype().kind();
  if (kind != 'f' && kind != 'i' && kind != 'u') {
    refuse(what, "is of dtype " + std::string(py::str(array.dtype())) + ": must be real numbers");
  }
  return Doubles(array);
}

Pose pose_of_matrix(const double* m, const std::string& what) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T(m);
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  const bool rotates = (R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-6 &&
                       R.determinant() > 0 &&
                       (T.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-9;
  if (!rotates)
    refuse(what, "is no rigid placement: its 3 x 3 must be a rotation, its last row 0 0 0 1");
  return {T.topRightCorner<3, 1>(), Quat(R)};
}

Pose pose_of_row(const double* x, py::ssize_t count) {
  return {Vec3(x[0], x[1], x[2]), count == 7 ? Quat(x[6], x[3], x[4], x[5]) : Quat::Identity()};
}

/// A plain scalar by YAML's core schema.
py::object from_scalar(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return py::str(text);  // it had quotes
  if (text == "true" || text == "false") return py::bool_(text == "true");
  if (text.empty() || text == "~" || text == "null") return py::none();
  std::int64_t whole = 0;
  double number = 0;
  const bool counts = text.find_first_not_of("+-0123456789") == std::string::npos;
  if (counts && YAML::convert<std::int64_t>::decode(node, whole)) return py::int_(whole);
  if (YAML::convert<double>::decode(node, number)) return py::float_(number);
  return py::str(text);
}

py::object from_node(const YAML::Node& node) {
  if (node.IsScalar()) return from_scalar(node);
  if (node.IsSequence()) {
    py::list list;
    for (const YAML::Node& item : node) list.append(from_node(item));
    return std::move(list);
  }
  if (!node.IsMap()) return py::none();
  py::dict dict;
  for (const auto& item : node) dict[py::str(item.first.Scalar())] = from_node(item.second);
  return std::move(dict);
}

/// What JSON, which is YAML, has no word for.
py::object as_plain(const py::object& value) {
  if (py::hasattr(value, "tolist")) return value.attr("tolist")();
  if (py::hasattr(value, "__fspath__")) return value.attr("__fspath__")();
  throw py::type_error("a scene has no place for " + std::string(py::repr(value)));
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

Scene to_scene(const py::object& scene) {
  if (py::isinstance<py::dict>(scene)) {
    return scene_from_yaml(py::str(py::module::import("json").attr("dumps")(
        scene, py::arg("default") = py::cpp_function(as_plain), py::arg("ensure_ascii") = false)));
  }
  if (py::hasattr(scene, "__fspath__")) return load_scene(py::str(scene.attr("__fspath__")()));
  if (!py::isinstance<py::str>(scene)) {
    throw py::type_error("a scene is a dictionary, YAML text or a path, not " +
                         std::string(py::repr(scene)));
  }
  const std::string text = py::str(scene);
  const bool is_path =
      text.find('\n') == std::string::npos && (ends_with(text, ".yaml") || ends_with(text, ".yml"));
  return is_path ? load_scene(text) : scene_from_yaml(text);
}

py::object from_yaml(const std::string& text) {
  try {
    return from_node(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    throw std::invalid_argument(e.what());
  }
}

Vec3 to_vector(const py::handle& value, const std::string& what) {
  const Doubles a = to_doubles(value, what);
  if (a.ndim() != 1 || a.size() != 3) refuse(what, "has shape " + shape_of(a) + ": must be (3,)");
  return {a.data()[0], a.data()[1], a.data()[2]};
}

Pose to_pose(const py::handle& value, const std::string& what) {
  const Doubles a = to_doubles(value, what);
  if (a.ndim() == 2 && a.shape(0) == 4 && a.shape(1) == 4) return pose_of_matrix(a.data(), what);
  if (a.ndim() != 1 || (a.size() != 3 && a.size() != 7)) {
    refuse(what, "has shape " + shape_of(a) + ": must be (3,), (7,) or (4, 4)");
  }
  return pose_of_row(a.data(), a.size());
}

py::array from_pose(const Pose& pose) {
  py::array_t<double> array(7);
  Eigen::Map<Vec3>(array.mutable_data()) = pose.position;
  Eigen::Map<Eigen::Vector4d>(array.mutable_data() + 3) = pose.orientation.coeffs();
  return std::move(array);
}

BladePath to_path(const py::handle& edge_and_poses, const std::string& what) {
  if (!py::isinstance<py::sequence>(edge_and_poses) || py::len(edge_and_poses) != 2) {
    refuse(what, "must be a pair: an edge, and the poses that it sweeps over");
  }
  const auto pair = py::reinterpret_borrow<py::sequence>(edge_and_poses);
  const Doubles edge = to_doubles(pair[0], "the edge of " + what);
  if (edge.ndim() != 2 || edge.shape(1) != 3) {
    refuse("the edge of " + what, "has shape " + shape_of(edge) + ": must be (n, 3)");
  }
  const Doubles poses = to_doubles(pair[1], "the poses of " + what);
  const bool rows = poses.ndim() == 2 && (poses.shape(1) == 3 || poses.shape(1) == 7);
  const bool matrices = poses.ndim() == 3 && poses.shape(1) == 4 && poses.shape(2) == 4;
  if (!rows && !matrices) {
    refuse("the poses of " + what,
           "have shape " + shape_of(poses) + ": must be (n, 3), (n, 7) or (n, 4, 4)");
  }
  BladePath path;
  for (py::ssize_t i = 0; i < edge.shape(0); ++i) {
    path.edge.emplace_back(Eigen::Map<const Vec3>(edge.data(i, 0)));
  }
  for (py::ssize_t i = 0; i < poses.shape(0); ++i) {
    path.poses.push_back(rows ? pose_of_row(poses.data(i, 0), poses.shape(1))
                              : pose_of_matrix(poses.data(i, 0, 0), "a pose of " + what));
  }
  return path;
}

namespace {
struct Field {
  const char* name;
  int floats;
};
constexpr Field kFields[] = {
    {"rest", 3}, {"displacement", 3}, {"velocity", 3}, {"volume", 1}, {"stress_tensor", 6}};
}  // namespace

py::dtype point_type(const PointSelection& selection) {
  py::list fields;
  fields.append(py::make_tuple("position", "<f4", py::make_tuple(3)));
  fields.append(py::make_tuple("rgb", "<u4"));
  fields.append(py::make_tuple("id", "<u4"));
  fields.append(py::make_tuple("fragment", "<i4"));
  fields.append(py::make_tuple("stress", "<f4"));
  fields.append(py::make_tuple("damage", "<f4"));
  for (int i = 0; i < 5; ++i) {
    if ((selection.fields >> i & 1) == 0) continue;
    if (kFields[i].floats == 1) {
      fields.append(py::make_tuple(kFields[i].name, "<f4"));
    } else {
      fields.append(py::make_tuple(kFields[i].name, "<f4", py::make_tuple(kFields[i].floats)));
    }
  }
  return py::dtype::from_args(std::move(fields));
}

unsigned to_fields(const std::vector<std::string>& names) {
  unsigned fields = 0;
  for (const std::string& name : names) {
    int i = 0;
    while (i < 5 && name != kFields[i].name) ++i;
    if (i == 5) {
      throw std::invalid_argument(
          "fields has '" + name +
          "': there are rest, displacement, velocity, volume, stress_tensor");
    }
    fields |= 1u << i;
  }
  return fields;
}

}  // namespace tissue_sim
