#include "programs/dataset/npy.h"

#include <cstddef>
#include <fstream>
#include <stdexcept>

namespace tissue_sim {
namespace {

template <class T>
void write(const std::string& path, const char* type, const std::vector<T>& values, int columns) {
  const std::size_t rows = columns > 0 ? values.size() / columns : values.size();
  std::string header = std::string("{'descr': '") + type + "', 'fortran_order': False, 'shape': (" +
                       std::to_string(rows) + "," +
                       (columns > 0 ? " " + std::to_string(columns) : "") + "), }";
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::ofstream file(path, std::ios::binary);
  file.write("\x93NUMPY\x01\x00", 8);
  const char length[2] = {static_cast<char>(header.size() & 255),
                          static_cast<char>(header.size() >> 8)};
  file.write(length, 2);
  file << header;
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(T)));
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written: is there room on the disk?");
}

}  // namespace

void write_npy(const std::string& path, const std::vector<float>& values, int columns) {
  write(path, "<f4", values, columns);
}
void write_npy(const std::string& path, const std::vector<std::uint8_t>& values, int columns) {
  write(path, "|u1", values, columns);
}

}  // namespace tissue_sim
