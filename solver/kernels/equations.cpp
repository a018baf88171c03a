#include "equations.hpp"

namespace adhesis {

namespace {

// Below these arguments the own gap's kernels are taken as series.
constexpr double periodic_series = 0.2;
constexpr double mapped_series = 0.3;

// Subtract the first modes of a gap from the loads of its ends.
EndTerms subtract_modes(const Vector& s, int modes, int fields, const EndTerms& ends) {
  EndTerms out = {};
  for (int field = 0; field < fields; ++field) {
    double low = 0, high = 0, sign = 1;
    for (int n = 0; n < modes; ++n) {
      high += s[field * modes + n];
      low += sign * s[field * modes + n];
      sign = -sign;
    }
    out[0][field] = ends[0][field] - low;
    out[1][field] = ends[1][field] - high;
  }
  return out;
}

void fill_nodes(int k, const GaussRule& rule, Nodes& nodes) {
  const Gap& gap = nodes.gaps[k];
  nodes.slope[k] = {1 / theta_at(gap, -1).stretch, 1 / theta_at(gap, 1).stretch};
  for (int i = 0; i < rule.count; ++i) {
    const int node = nodes.offset[k] + i;
    auto [theta, stretch] = theta_at(gap, rule.eta[i]);
    nodes.theta[node] = theta;
    nodes.weight[node] = rule.weights[i] * stretch;
    nodes.sine[node] = std::sin(0.5 * theta);
    nodes.cosine[node] = std::cos(0.5 * theta);
  }
}

void fill_block(const Gap& gap, const double* theta, const double* weight, const GaussRule& rule,
                double* block) {
  const int m = rule.count;
  const double alpha = gap.alpha, middle = 0.5 * (gap.end[0] + gap.end[1]);
  const bool is_short = gap.length() < periodic_series;
  // sines of differences from those of the nodes: of small ones the kernels are series
  Vector sine(m), cosine(m), power(m);
  for (int i = 0; i < m; ++i) {
    power[i] = std::exp(alpha * rule.eta[i]);
    if (!is_short) {
      sine[i] = std::sin(0.5 * (theta[i] - middle));
      cosine[i] = std::cos(0.5 * (theta[i] - middle));
    }
  }
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j <= i; ++j) {
      double x = theta[i] - theta[j], far;
      if (is_short || std::abs(x) < periodic_series) {
        far = periodic_images(x);
      } else {
        double half = sine[i] * cosine[j] - cosine[i] * sine[j];
        far = 1 / (half * half) - 4 / (x * x);
      }
      double y = rule.eta[i] - rule.eta[j], near;
      if (std::abs(alpha * y) < mapped_series) {
        near = mapped_kernel(alpha, y);
      } else {
        double ratio = power[i] / power[j];
        double twice = ratio - 1 / ratio;  // twice the hyperbolic sine
        near = 4 * (4 * alpha * alpha / (twice * twice) - 1 / (y * y));
      }
      double both = weight[i] * weight[j] * far + rule.weights[i] * rule.weights[j] * near;
      block[i * m + j] = block[j * m + i] = rule.crack[i * m + j] - both / (4 * pi);
    }
  }
}

}  // namespace

Nodes::Nodes(std::vector<Gap> given, Integers orders_given)
    : gaps(std::move(given)), orders(std::move(orders_given)), offset{0}, square{0},
      slope(gaps.size()) {
  for (int order : orders) {
    const int m = gauss_rules()[order].count;
    offset.push_back(offset.back() + m);
    square.push_back(square.back() + m * m);
  }
  for (Vector* values : {&theta, &weight, &sine, &cosine}) values->resize(offset.back());
}

Equations allocate_equations(const Nodes& nodes) {
  const int n = nodes.size();
  return {Vector(nodes.square.back()), Vector(n), Vector(n),
          std::vector<EndTerms>(nodes.gap_count())};
}

WIDE void fill_gap(int k, int fields, Nodes& nodes, Equations& equations, const Model& model) {
  const GaussRule& rule = gauss_rules()[nodes.orders[k]];
  const int m = rule.count, first = nodes.offset[k];
  Vector s(m * fields);
  EndTerms ends = {};
  gap_moments(nodes.gaps[k], *model.panels, m, fields, s.data(), ends);
  equations.end_terms[k] = subtract_modes(s, m, fields, ends);
  fill_nodes(k, rule, nodes);
  for (int field = 0; field < fields; ++field) {
    double* load = (field == 0 ? equations.load : equations.load_of_slope).data() + first;
    apply(rule.modes.data(), m, m, &s[field * m], nullptr, load);
    for (int i = 0; i < m; ++i) load[i] *= rule.weights[i];
  }
  fill_block(nodes.gaps[k], &nodes.theta[first], &nodes.weight[first], rule,
             &equations.blocks[nodes.square[k]]);
}

double periodic_images(double x) {
  if (std::abs(x) < periodic_series) {
    double y = x * x;
    return 1.0 / 3 + y * (1.0 / 60 + y * (1.0 / 1512 + y * (1.0 / 43200 + y / 1330560)));
  }
  double half = std::sin(0.5 * x);
  return 1 / (half * half) - 4 / (x * x);
}

double mapped_kernel(double alpha, double x) {
  double y = alpha * x;
  if (std::abs(y) < mapped_series) {
    y *= y;
    double series = 1.0 / 15 + y * (-2.0 / 189 + y * (1.0 / 675 - y * 2 / 10395));
    return 4 * alpha * alpha * (-1.0 / 3 + y * series);
  }
  double grown = std::exp(y);
  double twice = grown - 1 / grown;  // twice the hyperbolic sine
  return 4 * (4 * alpha * alpha / (twice * twice) - 1 / (x * x));
}

WIDE void end_charges(const Nodes& nodes, const Equations& equations, int k, int side,
                      const GaussRule& rule, double* density, double* load, double* charge) {
  const int m = rule.count, first = nodes.offset[k];
  const double* block = &equations.blocks[nodes.square[k]];
  const double point = pi / (m + 1);  // weight at the edge itself
  const double singular_weight = point / nodes.slope[k][side];
  const double alpha = nodes.gaps[k].alpha, edge = nodes.gaps[k].end[side];
  for (int j = 0; j < m; ++j) {
    density[j] = side == 0 ? 1 / (1 + rule.eta[j]) : 1 / (1 - rule.eta[j]);
    charge[j] = rule.weights[j] * density[j] + point * rule.end_values[side][j];
  }
  for (int i = 0; i < m; ++i) {
    double total = dot_difference(&rule.crack[i * m], block + i * m, density, m);
    double near = rule.weights[i] * point * mapped_kernel(alpha, rule.eta[i] - (2 * side - 1));
    double far =
        nodes.weight[first + i] * singular_weight * periodic_images(nodes.theta[first + i] - edge);
    load[i] = total + (near + far) / (4 * pi);
  }
}

}  // namespace adhesis
