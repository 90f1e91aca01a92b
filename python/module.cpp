// tissue_sim._core: include/tissue_sim for Python.
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <fstream>
#include <stdexcept>
#include <utility>

#include "convert.h"
#include "gpu_array.h"
#include "tissue_sim/limits.h"
#include "tissue_sim/renderer.h"

namespace tissue_sim {
namespace {

/// As many points as the memory that is free takes, at 200 bytes each.
std::int64_t most_points() {
  std::ifstream file("/proc/meminfo");
  for (std::string name; file >> name; file.ignore(256, '\n')) {
    std::int64_t kilobytes = 0;
    if (name == "MemAvailable:" && file >> kilobytes) {
      return std::min(work_limits().max_points, kilobytes * 1024 / 200);
    }
  }
  return work_limits().max_points;
}

/// A simulation, and the memory that its arrays read. While one thread is in a call, others are
/// refused: Simulation is one thread's, and calls let go of the GIL.
class PySimulation {
 public:
  explicit PySimulation(const Scene& scene) {
    const LimitWork limit(with_points(most_points()));
    simulation_ = std::make_unique<Simulation>(scene);
    for (const Tool& t : scene.tools) tool_names_.push_back(t.name);
    for (const Body& b : scene.bodies) {
      for (const Anchor& a : b.anchors) anchor_names_.push_back(a.name);
    }
    for (const Camera& c : scene.cameras) camera_names_.push_back(c.name);
  }

  /// Calls work(simulation), without the GIL where it is to be free.
  template <class Work>
  auto call(const Work& work) {
    const Use use(busy_);
    const py::gil_scoped_release free;
    return work(*simulation_);
  }
  /// The same for what moves time: arrays are stale from here on, even if it throws.
  template <class Work>
  auto advance(const Work& work) {
    if (!busy_) ++generation_;
    return call(work);
  }

  FrameRequest request(const py::object& tools, const py::iterable& cuts, const py::object& anchors,
                       const py::object& gravity, std::optional<double> damping) const {
    FrameRequest request;
    each_of(tools, tool_names_, "tool", [&](std::size_t i, const py::handle& of) {
      request.tools.resize(tool_names_.size());
      request.tools[i] =
          py::isinstance<ToolRequest>(of)
              ? of.cast<ToolRequest>()
              : ToolRequest{
                    to_pose(of, "the pose of tool '" + tool_names_[i] + "'"), {}, false, {}};
    });
    for (const py::handle& cut : cuts) {
      request.cuts.push_back(to_path(cut, "cut " + std::to_string(request.cuts.size())));
    }
    each_of(anchors, anchor_names_, "anchor", [&](std::size_t i, const py::handle& of) {
      request.anchors.resize(anchor_names_.size());
      request.anchors[i] = to_pose(of, "the pose of anchor '" + anchor_names_[i] + "'");
    });
    if (!gravity.is_none()) request.gravity = to_vector(gravity, "gravity");
    request.damping = damping;
    return request;
  }

  SettleReport settle(const SettleLimits& limits) {
    if (!busy_) ++generation_;
    const Use use(busy_);
    Settling settling(*simulation_, limits);
    FrameReport frame;
    do {
      if (PyErr_CheckSignals() != 0) {
        settling.end(*simulation_);
        throw py::error_already_set();
      }
      const py::gil_scoped_release free;
      frame = simulation_->advance_frame();
    } while (!settling.is_over(frame));
    return settling.end(*simulation_);
  }

  py::object points(const py::object& self, int stride, bool surface_only, bool loose_only,
                    const std::vector<std::string>& fields) {
    const PointSelection selection = select(stride, surface_only, loose_only, fields);
    own(points_);
    const int count =
        call([&](Simulation& s) { return s.tissue().read_points(selection, *points_); });
    return guard(self, view(points_, point_type(selection), {count}, points_->data()));
  }

  py::dict points_on_gpu(int stride, bool surface_only, bool loose_only,
                         const std::vector<std::string>& fields) {
    const PointSelection selection = select(stride, surface_only, loose_only, fields);
    const GpuPoints points =
        call([&](Simulation& s) { return s.tissue().read_points_on_gpu(selection); });
    if (points.gpu < 0) {
      throw std::runtime_error("the tissue is not on a GPU: points() reads it where it is");
    }
    return gpu_arrays(points, selection);
  }

  py::object surface(const py::object& self) {
    own(surface_);
    call([&](Simulation& s) { s.tissue().read_surface(*surface_); });
    const auto n = static_cast<py::ssize_t>(surface_->fragment.size());
    return tuple_of(
        "Surface",
        guard(self, view(surface_, py::dtype::of<float>(), {n, 3, 3}, surface_->corners.data())),
        guard(self, view(surface_, py::dtype::of<float>(), {n, 3, 3}, surface_->rest.data())),
        guard(self, view(surface_, py::dtype::of<std::int32_t>(), {n}, surface_->fragment.data())),
        guard(self, view(surface_, py::dtype::of<std::int32_t>(), {n}, surface_->point.data())),
        guard(self, view(surface_, py::dtype("bool"), {n}, surface_->cut.data())));
  }

  py::object render(const py::object& self, const py::object& camera, const py::object& pose) {
    const std::vector<Camera>& all = simulation_->scene().cameras;
    const int number = index_of(camera, camera_names_, "camera");
    const Camera& of = all.at(number);
    const Pose eye =
        pose.is_none() ? of.pose : to_pose(pose, "the pose of camera '" + of.name + "'");
    own(images_);
    call([&](Simulation& s) {
      if (!renderer_) renderer_ = std::make_unique<Renderer>(s.scene());
      if (shown_ != generation_) {
        read_view(s, view_);
        renderer_->show(view_);
        shown_ = generation_;
      }
      last_looks_.resize(all.size());
      renderer_->render(of, eye, *images_, of.flow ? &last_looks_[number] : nullptr);
    });
    const py::ssize_t w = images_->width, h = images_->height;
    return tuple_of(
        "Images",
        guard(self, view(images_, py::dtype::of<std::uint8_t>(), {h, w, 3}, images_->rgb.data())),
        guard(self, view(images_, py::dtype::of<float>(), {h, w}, images_->depth.data())),
        guard(self, view(images_, py::dtype::of<std::uint16_t>(), {h, w}, images_->labels.data())),
        of.flow
            ? guard(self, view(images_, py::dtype::of<float>(), {h, w, 2}, images_->flow.data()))
            : py::none());
  }

  py::array fragments() {
    struct Row {
      std::int32_t id, parent, body, point_count;
      double volume, centroid[3], velocity[3], box_min[3], box_max[3];
      std::uint8_t loose, unused[7];
    };
    const auto rows = std::make_shared<std::vector<Row>>();
    call([&](Simulation& s) {
      for (const Fragment& f : s.tissue().fragments()) {
        Row row = {f.id, f.parent, f.body, f.point_count, f.volume, {}, {}, {}, {}, f.loose, {}};
        const std::pair<double*, const Vec3*> places[] = {{row.centroid, &f.centroid},
                                                          {row.velocity, &f.velocity},
                                                          {row.box_min, &f.box.min},
                                                          {row.box_max, &f.box.max}};
        for (const auto& place : places) Eigen::Map<Vec3>(place.first) = *place.second;
        rows->push_back(row);
      }
    });
    py::list fields;
    for (const char* name : {"id", "parent", "body", "point_count"})
      fields.append(py::make_tuple(name, "<i4"));
    fields.append(py::make_tuple("volume", "<f8"));
    for (const char* name : {"centroid", "velocity", "box_min", "box_max"}) {
      fields.append(py::make_tuple(name, "<f8", py::make_tuple(3)));
    }
    fields.append(py::make_tuple("loose", "?"));
    fields.append(py::make_tuple("", "V7"));
    return view(rows, py::dtype::from_args(std::move(fields)),
                {static_cast<py::ssize_t>(rows->size())}, rows->data());
  }

  py::array save() {
    const auto saved =
        std::make_shared<std::vector<std::uint8_t>>(call([](Simulation& s) { return s.save(); }));
    return view(saved, py::dtype::of<std::uint8_t>(), {static_cast<py::ssize_t>(saved->size())},
                saved->data());
  }

  void restore(const py::buffer& saved) {
    const py::buffer_info bytes = saved.request();
    if (bytes.itemsize != 1 || bytes.ndim != 1 || bytes.strides[0] != 1) {
      throw std::invalid_argument("a saved state is bytes, or the array that save() gave");
    }
    const Span<const std::uint8_t> span(static_cast<const std::uint8_t*>(bytes.ptr), bytes.size);
    advance([&](Simulation& s) { s.restore(span); });
  }

  py::array anchor(const py::object& which) {
    const std::size_t i = index_of(which, anchor_names_, "anchor");
    return from_pose(call([&](Simulation& s) { return s.anchor(static_cast<int>(i)); }));
  }

  /// Of what never changes, or is read while no frame runs.
  const Simulation& simulation() const { return *simulation_; }
  std::int64_t generation() const { return generation_; }

 private:
  /// Holds the simulation for one call.
  struct Use {
    explicit Use(bool& busy) : busy(busy) {
      if (busy)
        throw std::runtime_error("the simulation is at work in another thread: wait for it");
      busy = true;
    }
    ~Use() { busy = false; }  // with or without the GIL: nobody else writes it meanwhile
    bool& busy;
  };

  static PointSelection select(int stride, bool surface_only, bool loose_only,
                               const std::vector<std::string>& fields) {
    if (stride < 1)
      throw std::invalid_argument("stride is " + std::to_string(stride) + ": must be at least 1");
    return {stride, surface_only, loose_only, to_fields(fields)};
  }

  static std::size_t index_of(const py::object& which, const std::vector<std::string>& names,
                              const char* what) {
    if (py::isinstance<py::int_>(which)) {
      const auto i = which.cast<std::int64_t>();
      if (i >= 0 && i < static_cast<std::int64_t>(names.size())) return i;
    } else if (py::isinstance<py::str>(which)) {
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (!names[i].empty() && names[i] == which.cast<std::string>()) return i;
      }
    }
    std::string all;
    for (const std::string& name : names) all += " '" + name + "'";
    throw std::invalid_argument(std::string(what) + " " + std::string(py::repr(which)) +
                                " is not in the scene, which has" + (all.empty() ? " none" : all));
  }

  /// Calls work(index, value) for a dictionary by name, or for a sequence in the scene's order,
  /// whose None are left out.
  template <class Work>
  static void each_of(const py::object& asked, const std::vector<std::string>& names,
                      const char* what, const Work& work) {
    if (asked.is_none()) return;
    if (py::isinstance<py::dict>(asked)) {
      for (const auto& item : py::reinterpret_borrow<py::dict>(asked)) {
        work(index_of(py::reinterpret_borrow<py::object>(item.first), names, what), item.second);
      }
      return;
    }
    if (!py::isinstance<py::sequence>(asked) || py::len(asked) != names.size()) {
      throw std::invalid_argument(std::string(what) +
                                  "s must be a dictionary by name, or a list of " +
                                  std::to_string(names.size()) + ", as the scene has");
    }
    const auto list = py::reinterpret_borrow<py::sequence>(asked);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const py::object of = list[i];
      if (!of.is_none()) work(i, of);
    }
  }

  /// Memory that no array reads any more is used again.
  template <class T>
  static void own(std::shared_ptr<T>& memory) {
    if (!memory || memory.use_count() > 1) memory = std::make_shared<T>();
  }
  static py::object guard(const py::object& self, const py::array& array) {
    return py::module::import("tissue_sim.array").attr("Array")(array, self);
  }
  template <class... Arrays>
  static py::object tuple_of(const char* name, const Arrays&... arrays) {
    return py::module::import("tissue_sim.array").attr(name)(arrays...);
  }

  std::unique_ptr<Simulation> simulation_;
  std::vector<std::string> tool_names_, anchor_names_, camera_names_;
  std::shared_ptr<std::vector<std::uint8_t>> points_;
  std::shared_ptr<SurfaceTriangles> surface_;
  std::shared_ptr<CameraImages> images_;
  std::unique_ptr<Renderer> renderer_;
  SceneView view_;
  std::vector<LastLook> last_looks_;          // of each camera, for its flow
  std::int64_t generation_ = 0, shown_ = -1;  // of the state; what the renderer shows
  bool busy_ = false;
};

constexpr char kAdvance[] =
    "Advances one frame, 1 / frame_rate seconds; what is left out stays as it was asked for "
    "last.\n\n"
    "tools: poses or ToolRequests by name, or a list in the scene's order with None for those "
    "that\n"
    "  stay. A pose is (3,) x y z [m], (7,) x y z qx qy qz qw, or a (4, 4) matrix, world frame.\n"
    "cuts: pairs (edge, poses) at the start of the frame: the edge (n, 3) in the blade's frame "
    "[m],\n"
    "  and at least two poses, (m, 3), (m, 7) or (m, 4, 4), that it sweeps over.\n"
    "anchors: poses by name, or a list in the scene's order.\n"
    "gravity: (3,) [m/s^2]. damping: [1/s].\n\n"
    "ValueError: a wrong shape, dtype or name, NaN, no rotation; then nothing was done.\n"
    "RuntimeError: after a blow-up; build a new Simulation. Returns a FrameReport.";

constexpr char kPoints[] =
    "The tissue's points as a structured array (n,), read in place: position (3,) [m], rgb\n"
    "(0x00RRGGBB), id (for ever the same material point), fragment, stress (von Mises [Pa]), "
    "damage\n"
    "(share of broken bonds), then of `fields`: rest (3,) [m], displacement (3,) [m], velocity "
    "(3,)\n"
    "[m/s], volume [m^3], stress_tensor (6,) xx yy zz xy yz zx [Pa].\n\n"
    "stride: every stride-th id. surface_only: those at the surface and at cuts. loose_only: those "
    "of\n"
    "loose fragments. Valid until the next advance: see Array.";

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.doc() = "Soft tissue that instruments press, pull and cut. SI units.";
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const TooLarge& e) {
      PyErr_SetString(PyExc_MemoryError, e.what());
    } catch (const OutOfMemory& e) {
      PyErr_SetString(PyExc_MemoryError, e.what());
    }
  });
  bind_reports(m);
  bind_gpu_array(m);
  m.def(
      "load_scene",
      [](const py::object& path) { return from_yaml(scene_to_yaml(load_scene(py::str(path)))); },
      py::arg("path"),
      "The scene of a file as a dictionary, defaults included. ValueError names a field.");
  m.def(
      "scene_to_yaml", [](const py::object& scene) { return scene_to_yaml(to_scene(scene)); },
      py::arg("scene"), "The whole scene as YAML text, defaults included.");
  m.def("from_yaml", &from_yaml, py::arg("text"), "YAML text as dictionaries, lists and numbers.");
  m.def("can_render", &can_render, "Whether this build draws images: with Embree.");

  using P = PySimulation;
  py::class_<P>(m, "Simulation", "A scene, its tissue and the time. One thread at a time.")
      .def(
          py::init([](const py::object& scene) {
            const Scene read = to_scene(scene);
            const py::gil_scoped_release free;
            return std::make_unique<P>(read);
          }),
          py::arg("scene"),
          "scene: a dictionary or YAML text as docs and scene.h have it, or the path of a file.\n\n"
          "ValueError names the field that is wrong; MemoryError: more points than memory or GPU "
          "take;\n"
          "RuntimeError: a device that is not there.")
      .def(
          "advance",
          [](P& p, const py::object& tools, const py::iterable& cuts, const py::object& anchors,
             const py::object& gravity, std::optional<double> damping) {
            const FrameRequest request = p.request(tools, cuts, anchors, gravity, damping);
            return p.advance([&](Simulation& s) { return s.advance_frame(request); });
          },
          py::arg("tools") = py::none(), py::arg("cuts") = py::tuple(),
          py::arg("anchors") = py::none(), py::arg("gravity") = py::none(),
          py::arg("damping") = py::none(), kAdvance)
      .def(
          "repeat",
          [](P& p, const AppliedInput& input) {
            return p.advance([&](Simulation& s) { return s.repeat_frame(input); });
          },
          py::arg("input"), "Advances one frame with exactly what FrameReport.input says.")
      .def(
          "settle",
          [](P& p, double speed, double time, double damping) {
            return p.settle({speed, time, damping});
          },
          py::arg("speed") = 1e-4, py::arg("time") = 10.0, py::arg("damping") = -1.0,
          "Frames until no point was faster than speed [m/s] for a tenth of a second, or time [s] "
          "is\n"
          "over; damping [1/s] holds meanwhile, unless it is negative.")
      .def(
          "points",
          [](const py::object& self, int stride, bool surface_only, bool loose_only,
             const std::vector<std::string>& fields) {
            return self.cast<P&>().points(self, stride, surface_only, loose_only, fields);
          },
          py::arg("stride") = 1, py::arg("surface_only") = false, py::arg("loose_only") = false,
          py::arg("fields") = py::tuple(), kPoints)
      .def("points_on_gpu", &P::points_on_gpu, py::arg("stride") = 1,
           py::arg("surface_only") = false, py::arg("loose_only") = false,
           py::arg("fields") = py::tuple(),
           "The same in the memory of the GPU that the tissue is on: a dictionary of GpuArrays by "
           "field,\n"
           "rgb and id as int32, for torch.from_dlpack() and others. They stay valid, and keep "
           "their\n"
           "values. RuntimeError on a CPU.")
      .def(
          "surface", [](const py::object& self) { return self.cast<P&>().surface(self); },
          "The triangles of the tissue's surface: corners and rest (n, 3, 3) [m], fragment (n,), "
          "point (n,),\n"
          "the id of one there, and cut (n,) bool. Valid until the next advance: see Array.")
      .def(
          "render",
          [](const py::object& self, const py::object& camera, const py::object& pose) {
            return self.cast<P&>().render(self, camera, pose);
          },
          py::arg("camera") = 0, py::arg("pose") = py::none(),
          "What a camera of the scene (name or number) sees from its pose or another: rgb (h, w, "
          "3)\n"
          "uint8, depth (h, w) float32 [m], NaN where nothing is, labels (h, w) uint16: 0 nothing, "
          "1\n"
          "ground, 2 + i tool i, 1000 + id a piece; flow (h, w, 2) float32 [pixels] of a camera "
          "with\n"
          "flow: true: how far what is seen there has moved to the right and down since its last "
          "image,\n"
          "NaN in the first and where nothing was; else None. Valid until the next advance: see "
          "Array.")
      .def("fragments", &P::fragments,
           "All pieces, by id: a structured array (n,) with id, parent, body, point_count, volume "
           "[m^3],\n"
           "centroid (3,) [m], velocity (3,) [m/s], box_min, box_max (3,) [m], loose. Stays valid.")
      .def("save", &P::save, "The whole state as an array (n,) of bytes. Stays valid.")
      .def("restore", &P::restore, py::arg("saved"),
           "Goes on from there with the same bits; only before the first frame, in the same scene.")
      .def(
          "checksum",
          [](P& p) { return p.call([](Simulation& s) { return s.tissue().checksum(); }); },
          "Of the whole state: equal states, equal checksums.")
      .def("momentum",
           [](P& p) { return p.call([](Simulation& s) { return s.tissue().momentum(); }); })
      .def("anchor", &P::anchor, py::arg("which"), "Where an anchor (name or number) is: (7,) [m].")
      .def_property_readonly(
          "scene", [](P& p) { return from_yaml(scene_to_yaml(p.simulation().scene())); },
          "The scene as a dictionary, defaults included.")
      .def_property_readonly(
          "tools", [](P& p) { return p.call([](Simulation& s) { return s.tools(); }); },
          "ToolMotion of each tool, at rest where the last frame left it.")
      .def_property_readonly(
          "frame", [](P& p) { return p.call([](Simulation& s) { return s.frame(); }); },
          "Frames completed.")
      .def_property_readonly(
          "time", [](P& p) { return p.call([](Simulation& s) { return s.time(); }); },
          "Simulated [s].")
      .def_property_readonly(
          "point_count",
          [](P& p) { return p.call([](Simulation& s) { return s.tissue().point_count(); }); })
      .def_property_readonly(
          "fragment_count",
          [](P& p) { return p.call([](Simulation& s) { return s.tissue().fragment_count(); }); })
      .def_property_readonly(
          "device_name",
          [](P& p) { return p.call([](Simulation& s) { return s.tissue().device_name(); }); })
      .def_property_readonly(
          "notes", [](P& p) { return p.call([](Simulation& s) { return s.tissue().notes(); }); },
          "What was repaired or assumed when the scene was built.")
      .def_property_readonly("generation", &P::generation, "Grows whenever arrays become stale.");
}

}  // namespace tissue_sim
