// Gauss-Chebyshev rules of the gaps, and the choice of the order of each gap.
#pragma once

#include "gap.hpp"

namespace adhesis {

inline double alternating(int i) { return i % 2 == 0 ? 1 : -1; }

// Gauss-Chebyshev rule of M nodes of the second kind; matrices M×M, rows nodes.
struct GaussRule {
  int count;                         // M
  Vector eta, weights;               // nodes, rising, and weights
  std::array<Vector, 2> end_values;  // f(-1) and f(+1) from the nodes' values
  Vector straight;                   // of a straight crack, and w_i w_j/(π Δη²) but for i = j
  Vector modes;                      // U_n(η_i)
  Vector derivative;                 // of a potential by η: Σ_j of it times (g_j - g_i)

  explicit GaussRule(int count);
};

// The rules that a gap may have, by rising numbers of nodes; a gap's order is the index of its own.
const std::vector<GaussRule>& gauss_rules();

// Choose the order with which the modes of a gap leave an error of exp(-digits), or the largest.
int choose_order(const Gap& gap, double digits);

}  // namespace adhesis
