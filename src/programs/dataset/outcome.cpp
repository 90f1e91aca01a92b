#include "programs/dataset/outcome.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <sstream>
#include <stdexcept>

namespace tissue_sim {
namespace {

/// What points of a piece add up to.
struct RigidSums {
  double mass = 0;  // volume: all points of a scene are of one material
  Vec3 x = Vec3::Zero(), v = Vec3::Zero(), x_v = Vec3::Zero();
  Eigen::Matrix3d x_x = Eigen::Matrix3d::Zero();

  double speed() const { return v.norm() / mass; }
  /// A point is a cube of edge h: a single one, too, may spin.
  double spin(double h) const {
    const Vec3 centre = x / mass, angular = x_v - centre.cross(v);
    const Eigen::Matrix3d second =
        x_x - mass * centre * centre.transpose() + mass * h * h / 12 * Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
    return inertia.ldlt().solve(angular).norm();
  }
};

struct PointMotion {
  Vec3 x, v;
};

PointMotion point_motion(const MpmState& s, std::int32_t p) {
  const Points::Site& site = s.points.site[p];
  const LatticeBody& body = s.bodies[site.body];
  PointMotion m{body.site_position(site.x, site.y, site.z), Vec3::Zero()};
  for (int k = 0; k < 27; ++k) {
    const int n = s.fields->node(body, site, k);
    const double w = site_weight(site, k);
    m.x += w * Vec3(s.nodes.u[0][n], s.nodes.u[1][n], s.nodes.u[2][n]);
    m.v += w * Vec3(s.nodes.v[0][n], s.nodes.v[1][n], s.nodes.v[2][n]);
  }
  return m;
}

/// The sums of each fragment, by id; those of others are left empty.
std::vector<RigidSums> fragment_sums(const MpmTissue& tissue, const MpmState& s,
                                     const std::vector<std::uint8_t>& fragment) {
  std::vector<RigidSums> sums(fragment.size());
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    const int id = tissue.fragment_of(p);
    if (fragment[id] == 0) continue;
    const PointMotion m = point_motion(s, p);
    const double mass = s.points.volume[p];
    RigidSums& sum = sums[id];
    sum.mass += mass;
    sum.x += mass * m.x;
    sum.v += mass * m.v;
    sum.x_v += mass * m.x.cross(m.v);
    sum.x_x += mass * m.x * m.x.transpose();
  }
  return sums;
}

}  // namespace

std::vector<RunKind> compared_runs(const ComparedRuns& of) {
  const std::string& baselines = of.baselines;
  std::vector<double> line;
  double threshold = 0, line_threshold = 0.5;
  try {
    const YAML::Node file = YAML::LoadFile(baselines);
    line = file["logistic"].as<std::vector<double>>();
    threshold = file["stretch_threshold"].as<double>();
    line_threshold = file["logistic_threshold"].as<double>();
  } catch (const YAML::Exception& e) {
    throw std::invalid_argument(baselines + ": is not what scripts/train_fragments --baselines " +
                                "writes: " + e.what());
  }
  if (line.size() != kPartingFeatureCount + 1) {
    throw std::invalid_argument(baselines + ": logistic must be " +
                                std::to_string(kPartingFeatureCount + 1) + " numbers");
  }
  const auto stretch = [=](const MpmState&, std::int32_t, const float* x) {
    return x[parting::kExcess] >= threshold ? 1.0f : 0.0f;
  };
  const auto logistic = [=](const MpmState&, std::int32_t, const float* x) {
    double sum = line[kPartingFeatureCount];
    for (int i = 0; i < kPartingFeatureCount; ++i) sum += line[i] * x[i];
    return 1 / (1 + std::exp(-sum)) >= line_threshold ? 1.0f : 0.0f;
  };
  return {{"plain", 1, "", {}},
          {"stretch", 1, of.network, stretch},
          {"logistic", 1, of.network, logistic},
          {"network", 1, of.network, {}},
          {"finer", 2, "", {}},
          {"truth", 1.0 * of.level, "", {}},
          {"truth2", 0.96 * of.level, "", {}},
          {"truth3", 1.04 * of.level, "", {}}};
}

Outcome run_outcome(const DatasetScene& scene, const RunKind& kind, int frames) {
  Outcome o;
  const double h = scene.scene.cell_size;
  DatasetScene run = scene;
  if (!kind.network.empty()) run.scene.fragment_network = kind.network;
  const auto tissue = begin_run(run, kind.level);
  const std::clock_t begin = std::clock();  // a network's file is read once, however long it runs
  double measuring = 0;                     // [s]
  if (kind.classifier) tissue->foresight().classifier = kind.classifier;
  MpmState& s = tissue->state();
  o.points = tissue->point_count();
  const bool held = scene.scene.ground.enabled || !scene.scene.bodies[0].anchors.empty();
  const Momentum first = tissue->momentum();
  double kinetic = 0;
  for (std::size_t n = 0; n < s.nodes.size(); ++n) {
    for (const Array<float>& v : s.nodes.v) kinetic += 0.5 * s.nodes.mass[n] * v[n] * v[n];
  }
  const double speed = std::sqrt(2 * kinetic / first.mass),
               extent = std::cbrt(first.mass / scene.scene.materials[0].density);
  for (int frame = 0; frame < frames; ++frame) {
    FrameResult result;
    const bool goes_on = advance_frame(*tissue, scene, frame, &result);
    if (!goes_on) {
      o.blew_up = true;
      break;
    }
    o.expected += result.fragment_points;
    const std::clock_t paused = std::clock();
    const std::vector<std::uint8_t> fragment = fragments_of(*tissue, h);
    const std::vector<RigidSums> sums = fragment_sums(*tissue, s, fragment);
    double all = 0;
    for (const Fragment& f : tissue->pieces().all) all += f.volume;
    o.sizes.clear();
    for (const RigidSums& sum : sums) {
      if (sum.mass == 0) continue;
      o.sizes.push_back(sum.mass / all);
      o.peak_speed = std::max(o.peak_speed, sum.speed());
      o.peak_spin = std::max(o.peak_spin, sum.spin(0.5 * h / kind.level));
    }
    std::sort(o.sizes.rbegin(), o.sizes.rend());
    if (!o.sizes.empty() && o.first_time < 0) o.first_time = (frame + 1) / scene.scene.frame_rate;
    if (!held) {
      const Momentum now = tissue->momentum();
      const double scale = first.mass * speed;
      o.momentum_drift = std::max(o.momentum_drift, (now.linear - first.linear).norm() / scale);
      o.angular_drift =
          std::max(o.angular_drift, (now.angular - first.angular).norm() / (scale * extent));
      o.energy_rise =
          std::max(o.energy_rise, (result.kinetic_energy + result.elastic_energy) / kinetic - 1);
    }
    if (frame + 1 == frames) {
      for (std::int32_t p = 0; p < s.points.size(); ++p) {
        const Vec3 x = point_motion(s, p).x;
        for (int a = 0; a < 3; ++a) o.cloud.push_back(static_cast<float>(x[a]));
        const int id = tissue->fragment_of(p);
        o.cloud.push_back(static_cast<float>(fragment[id] != 0 ? id + 1 : 0));
      }
    }
    measuring += static_cast<double>(std::clock() - paused) / CLOCKS_PER_SEC;
  }
  o.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC - measuring;
  return o;
}

const char* const kOutcomeColumns =
    "scene,kind,method,level,points,seconds,expected,first_time,peak_speed,peak_spin,momentum_"
    "drift,"
    "angular_drift,energy_rise,blew_up,sizes\n";

std::string outcome_line(const DatasetScene& scene, const RunKind& kind, const Outcome& o) {
  std::ostringstream out;
  out.precision(7);
  out << scene.index << ',' << scene.kind << ',' << kind.name << ',' << kind.level << ','
      << o.points << ',' << o.seconds << ',' << o.expected << ',' << o.first_time << ','
      << o.peak_speed << ',' << o.peak_spin << ',' << o.momentum_drift << ',' << o.angular_drift
      << ',' << o.energy_rise << ',' << o.blew_up << ',';
  for (std::size_t i = 0; i < o.sizes.size(); ++i) out << (i > 0 ? " " : "") << o.sizes[i];
  out << '\n';
  return out.str();
}

}  // namespace tissue_sim
