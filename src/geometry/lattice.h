// Material points on the regular lattice of a body's reference space.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/limits.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// The points of one body. Cells of edge `cell_size` fill a box from `origin` on; cell (i, j, k)
/// has its grid node in its middle and holds 2 x 2 x 2 points, a quarter of the cell size off the
/// node along each axis. Axes are the world's (the body's pose is applied to the shape first).
struct Lattice {
  Vec3 origin = Vec3::Zero();  ///< lowest corner of cell (0, 0, 0) [m]
  double cell_size = 0;        ///< [m]
  int nx = 0, ny = 0, nz = 0;  ///< cells along each axis

  struct Site {
    std::int32_t x, y, z;  ///< in half cells: 0 .. 2 nx - 1 and so on
    float volume;          ///< of the body within this point's half-cell cube [m^3]
  };
  std::vector<Site> sites;  ///< sorted by z, then y, then x; each volume above 0

  /// Void between a site and the next one along an axis, however narrow: what each stands for does
  /// not meet.
  struct Gap {
    std::int32_t site = 0;
    int axis = 0;       ///< 0 x, 1 y, 2 z
    double place = -1;  ///< of its middle, 0 at the site to 1 at the next; below 0: unknown
    Vec3 normal = Vec3::Zero();  ///< to either side, unit
  };
  std::vector<Gap> gaps;  ///< of meshes (geometry/gaps.h), by site
};

/// Fills a body with lattice points; the volume of each is the share of its half-cell cube that the
/// body covers, by exact lengths along x on sub-lines in y and z. Points with less than 1/32 of
/// their cube are dropped and their volume is given to the others in proportion, so that the total
/// volume is the body's. For boxes without rotation the lattice starts at the box's lowest corner;
/// for other shapes it is centred on the bounding box, each edge rounded up to whole half cells.
/// `notes` receives a line for whatever was repaired on the way (a mesh turned inside out, ...) and
/// for a body with fewer than two points across.
/// Throws std::invalid_argument with the reason and what to do: mesh missing, empty, open, of
/// absurd size; body without points at this cell size; more than `max_points` points, or a box of
/// more than 1e9 lines of samples. Throws Stopped where work_limits() asks for it.
Lattice make_lattice(const Body& body, double cell_size, std::vector<std::string>* notes,
                     std::int64_t max_points = work_limits().max_points);

}  // namespace tissue_sim
