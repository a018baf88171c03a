#include "quadrature.hpp"

namespace adhesis {

GaussRule::GaussRule(int m)
    : count(m), eta(m), weights(m), end_values{Vector(m), Vector(m)}, crack(m * m), modes(m * m),
      derivative(m * m) {
  Vector to_modes(m * m);  // coefficients of U_n from the nodes' values; rows nodes
  for (int i = 0; i < m; ++i) {
    const double t = (m - i) * pi / (m + 1), sine = std::sin(t);
    eta[i] = std::cos(t);
    weights[i] = pi / (m + 1) * sine * sine;
    double sign = 1;
    for (int n = 0; n < m; ++n) {
      modes[i * m + n] = std::sin(t * (n + 1)) / sine;
      to_modes[i * m + n] = 2 / pi * modes[i * m + n] * weights[i];
      end_values[0][i] += sign * to_modes[i * m + n] * (n + 1);
      end_values[1][i] += to_modes[i * m + n] * (n + 1);
      sign = -sign;
    }
  }
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j <= i; ++j) {
      double total = 0;
      for (int n = 0; n < m; ++n) total += to_modes[i * m + n] * (n + 1) * to_modes[j * m + n];
      crack[i * m + j] = crack[j * m + i] = 0.5 * pi * total;
    }
    // of the polynomial through the nodes, by the barycentric formula
    for (int j = 0; j < m; ++j)
      if (j != i)
        derivative[i * m + j] =
            ((i + j) % 2 == 0 ? 1 : -1) * weights[j] / weights[i] / (eta[i] - eta[j]);
  }
}

const std::vector<GaussRule>& gauss_rules() {
  static const std::vector<GaussRule> rules = [] {
    std::vector<GaussRule> all;
    for (int count :
         {4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 24, 28, 32, 40, 48, 64, 96, 128})
      all.emplace_back(count);
    return all;
  }();
  return rules;
}

Integers choose_orders(const std::vector<Gap>& gaps, double digits) {
  const std::vector<GaussRule>& rules = gauss_rules();
  Integers orders;
  for (const Gap& gap : gaps) {
    const double wanted = digits / convergence_rate(gap);
    int order = 0;
    while (order < int(rules.size()) - 1 && rules[order].count < wanted) ++order;
    orders.push_back(order);
  }
  return orders;
}

}  // namespace adhesis
