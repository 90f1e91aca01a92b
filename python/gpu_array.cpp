#include "gpu_array.h"

#include <cstdint>
#include <memory>

#include "convert.h"

namespace tissue_sim {
namespace {

// The structures of DLPack 0.8 (Apache 2.0, dmlc/dlpack), which are fixed.
struct DLDevice {
  std::int32_t type, id;
};
struct DLTensor {
  void* data;
  DLDevice device;
  std::int32_t ndim;
  struct {
    std::uint8_t code, bits;
    std::uint16_t lanes;
  } dtype;
  std::int64_t* shape;
  std::int64_t* strides;  // in elements
  std::uint64_t byte_offset;
};
struct DLManagedTensor {
  DLTensor tensor;
  void* context;
  void (*deleter)(DLManagedTensor*);
};
constexpr std::int32_t kCuda = 2;
enum : std::uint8_t { kInt = 0, kFloat = 2 };
constexpr char kUnused[] = "dltensor";  // of a capsule that no library has taken yet

/// A field of each point: `width` numbers of four bytes, from `offset` on, every `stride` bytes.
struct GpuArray {
  GpuPoints points;
  std::int64_t offset = 0, stride = 0, width = 1;
  bool is_float = true;

  py::tuple shape() const {
    if (width == 1) return py::make_tuple(points.count);
    return py::make_tuple(points.count, width);
  }

  py::capsule dlpack() const {
    struct Lent {
      DLManagedTensor managed;
      std::shared_ptr<const void> bytes;
      std::int64_t shape[2], strides[2];
    };
    auto* const lent = new Lent{{}, points.bytes, {points.count, width}, {stride / 4, 1}};
    DLTensor& t = lent->managed.tensor;
    const auto* const first = static_cast<const std::uint8_t*>(points.bytes.get()) + offset;
    t.data = const_cast<std::uint8_t*>(first);  // their copy, theirs to write
    t.device = {kCuda, points.gpu};
    t.ndim = width == 1 ? 1 : 2;
    t.dtype = {is_float ? kFloat : kInt, 32, 1};
    t.shape = lent->shape;
    t.strides = lent->strides;
    lent->managed.context = lent;
    lent->managed.deleter = [](DLManagedTensor* m) { delete static_cast<Lent*>(m->context); };
    return py::capsule(&lent->managed, kUnused, [](PyObject* capsule) {
      if (!PyCapsule_IsValid(capsule, kUnused)) return;  // taken: its new owner deletes it
      auto* const m = static_cast<DLManagedTensor*>(PyCapsule_GetPointer(capsule, kUnused));
      m->deleter(m);
    });
  }
};

}  // namespace

void bind_gpu_array(py::module& m) {
  py::class_<GpuArray>(m, "GpuArray",
                       "A field of points in GPU memory: torch.from_dlpack(array), "
                       "jax.dlpack.from_dlpack(array) and\n"
                       "cupy.from_dlpack(array) read it there. It keeps its memory and values.")
      .def_property_readonly("shape", &GpuArray::shape)
      .def(
          "__dlpack__",
          [](const GpuArray& a, const py::object& /*stream*/, const py::kwargs& /*newer ones*/) {
            return a.dlpack();  // written before it is here: no stream has to wait
          },
          py::arg("stream") = py::none())
      .def("__dlpack_device__",
           [](const GpuArray& a) { return py::make_tuple(kCuda, a.points.gpu); });
}

py::dict gpu_arrays(const GpuPoints& points, const PointSelection& selection) {
  py::dict arrays;
  const py::dict fields = point_type(selection).attr("fields");
  for (const auto& field : fields) {
    const auto type_and_offset = py::reinterpret_borrow<py::tuple>(field.second);
    const py::object type = type_and_offset[0];
    GpuArray array{points, type_and_offset[1].cast<std::int64_t>(),
                   static_cast<std::int64_t>(selection.point_size())};
    array.width = type.attr("itemsize").cast<std::int64_t>() / 4;
    array.is_float = py::str(type.attr("base").attr("kind")).cast<std::string>() == "f";
    arrays[field.first] = array;
  }
  return arrays;
}

}  // namespace tissue_sim
