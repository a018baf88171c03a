#include "equations.hpp"

namespace adhesis {

namespace {

// Subtract the first modes of a gap from the loads of its ends.
EndTerms subtract_modes(const Vector& s, int modes, const EndTerms& ends) {
  EndTerms out = {};
  for (int which = 0; which < 2; ++which) {
    double low = 0, high = 0, sign = 1;
    for (int n = 0; n < modes; ++n) {
      high += s[which * modes + n];
      low += sign * s[which * modes + n];
      sign = -sign;
    }
    out[0][which] = ends[0][which] - low;
    out[1][which] = ends[1][which] - high;
  }
  return out;
}

void fill_nodes(int k, const GaussRule& rule, Nodes& nodes) {
  const Gap& gap = nodes.gaps[k];
  nodes.slope[k] = {1 / theta_at(gap, -1).stretch, 1 / theta_at(gap, 1).stretch};
  for (int i = 0; i < rule.count; ++i) {
    const int node = nodes.offset[k] + i;
    auto [theta, stretch, inset] = theta_at(gap, rule.eta[i]);
    nodes.theta[node] = theta;
    nodes.inset[node] = inset;
    nodes.weight[node] = rule.weights[i] * stretch;
    nodes.sine[node] = std::sin(0.5 * theta);
    nodes.cosine[node] = std::cos(0.5 * theta);
  }
}

// Sine of half the distance of two points of a gap, from their distances from the nearer ends: of
// nodes beside a narrow patch these differ by far less than a rounding of θ.
double half_sine(const Gap& gap, double a, bool a_right, double b, bool b_right) {
  return std::sin(0.5 * (a_right == b_right ? a - b : gap.length() - a - b));
}

// Fill the block of a gap: the straight crack of the rule, which holds 1/Δη², less the kernel; on
// the diagonal less the limit of the difference of both.
void fill_block(const Gap& gap, const double* inset, const double* weight, const GaussRule& rule,
                double* block) {
  const int m = rule.count;
  const double limit = 4 * gap.alpha * gap.alpha;
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < i; ++j) {
      const double half = half_sine(gap, inset[i], rule.eta[i] >= 0, inset[j], rule.eta[j] >= 0);
      block[i * m + j] = block[j * m + i] =
          rule.straight[i * m + j] - weight[i] * weight[j] / (4 * pi * half * half);
    }
    block[i * m + i] =
        rule.straight[i * m + i] -
        (weight[i] * weight[i] - limit * rule.weights[i] * rule.weights[i]) / (12 * pi);
  }
}

}  // namespace

Nodes::Nodes(std::vector<Gap> given, Integers orders_given, double room)
    : gaps(std::move(given)), orders(std::move(orders_given)), offset{0}, square{0},
      slope(gaps.size()) {
  for (int order : orders) {
    const int m = int(room * gauss_rules()[order].count);
    offset.push_back(offset.back() + m);
    square.push_back(square.back() + m * m);
  }
  for (Vector* values : {&theta, &inset, &weight, &sine, &cosine}) values->resize(offset.back());
}

bool Nodes::raise(int k, int order) {
  if (order <= orders[k]) return true;
  if (gauss_rules()[order].count > offset[k + 1] - offset[k]) return false;
  orders[k] = order;
  return true;
}

Equations allocate_equations(const Nodes& nodes) {
  const int n = nodes.size();
  return {unset(nodes.square.back()), Vector(n), Vector(n),
          std::vector<EndTerms>(nodes.gap_count())};
}

WIDE void fill_gap(int k, Nodes& nodes, Equations& equations, const FieldModel& model) {
  const GaussRule& rule = gauss_rules()[nodes.orders[k]];
  const int m = rule.count, first = nodes.offset[k];
  thread_local Vector s;
  s.assign(2 * m, 0.0);
  EndTerms ends = {};
  gap_moments(nodes.gaps[k], *model.panels, m, s.data(), ends);
  equations.end_terms[k] = subtract_modes(s, m, ends);
  fill_nodes(k, rule, nodes);
  for (int which = 0; which < 2; ++which) {
    double* load = (which == 0 ? equations.load : equations.load_of_slope).data() + first;
    apply(rule.modes.data(), m, m, &s[which * m], nullptr, load);
    for (int i = 0; i < m; ++i) load[i] *= rule.weights[i];
  }
  fill_block(nodes.gaps[k], &nodes.inset[first], &nodes.weight[first], rule,
             &equations.blocks[nodes.square[k]]);
}

// The edge is one node more, of the weight π/(M + 1).
WIDE void end_charges(const Nodes& nodes, const Equations& equations, int k, int side,
                      const GaussRule& rule, double* density, double* load, double* charge) {
  const int m = rule.count, first = nodes.offset[k];
  const double* block = &equations.blocks[nodes.square[k]];
  const Gap& gap = nodes.gaps[k];
  const double point = pi / (m + 1), weight = point / nodes.slope[k][side];
  for (int j = 0; j < m; ++j) {
    density[j] = side == 0 ? 1 / (1 + rule.eta[j]) : 1 / (1 - rule.eta[j]);
    charge[j] = rule.weights[j] * density[j] + point * rule.end_values[side][j];
  }
  for (int i = 0; i < m; ++i) {
    const double half = half_sine(gap, nodes.inset[first + i], rule.eta[i] >= 0, 0, side == 1);
    const double sign = alternating(side == 0 ? i + 1 : m - i);
    const double straight = sign * rule.weights[i] * point * density[i] * density[i] / pi;
    load[i] = nodes.weight[first + i] * weight / (4 * pi * half * half) - straight -
              dot(block + i * m, density, m);
  }
}

}  // namespace adhesis
