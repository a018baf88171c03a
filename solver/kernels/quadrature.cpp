#include "quadrature.hpp"

#include <bit>

namespace adhesis {

GaussRule::GaussRule(int m)
    : count(m), eta(m), weights(m), end_values{Vector(m), Vector(m)}, straight(m * m), modes(m * m),
      derivative(m * m) {
  for (int i = 0; i < m; ++i) {
    const double t = (m - i) * pi / (m + 1), sine = std::sin(t);
    eta[i] = std::cos(t);
    weights[i] = pi / (m + 1) * sine * sine;
    // of the polynomial through the nodes
    end_values[0][i] = alternating(i) * (1 - eta[i]);
    end_values[1][i] = alternating(m - 1 - i) * (1 + eta[i]);
    for (int n = 0; n < m; ++n) modes[i * m + n] = std::sin(t * (n + 1)) / sine;
  }
  for (int i = 0; i < m; ++i) {
    straight[i * m + i] = 0.5 * (m + 1) * weights[i];
    for (int j = 0; j < m; ++j) {
      if (j == i) continue;
      const double apart = eta[i] - eta[j];
      straight[i * m + j] = alternating(i + j) * weights[i] * weights[j] / (pi * apart * apart);
      derivative[i * m + j] = alternating(i + j) * weights[j] / weights[i] / apart;
    }
  }
}

const std::vector<GaussRule>& gauss_rules() {
  static const std::vector<GaussRule> rules = [] {
    std::vector<GaussRule> all;
    for (unsigned count = 4; count <= 128; count += std::max(1u, std::bit_floor(count) / 8))
      all.emplace_back(int(count));
    return all;
  }();
  return rules;
}

int choose_order(const Gap& gap, double digits) {
  const std::vector<GaussRule>& rules = gauss_rules();
  const double wanted = digits / convergence_rate(gap);
  int order = 0;
  while (order < int(rules.size()) - 1 && rules[order].count < wanted) ++order;
  return order;
}

}  // namespace adhesis
