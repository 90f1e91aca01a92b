// NumPy's array files, version 1.0: a header and the elements.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tissue_sim {

/// Writes a matrix of `columns` columns, or a vector where it is 0. Throws std::runtime_error where
/// the file cannot be written.
void write_npy(const std::string& path, const std::vector<float>& values, int columns);
void write_npy(const std::string& path, const std::vector<std::uint8_t>& values, int columns);

}  // namespace tissue_sim
