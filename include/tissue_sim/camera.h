// Cameras: where they look from, and what they see.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// What the colours of an image tell.
enum class CameraColours {
  kTissue,  ///< wet tissue under a light at the lens, with vessels; what a blade opened is redder
  kFragments,  ///< each piece in its own colour, as in clouds
  kStress,     ///< von Mises stress, dark red at 0 to white at `stress_end`
};

/// How depth images tell depths.
enum class DepthUnit {
  kMetres,       ///< 32FC1, NaN where nothing is seen
  kMillimetres,  ///< 16UC1, 0 where nothing is seen or it is farther than 65.535 m
};

/// A pinhole camera: it looks along its z, its x points right and its y down in the image (REP
/// 103's optical frame). With a baseline it is the left one of two.
struct Camera {
  std::string name = "endoscope";  ///< a ROS name, unique in the scene
  int width = 640, height = 480;   ///< [pixels], 16 to 4096
  double hfov = 60;                ///< angle of view from left to right, 5 to 150 [degrees]
  double rate = 30;                ///< images a second at most [Hz], 0.1 to 1000
  double baseline = 0;           ///< from the left eye to the right one, 0 for one eye [m], 0 to 1
  Pose pose;                     ///< of the left eye, until another one comes
  std::string tf_frame;          ///< follows this frame instead of a topic; empty: it does not
  double near = 0.001, far = 2;  ///< depths that it sees [m], 1e-4 to 100
  bool light = true;             ///< at the lens; false: even light from everywhere
  CameraColours colours = CameraColours::kTissue;
  double stress_end = 10000;  ///< with colours by stress [Pa], 1 to 1e9
  /// Of the raw images, in the order of OpenCV and ROS: k1, k2, p1, p2, k3. None: a pinhole's.
  std::vector<double> distortion;
  DepthUnit depth = DepthUnit::kMetres;  ///< of its depth images; CameraImages have metres
  bool flow = false;                     ///< whether it has images of CameraImages::flow

  double focal_length() const;  ///< [pixels]
};

/// Labels of a pixel: what is seen there.
inline constexpr std::uint16_t kNoLabel = 0;
inline constexpr std::uint16_t kGroundLabel = 1;
inline constexpr std::uint16_t kFirstToolLabel = 2;         ///< of Scene::tools[0], then by one
inline constexpr std::uint16_t kFirstFluidLabel = 800;      ///< FluidPoint::fluid behind it
inline constexpr std::uint16_t kFirstFragmentLabel = 1000;  ///< Fragment::id behind it, up to 65535

/// What one eye sees, row by row from the top. `depth`, `labels` and `flow` are rectified: they
/// have no distortion; `rgb` has the camera's.
struct CameraImages {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;      ///< three bytes a pixel
  std::vector<float> depth;           ///< along the camera's z [m]; NaN where nothing is seen
  std::vector<std::uint16_t> labels;  ///< one a pixel
  /// By how much what is seen there has moved in the image since the last one: two numbers a pixel
  /// [pixels], NaN where nothing is seen, or what was not there before. Empty unless asked for.
  std::vector<float> flow;
  double inside_out = 0;  ///< share of the pixels that see tissue from its inside: above a half the
                          ///< camera is within it
};

}  // namespace tissue_sim
