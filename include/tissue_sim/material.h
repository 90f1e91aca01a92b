// Material of a body: plain data, SI units.
#pragma once

#include <string>
#include <vector>

namespace tissue_sim {

/// Hyperelastic law, see src/material/.
enum class Law {
  kFixedCorotated,  ///< Stomakhin et al. 2012, eq. 1: mu ||F - R||^2 + lambda/2 (J - 1)^2
  kNeoHookean,      ///< Smith, de Goes, Kim 2018, without the log term: stays finite when inverted
};

/// What comes out of tissue that a blade or a tear opened.
struct Bleeding {
  double flux = 0;         ///< at first, of opened surface [m^3/s per m^2], 0 to 1; 0: none
  double pressure = 0;     ///< fluid at the wound that has as much stops it [Pa], to 1e5; 0: none
  double clots_after = 0;  ///< it ends evenly in so long a time [s], 0 to 1e5; 0: it never does
  std::string fluid = "blood";  ///< a name in Scene::fluids or a preset
};

/// What a body is made of; laws are isotropic.
struct Material {
  std::string name = "liver";
  Law law = Law::kFixedCorotated;
  double young_modulus = 5000.0;  ///< [Pa], above 0, at most 1e8
  double poisson_ratio = 0.45;    ///< [-], 0 to 0.49
  double density = 1060.0;        ///< [kg/m^3], 100 to 20000
  double viscosity = 0.0;         ///< Kelvin-Voigt shear viscosity [Pa s], 0 to 1000
  /// Largest principal stretch that the tissue bears: past it bonds across that direction break
  /// [-], 1.001 to 100; 0 for tissue that never tears.
  double tear_stretch = 0.0;
  /// How far ahead of its tip a crack must find tissue past tear_stretch to go on [m], 0 to 1: what
  /// a tip bears depends on it, for strain grows without bound towards a tip. 0: 1.5 cells. A scene
  /// file's `tear: measured` works out both, from toughness and cells (docs/cutting.md).
  double tear_length = 0.0;
  /// How far the limit's strain, tear_stretch - 1, varies from point to point: drawn evenly within
  /// this share of it, by Scene::seed and the point's place [-], 0 to 0.9.
  double tear_scatter = 0.0;
  /// What a blade's edge takes for each area that it cuts [J/m^2], 0 to 1e5; 0: it cuts without a
  /// force. docs/cutting.md says what that comes to.
  double toughness = 0.0;
  double friction = 0.3;  ///< Coulomb friction of tissue on tissue [-], 0 to 2; between two
                          ///< materials the geometric mean
  Bleeding bleeding;
};

/// First Lame parameter [Pa].
double lame_lambda(const Material& m);
/// Shear modulus [Pa].
double lame_mu(const Material& m);
/// Speed of pressure waves at rest [m/s]: sqrt((lambda + 2 mu) / density).
double wave_speed(const Material& m);

/// The toughness that was measured of the tissue of that name [J/m^2], 0 where none was: sources in
/// docs/cutting.md.
double measured_toughness(const std::string& preset);

/// The built-in materials (liver, kidney, fat, muscle, skin, vessel, gelatine), with the source of
/// each in src/material/presets.cpp. A scene that defines a material of the same name wins.
const std::vector<Material>& material_presets();

}  // namespace tissue_sim
