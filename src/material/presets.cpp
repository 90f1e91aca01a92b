// Built-in materials. Values are small-strain stiffnesses of healthy tissue; real tissue stiffens
// with strain, relaxes and differs between subjects by a factor of two and more.
//
// Where a source gives a shear modulus, E = 3 mu. Common to all presets, and choices rather than
// measurements: Poisson's ratio 0.45 (soft tissue is nearer 0.5; 0.45 keeps substeps long),
// friction 0.3.
//
// Viscosity, 1 Pa s of organs and 2 of gelatine, is chosen so that a body of some centimetres that
// was let go comes to rest within three seconds, at little cost in substeps (docs/experiments.md):
// of a mode of wave number k it takes exp(-eta k^2 t / (2 rho)), whatever the stiffness, and
// nothing of free fall and of rigid turning. Shear waves of some hundred hertz give as much: 0.6
// to 1.1 Pa s in gelatine of 3 % without and with oil (Nguyen et al., Ultrasound Med. Biol. 40:168,
// 2014).
//
// Densities, unless stated: table 3 of Mech. Mater. 44:174 (2012),
// doi:10.1016/j.mechmat.2011.08.007, collected there from Goss et al., Mast and others.
#include <cmath>
#include <utility>

#include "tissue_sim/material.h"

namespace tissue_sim {
namespace {

Material preset(const char* name, double young_modulus, double density, double viscosity = 1) {
  Material m;
  m.name = name;
  m.young_modulus = young_modulus;
  m.poisson_ratio = 0.45;
  m.density = density;
  m.viscosity = viscosity;
  return m;
}

}  // namespace

double lame_lambda(const Material& m) {
  return m.young_modulus * m.poisson_ratio / ((1 + m.poisson_ratio) * (1 - 2 * m.poisson_ratio));
}

double lame_mu(const Material& m) { return m.young_modulus / (2 * (1 + m.poisson_ratio)); }

double wave_speed(const Material& m) {
  return std::sqrt((lame_lambda(m) + 2 * lame_mu(m)) / m.density);
}

double measured_toughness(const std::string& preset) {
  static const std::vector<std::pair<std::string, double>> measured = {
      // Porcine liver, blade: 187 to 225; bovine liver, needles: 164 +- 6 (Gokgol et al., Appl.
      // Bionics Biomech. 9:27, 2012).
      {"liver", 206},  {"fat", 4100},
      {"muscle", 550},  // the least: up to 8000 by direction and method
      {"skin", 2800},   // chicken, scissors; rat: 1700
      {"vessel", 290},  // aorta
  };
  for (const auto& [name, toughness] : measured) {
    if (name == preset) return toughness;
  }
  return 0;
}

const std::vector<Material>& material_presets() {
  static const std::vector<Material> presets = {
      // Human liver in vivo, acoustic radiation force: mu about 1.8 kPa in healthy subjects, so E
      // about 5.4 kPa, rounded down (Palmeri et al., Ultrasound Med. Biol. 34:546, 2008).
      preset("liver", 5e3, 1060),
      // Human renal cortex in vivo, shear-wave elastography: 5.0 +- 2.9 kPa (Arda et al., AJR
      // 197:532, 2011). The capsule and the renal pelvis (23.6 kPa there) are stiffer.
      preset("kidney", 5e3, 1050),
      // Breast fat ex vivo, indentation: 3.25 +- 0.91 kPa (Samani et al., Phys. Med. Biol. 52:1565,
      // 2007).
      preset("fat", 3.25e3, 950),
      // Human gastrocnemius at rest in vivo, shear-wave elastography: 11.1 +- 4.1 kPa (Arda et al.
      // 2011). Across and along the fibres differ; a contracted muscle is many times stiffer.
      preset("muscle", 11.1e3, 1050),
      // Human forearm skin in vivo, torsion, below 30 years: 0.42 MPa (Agache et al., Arch.
      // Dermatol. Res. 269:221, 1980). Other methods differ by an order of magnitude.
      preset("skin", 420e3, 1090),
      // Wall of the canine thoracic aorta, incremental modulus at 100 mmHg: about 0.43 MPa (Bergel,
      // J. Physiol. 156:445, 1961), as an order of magnitude for arteries; softer when unloaded.
      // Density: 1050 as is usual for arterial wall.
      preset("vessel", 430e3, 1050),
      // Gelatine phantom, one part powder to ten of water, from the power law between 4.34 kPa at
      // 20:1 and 277 kPa at 2:1 (Bonavia, arXiv:2512.20502, 2025, instantaneous stiffness): 15 kPa.
      // Density: that of the mixture, gelatine at about 1.35 g/mL.
      preset("gelatine", 15e3, 1020, 2),
  };
  return presets;
}

}  // namespace tissue_sim
