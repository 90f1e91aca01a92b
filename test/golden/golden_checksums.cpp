// Prints what each frame of eight scenes comes to, to the last bit: two builds that do the same
// print the same. scripts/compare_goldens compares two of them. Through the public API alone, so
// that it can be built against any version of the core.
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string>
#include <type_traits>
#include <vector>

#include "golden/golden_scenes.h"

namespace tissue_sim {
namespace {

constexpr char kUsage[] =
    "usage: tissue_sim_golden [--device cpu|cuda] [--threads N] [--scene NAME]\n"
    "                         [--method mpm|mls|pbd|tetrahedra] [--frames N] [--state | --what]\n"
    "Prints `scene frame checksum figures cloud` for each frame: hashes of the state, of the "
    "frame's\n"
    "loads, reports and energies, and of the points and pieces as they are read.\n"
    "  --state  prints `scene id x y z` of each point after ten frames instead [m]\n"
    "  --what   prints what happens in each scene instead\n"
    "  --frames N   ends each scene after N frames at the latest\n"
    "The instruction set is TISSUE_SIM_INSTRUCTION_SET's (sse2, avx2, avx512).\n";
constexpr int kStateFrames = 10;

/// 64-bit FNV-1a over values, one by one: structs have gaps.
class Hash {
 public:
  template <class T>
  void add(T value) {
    static_assert(std::is_arithmetic<T>::value, "a struct may have gaps");
    add_bytes(&value, sizeof(T));
  }
  void add(const Vec3& v) {
    for (int a = 0; a < 3; ++a) add(v[a]);
  }
  void add_bytes(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 1099511628211ull;
  }
  unsigned long long value() const { return value_; }

 private:
  unsigned long long value_ = 14695981039346656037ull;
};

unsigned long long figures(const FrameResult& r) {
  Hash h;
  for (const ToolLoad& l : r.loads) {
    h.add(l.mean.force);
    h.add(l.mean.torque);
    h.add(l.peak_force);
    h.add(l.grip);
    h.add(l.grip_area);
  }
  const auto add = [&h](const CutReport& c) {
    h.add(c.bonds_broken);
    h.add(c.points_separated);
    for (const int id : c.new_fragments) h.add(id);
  };
  for (const CutReport& c : r.cut_reports) add(c);
  add(r.blade_report);
  add(r.tear_report);
  h.add(r.substeps);
  h.add(r.substep);
  h.add(r.kinetic_energy);
  h.add(r.elastic_energy);
  h.add(r.max_speed);
  h.add(r.blew_up);
  return h.value();
}

std::vector<std::uint8_t> cloud_of(Tissue& tissue) {
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  return cloud;
}

unsigned long long cloud(Tissue& tissue) {
  Hash h;
  const std::vector<std::uint8_t> points = cloud_of(tissue);
  h.add_bytes(points.data(), points.size());
  for (const Fragment& f : tissue.fragments()) {
    for (const int i : {f.id, f.parent, f.body, static_cast<int>(f.loose), f.point_count}) h.add(i);
    h.add(f.volume);
    for (const Vec3& v : {f.centroid, f.velocity, f.box.min, f.box.max}) h.add(v);
  }
  return h.value();
}

/// What happened in a scene until now, for people.
struct Happened {
  long cut = 0, blade = 0, torn = 0, substeps = 0;  ///< broken bonds but for the last
  double force = 0, grip = 0;                       ///< largest [N]

  void add(const FrameResult& r) {
    for (const CutReport& c : r.cut_reports) cut += c.bonds_broken;
    blade += r.blade_report.bonds_broken;
    torn += r.tear_report.bonds_broken;
    substeps += r.substeps;
    for (const ToolLoad& l : r.loads) {
      force = std::max(force, l.peak_force);
      grip = std::max(grip, l.grip);
    }
  }
};

enum class Print { kChecksums, kState, kWhat };

void run(const GoldenScene& golden, const Scene& scene, int most, Print print) {
  Simulation simulation(scene);
  Happened happened;
  const char* name = golden.name.c_str();
  const int frames = std::min(most, print == Print::kState ? kStateFrames : golden.frames);
  for (int frame = 0; frame < frames; ++frame) {
    golden.before(simulation, frame);
    const FrameResult result = simulation.advance_frame().result;
    happened.add(result);
    if (print != Print::kChecksums) continue;
    const auto state = static_cast<unsigned long long>(simulation.tissue().checksum());
    std::printf("%s %d %016llx %016llx %016llx\n", name, frame, state, figures(result),
                cloud(simulation.tissue()));
    std::fflush(stdout);
  }
  if (print == Print::kState) {
    const std::vector<std::uint8_t> points = cloud_of(simulation.tissue());
    for (std::size_t i = 0; i < points.size(); i += sizeof(Point)) {
      Point p;
      std::memcpy(&p, &points[i], sizeof(Point));
      std::printf("%s %u %.9g %.9g %.9g\n", name, p.id, p.x, p.y, p.z);
    }
  } else if (print == Print::kWhat) {
    int debris = 0, pieces = 0;
    for (const Fragment& f : simulation.tissue().fragments()) {
      ++pieces;
      debris += f.point_count <= 8 ? 1 : 0;
    }
    std::printf(
        "%s: %d points, %d frames, %ld substeps; bonds broken by cuts %ld, blades %ld, tears %ld; "
        "%d pieces, %d of at most 8 points; largest force %.3g N, grip %.3g N; on %s\n",
        name, simulation.tissue().point_count(), frames, happened.substeps, happened.cut,
        happened.blade, happened.torn, pieces, debris, happened.force, happened.grip,
        simulation.tissue().device_name().c_str());
  }
}

/// False: there is no method of this name. The scenes' own is mpm.
bool set_method(Scene& scene, const std::string& name) {
  if (name == "tetrahedra") scene.pbd.model = PbdModel::kTetrahedra;
  const std::vector<std::pair<std::string, Method>> methods = {{"mpm", Method::kMpm},
                                                               {"mls", Method::kMls},
                                                               {"pbd", Method::kPbd},
                                                               {"tetrahedra", Method::kPbd}};
  for (const auto& m : methods) {
    if (m.first != name) continue;
    scene.method = m.second;
    return true;
  }
  return false;
}

int run_all(const std::vector<std::string>& arguments) {
  Device device = Device::kCpu;
  int threads = 1, most = INT_MAX;
  std::string only, method = "mpm";
  Scene unused;
  Print print = Print::kChecksums;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& option = arguments[i];
    if (option == "--state" || option == "--what") {
      print = option == "--state" ? Print::kState : Print::kWhat;
      continue;
    }
    const std::string value = i + 1 < arguments.size() ? arguments[++i] : "";
    if (option == "--device" && (value == "cpu" || value == "cuda")) {
      device = value == "cpu" ? Device::kCpu : Device::kCuda;
    } else if (option == "--threads" && std::atoi(value.c_str()) > 0) {
      threads = std::atoi(value.c_str());
    } else if (option == "--scene" && !value.empty()) {
      only = value;
    } else if (option == "--method" && set_method(unused, value)) {
      method = value;
    } else if (option == "--frames" && std::atoi(value.c_str()) > 0) {
      most = std::atoi(value.c_str());
    } else {
      std::fputs(kUsage, stderr);
      return 2;
    }
  }
  const TemporaryFolder folder;
  bool found = false;
  for (const GoldenScene& golden : golden_scenes(folder)) {
    if (!only.empty() && golden.name != only) continue;
    found = true;
    Scene scene = golden.scene;
    scene.device = device;
    scene.threads = threads;
    set_method(scene, method);
    run(golden, scene, most, print);
  }
  if (!found) std::fprintf(stderr, "there is no scene '%s'\n", only.c_str());
  return found ? 0 : 2;
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  try {
    return tissue_sim::run_all({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
