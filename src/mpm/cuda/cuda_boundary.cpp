// The surface of tissue that lives on a GPU: shown on the host, pressed on where it is.
#include "mpm/cuda/on_device.h"
#include "mpm/state_figures.h"

namespace tissue_sim {
namespace {

/// Puts the vertices where nodes have them.
void place_vertices(CudaTissue& d) {
  const BoundaryMesh& mesh = d.state.boundary;
  BoundaryOnGpu& on = d.boundary;
  if (on.made != mesh.made) {
    on.vertices.upload(mesh.vertices, d.stream);
    std::vector<int4> faces;
    for (const BoundaryMesh::Face& f : mesh.faces) {
      faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2], f.vertex[3]});
    }
    on.faces.upload(faces, d.stream);
    on.places.resize(3 * mesh.vertices.size());
    on.corners.resize(18 * mesh.faces.size());
    check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  }
  on.made = mesh.made;
  launch_boundary_places(d.present(), on.vertices.data(), static_cast<int>(on.vertices.size()),
                         on.places.data(), d.stream);
}

}  // namespace

void CudaTissue::place_boundary() {
  place_vertices(*this);
  const std::size_t count = boundary.places.size();
  boundary.host_places.resize(count);
  boundary.places.download(boundary.host_places.data(), count, stream);
  check_cuda(cudaStreamSynchronize(stream), "send data");
  const float* now = boundary.host_places.data();
  tissue_sim::place_boundary(state, [now](int i) {
    return std::array<float, 3>{now[3 * i], now[3 * i + 1], now[3 * i + 2]};
  });
}

GpuSurface CudaTissue::place_boundary_on_gpu() {
  place_vertices(*this);
  launch_boundary_corners(boundary, stream);
  check_cuda(cudaStreamSynchronize(stream), "place a surface");
  return {boundary.corners.data(), static_cast<int>(2 * boundary.faces.size())};
}

void CudaTissue::push_boundary_on_gpu(const float* impulses) {
  const BoundaryMesh::Support& support = state.boundary.support;
  BoundaryOnGpu& on = boundary;
  if (on.support_made != support.made) {
    on.corner_begin.upload(support.corner_begin, stream);
    on.corner.upload(support.corner, stream);
    on.node.upload(support.node, stream);
    on.begin.upload(support.begin, stream);
    on.vertex.upload(support.vertex, stream);
    on.share.upload(support.share, stream);
    on.weak.upload(support.weak, stream);
    on.weak_of.upload(support.weak_of, stream);
    on.around.upload(support.around, stream);
    on.pushed.resize(3 * on.vertices.size());
    for (auto* of : {&on.left, &on.next}) of->resize(3 * support.weak.size());
  }
  on.support_made = support.made;
  launch_push_boundary(on, impulses, present(), nodes(1 - current), stream);
}

}  // namespace tissue_sim
