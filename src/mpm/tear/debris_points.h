#pragma once

namespace tissue_sim {

/// A piece that was cut off with at most this many points, a cell's worth, is a bit of debris.
inline constexpr int kDebrisPoints = 8;

}  // namespace tissue_sim
