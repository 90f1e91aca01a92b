// Newton's method for balanced weights. Its linear systems are J S J^T, J the derivative of what is
// out of balance by the weights and S the weights themselves; they are solved by conjugate
// gradients, applied node by node, and sums run in a fixed order: the same bits on any number of
// threads.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "compute/simd.h"
#include "mls/pairs.h"

namespace tissue_sim {
namespace {

using Vector = Vec<4>;  // (x, y, z, 0)
using Vectors = Array<Vector>;

/// By columns.
struct Matrix {
  Vector column[3] = {};
};

inline Vector times(const Matrix& m, Vector v) {
  return m.column[0] * v[0] + m.column[1] * v[1] + m.column[2] * v[2];
}
inline float dot(Vector a, Vector b) {
  const Vector p = a * b;
  return p[0] + p[1] + p[2];
}
inline Vector sum_times(const Matrix& a, const Matrix& b, Vector v) {  // (a + b) v
  return (a.column[0] + b.column[0]) * v[0] + (a.column[1] + b.column[1]) * v[1] +
         (a.column[2] + b.column[2]) * v[2];
}
inline void add_product(Matrix& m, Vector a, Vector b) {  // m += a b^T
  for (int k = 0; k < 3; ++k) m.column[k] += a * b[k];
}
/// scale * a m a for a symmetric a.
inline Matrix between(float scale, const Matrix& a, const Matrix& m) {
  Matrix result;
  for (int k = 0; k < 3; ++k) result.column[k] = scale * times(a, times(m, a.column[k]));
  return result;
}

constexpr int kSteps = 12;            // of Newton's method, at most
constexpr int kIterations = 60;       // of conjugate gradients, at most
constexpr float kEnough = 1e-5f;      // out of balance, relative
constexpr float kReduction = 0.05f;   // of the residual by conjugate gradients
constexpr float kLargestStep = 1;     // of the logarithm of a weight
constexpr float kMostChange = 32;     // of a weight, up or down from the kernel's
constexpr double kMostOutside = 0.5;  // share of a node's volume beyond it
constexpr int kGrain = 256;

/// In units of the mean support, so that single precision does.
class Balance {
 public:
  Balance(const MlsNodes& nodes, bool lattice, Cpu& cpu, MlsPairs& pairs)
      : cpu_(cpu), pairs_(pairs), n_(nodes.count()), weight_(pairs.whole), r_(weight_.size()) {
    double support = 0, volume = 0;
    for (std::int32_t i = 0; i < n_; ++i) {
      support += pairs.support[i] / n_;
      volume += nodes.volume[i] / n_;
    }
    for (std::int32_t i = 0; i < n_; ++i) {
      volume_.push_back(static_cast<float>(nodes.strained_volume[i] / volume));
      free_.push_back(nodes.surface[i] == 0 && nodes.anchored[i] == 0 ? 1.0f : 0.0f);
      const Vec3& n = nodes.normal[i];
      const double outside = nodes.depth[i] / std::cbrt(static_cast<double>(nodes.volume[i]));
      outward_.push_back(Vector{float(n[0]), float(n[1]), float(n[2]), 0});
      outside_.push_back(
          lattice && !n.isZero() ? static_cast<float>(std::min(outside, kMostOutside)) : 0.0f);
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        const Vec3 r = (nodes.place[pairs.other[e]] - nodes.place[i]) / support;
        r_[e] = Vector{float(r[0]), float(r[1]), float(r[2]), 0};
      }
    }
    g_.resize(r_.size());
    step_.resize(r_.size());
    normal_.resize(n_);
    inverse_.resize(n_);
    across_.resize(n_);
    change_.resize(n_);
  }

  double run() {
    float left = prepare(), before = INFINITY, last = INFINITY;
    for (int step = 0; step < kSteps && left > kEnough && left < 0.5f * before; ++step) {
      before = std::exchange(last, left);
      times_transpose(solve());
      for_each_entry([&](std::int32_t, std::int32_t e) {
        const float kernel = pairs_.whole[e];
        weight_[e] *= std::exp(std::min(kLargestStep, std::max(-kLargestStep, step_[e])));
        weight_[e] = std::min(kMostChange * kernel, std::max(kernel / kMostChange, weight_[e]));
      });
      left = prepare();
    }
    pairs_.whole = weight_;
    pairs_.weight = weight_;
    return left;
  }

 private:
  template <class F>
  void for_each_node(const F& f) {
    cpu_.for_each(n_, f, kGrain);
  }
  template <class F>
  void for_each_entry(const F& f) {
    for_each_node([&](int i) {
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) f(i, e);
    });
  }

  /// N_i and what is out of balance, with these weights; the largest of it, relative.
  float prepare() {
    for_each_node([&](int i) {
      Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 r(r_[e][0], r_[e][1], r_[e][2]);
        moment += static_cast<double>(weight_[e]) * r * r.transpose();
      }
      Eigen::Matrix3d inverse = moment.inverse();
      if (!inverse.allFinite()) {  // a support that spans no space: left as it is
        inverse.setZero();
        free_[i] = 0;
      }
      for (int k = 0; k < 3; ++k) {
        inverse_[i].column[k] =
            Vector{float(inverse(0, k)), float(inverse(1, k)), float(inverse(2, k)), 0};
      }
      if (outside_[i] > 0) {
        const Vector across = times(inverse_[i], outward_[i]);
        const float square = dot(outward_[i], across);
        across_[i] = {};
        if (square > 0) add_product(across_[i], across * (1 / square), across);
        for (int k = 0; k < 3; ++k) {
          inverse_[i].column[k] -= outside_[i] * across_[i].column[k];
        }
      }
      for (int k = 0; k < 3; ++k) normal_[i].column[k] = volume_[i] * inverse_[i].column[k];
    });
    for_each_entry([&](std::int32_t i, std::int32_t e) {
      g_[e] = sum_times(normal_[i], normal_[pairs_.other[e]], r_[e]);
    });
    residual_.assign(n_, Vector{});
    diagonal_.assign(n_, 1.0f);
    std::vector<float> relative(n_, 0.0f);
    for_each_node([&](int i) {
      if (free_[i] == 0) return;
      float lengths = 0, diagonal = 0;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const float g2 = dot(g_[e], g_[e]);
        residual_[i] += weight_[e] * g_[e];
        lengths += weight_[e] * std::sqrt(g2);
        diagonal += weight_[e] * g2;
      }
      if (lengths == 0) return;
      diagonal_[i] = diagonal;
      relative[i] = std::sqrt(dot(residual_[i], residual_[i])) / lengths;
    });
    return n_ == 0 ? 0 : *std::max_element(relative.begin(), relative.end());
  }

  /// What N falls by where the moment grows by `moment`.
  Matrix change_of(std::int32_t i, const Matrix& moment) const {
    Matrix change = between(volume_[i], inverse_[i], moment);
    const float f = outside_[i];
    if (f > 0) {
      const Matrix more = between(volume_[i] * f * (1 - f), across_[i], moment);
      for (int k = 0; k < 3; ++k) change.column[k] += more.column[k];
    }
    return change;
  }

  /// step_ = J^T lambda, of each weight's logarithm.
  void times_transpose(const Vectors& lambda) {
    for_each_node([&](int i) {
      Matrix y;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        add_product(y, weight_[e] * (lambda[i] - lambda[pairs_.other[e]]), r_[e]);
      }
      change_[i] = change_of(i, y);
    });
    for_each_entry([&](std::int32_t i, std::int32_t e) {
      const std::int32_t j = pairs_.other[e];
      step_[e] =
          dot(g_[e], lambda[i] - lambda[j]) - dot(r_[e], sum_times(change_[i], change_[j], r_[e]));
    });
  }

  /// out = J (w step_), 0 at nodes that are not free.
  void times_weights(Vectors& out) {
    for_each_node([&](int i) {
      Matrix moment;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        add_product(moment, weight_[e] * step_[e] * r_[e], r_[e]);
      }
      change_[i] = change_of(i, moment);
    });
    for_each_node([&](int i) {
      Vector sum{};
      if (free_[i] != 0) {
        for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
          sum += weight_[e] *
                 (step_[e] * g_[e] - sum_times(change_[i], change_[pairs_.other[e]], r_[e]));
        }
      }
      out[i] = sum;
    });
  }

  double product(const Vectors& a, const Vectors& b) const {
    double sum = 0;
    for (std::int32_t i = 0; i < n_; ++i) sum += dot(a[i], b[i]);
    return sum;
  }

  /// J S J^T lambda = -residual.
  Vectors solve() {
    Vectors x(n_, Vector{}), rest(n_), z(n_), p(n_), q(n_);
    for (std::int32_t i = 0; i < n_; ++i) rest[i] = -residual_[i];
    const auto precondition = [&] {
      for (std::int32_t i = 0; i < n_; ++i) z[i] = rest[i] * (free_[i] / diagonal_[i]);
    };
    precondition();
    p = z;
    double rz = product(rest, z);
    const double enough = kReduction * kReduction * rz;
    for (int k = 0; k < kIterations && rz > enough && rz > 0; ++k) {
      times_transpose(p);
      times_weights(q);
      const double curvature = product(p, q);
      if (!(curvature > 0)) break;
      const auto alpha = static_cast<float>(rz / curvature);
      for (std::int32_t i = 0; i < n_; ++i) {
        x[i] += alpha * p[i];
        rest[i] -= alpha * q[i];
      }
      precondition();
      const double next = product(rest, z);
      for (std::int32_t i = 0; i < n_; ++i) p[i] = z[i] + static_cast<float>(next / rz) * p[i];
      rz = next;
    }
    return x;
  }

  Cpu& cpu_;
  MlsPairs& pairs_;
  const std::int32_t n_;
  Array<float> weight_;
  Vectors r_, g_;                     // of each entry
  std::vector<float> step_;           // of each entry
  std::vector<float> volume_, free_;  // of each node, as all below; free_: 1 or 0
  std::vector<float> outside_;        // share of the volume beyond the node
  Vectors outward_;
  Array<Matrix> normal_, inverse_, change_;  // inverse_ without outside_ of across_
  Array<Matrix> across_;                     // M^-1 n n^T M^-1 / n^T M^-1 n
  std::vector<float> diagonal_;
  Vectors residual_;
};

}  // namespace

double balance(const MlsNodes& nodes, bool lattice, Cpu& cpu, MlsPairs& pairs) {
  return Balance(nodes, lattice, cpu, pairs).run();
}

}  // namespace tissue_sim
