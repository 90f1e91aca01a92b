// Curves that tests leave behind for scripts/plot_validation: CSV files in the folder that the
// environment variable TISSUE_SIM_CURVES names; nothing is written without it.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <string>

namespace tissue_sim {

class CurveFile {
 public:
  /// `columns`: the header, as in "time [s],energy [J]". A curve without a name is not kept.
  CurveFile(const std::string& name, const std::string& columns) {
    const char* folder = std::getenv("TISSUE_SIM_CURVES");
    if (name.empty() || folder == nullptr || *folder == '\0') return;
    file_ = std::fopen((std::string(folder) + "/" + name + ".csv").c_str(), "w");
    if (file_ != nullptr) std::fprintf(file_, "%s\n", columns.c_str());
  }
  CurveFile(const CurveFile&) = delete;
  CurveFile& operator=(const CurveFile&) = delete;
  ~CurveFile() {
    if (file_ != nullptr) std::fclose(file_);
  }

  void add(std::initializer_list<double> values) {
    if (file_ == nullptr) return;
    const char* separator = "";
    for (const double v : values) {
      std::fprintf(file_, "%s%.9g", separator, v);
      separator = ",";
    }
    std::fprintf(file_, "\n");
  }

 private:
  std::FILE* file_ = nullptr;
};

}  // namespace tissue_sim
