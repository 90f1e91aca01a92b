// Fluids of a scene: in organs, on the table, from cuts.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// What a fluid is made of; nearly incompressible.
struct Fluid {
  std::string name = "water";
  double density = 1000;     ///< without pressure [kg/m^3]
  double viscosity = 0.001;  ///< dynamic [Pa s]
  /// [Pa]; 0: sixty times the largest pressure that fills and heights ask for. Substeps shorten
  /// with its root.
  double bulk_modulus = 0;
  Vec3 color = Vec3(0.5, 0.7, 0.9);  ///< red, green, blue, 0 to 1
};

/// water, saline, bile, blood; each with its source.
const std::vector<Fluid>& fluid_presets();

/// A particle of fluid as it stands in a cloud: 40 bytes, little endian.
struct FluidPoint {
  float x, y, z;        ///< [m], world frame
  std::uint32_t rgb;    ///< 0x00RRGGBB
  float vx, vy, vz;     ///< [m/s]
  float pressure;       ///< [Pa]
  std::uint32_t fluid;  ///< Scene::fluids
  std::uint32_t id;     ///< of the particle, for ever
};
static_assert(sizeof(FluidPoint) == 40, "the layout that read_fluid() and PointCloud2 promise");

/// What a hollow that is filled is told to do, from the next frame on.
struct FluidOrder {
  std::int32_t body = 0;
  double pressure = 0;  ///< takes fluid in until its mean pressure was once so high [Pa]; 0: none
  double drain = 0;     ///< gives up so much of what is in it, or all, within half a second [m^3]
};

/// How much there is of one fluid [m^3], without the pressure that squeezes it.
struct FluidVolume {
  double total = 0;
  std::vector<double> inside;  ///< of each body's hollow, as of the scene's bodies
  double spilt = 0;            ///< the rest of the total
  double lost = 0;             ///< what fell out of the world, not in the total
  double pressure = 0;         ///< mean, over its volume [Pa]
  // Since the start.
  double sucked = 0, drained = 0;  ///< not in the total either
  double bled = 0, irrigated = 0;  ///< what of the total came from wounds and from tubes
  double bleeding = 0;             ///< from wounds in the last frame [m^3/s]
};

}  // namespace tissue_sim
