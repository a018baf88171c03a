#include "model.hpp"

namespace adhesis {

ValueAndSlope evaluate_series(const Vector& coefficients, double theta, const Panels& panels) {
  const int terms = int(coefficients.size()) / panels.finest_count;
  double position = theta / panels.width;
  long panel = long(std::floor(position));
  double x = 2 * (position - double(panel)) - 1;
  // the number of panels is a power of two
  const double* c = &coefficients[(panel & (panels.finest_count - 1)) * terms];
  double b1 = 0, b2 = 0, d1 = 0, d2 = 0;
  for (int j = terms - 1; j > 0; --j) {
    double d = 2 * x * d1 + (2 * b1 - d2);
    double b = 2 * x * b1 + (c[j] - b2);
    d2 = d1, d1 = d;
    b2 = b1, b1 = b;
  }
  return {x * b1 - b2 + c[0], (b1 + x * d1 - d2) * 2 / panels.width};
}

WIDE void interpolate(const Vector& coefficients, const double* position, int count,
                      const Panels& panels, double* out) {
  const int terms = int(coefficients.size()) / panels.finest_count;
  const int last = panels.finest_count - 1;
  // four recurrences side by side: each waits for its last term
  for (int first = 0; first < count; first += 4) {
    const double* c[4];
    Four x = {}, a = {}, b = {}, c0 = {};
    const int here = std::min(4, count - first);
    for (int lane = 0; lane < 4; ++lane) {
      double at = position[first + std::min(lane, here - 1)];
      long panel = long(std::floor(at));
      c[lane] = &coefficients[(panel & last) * terms];
      x[lane] = 2 * (at - double(panel)) - 1;
      c0[lane] = c[lane][0];
    }
    for (int j = terms - 1; j > 0; --j) {
      Four term = {c[0][j], c[1][j], c[2][j], c[3][j]};
      Four next = 2 * x * a + (term - b);
      b = a;
      a = next;
    }
    Four value = x * a - b + c0;
    for (int lane = 0; lane < here; ++lane) out[first + lane] = value[lane];
  }
}

ValueAndSlope measure_at(double theta, const Panels& panels) {
  auto [tilt, rate] = evaluate_series(panels.tilt, theta, panels);
  double measure = std::sqrt(1 + tilt * tilt);
  ValueAndSlope length = {measure, tilt / measure * rate};
  if (panels.pattern.empty()) return length;
  auto [share, slope] = evaluate_series(panels.pattern, theta, panels);
  return {length.value * share, length.slope * share + length.value * slope};
}

double length_up_to(double theta, const Panels& panels) {
  const double turns = std::floor(theta / (2 * pi));
  const double position = (theta - turns * 2 * pi) / panels.width;
  const int panel = std::min(std::max(int(position), 0), panels.finest_count - 1);
  const double share = std::min(std::max(position - panel, 0.0), 1.0);
  const LengthRule& rule = panels.length;
  Vector at(rule.nodes), tilt(at.size());
  for (double& node : at) node = panel + share * node;
  interpolate(panels.tilt, at.data(), int(at.size()), panels, tilt.data());
  Vector works(at.size(), 1.0);
  if (!panels.pattern.empty())
    interpolate(panels.pattern, at.data(), int(at.size()), panels, works.data());
  double part = 0;
  for (size_t i = 0; i < at.size(); ++i)
    part += rule.weights[i] * std::sqrt(1 + tilt[i] * tilt[i]) * works[i];
  return turns * rule.before.back() + rule.before[panel] + part * share * panels.width;
}

}  // namespace adhesis
