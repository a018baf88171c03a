// Equation (1) of gap_field.py: nodes, diagonal blocks and loads of given gaps.
//
// A gap's own part depends on the gap alone. Between gaps acts the half-space kernel at their nodes
// (tree.hpp).
#pragma once

#include "model.hpp"

namespace adhesis {

// Gaps and their Gauss-Chebyshev nodes, N of all L gaps together. Behind the nodes of a gap there
// may be room for those that it comes to need; they count nothing.
struct Nodes {
  std::vector<Gap> gaps;
  Integers orders;       // of each gap's rule
  Integers offset;       // first node of each gap, and the end of all
  Integers square;       // first element of the M×M matrix of each gap, and the end of all
  Vector theta, weight;  // θ and X
  Vector inset;          // distances from the nearer end of the gap
  Vector sine, cosine;   // of θ/2
  std::vector<std::array<double, 2>> slope;  // dη/dθ at both ends of each gap

  Nodes() = default;
  Nodes(std::vector<Gap> gaps, Integers orders, double room = 1);

  int gap_count() const { return int(gaps.size()); }
  int size() const { return int(theta.size()); }
  int size_of(int k) const { return gauss_rules()[orders[k]].count; }

  // Raise the order of a gap to this one; returns whether there is room.
  bool raise(int k, int order);
};

// Of S and S': a value for each end of a gap.
using EndTerms = std::array<std::array<double, 2>, 2>;  // [side][load]

// Diagonal blocks of B + G, flat, and loads; X is the weight of the nodes.
struct Equations {
  Unset blocks;
  Vector load, load_of_slope;       // S~ and S~'
  std::vector<EndTerms> end_terms;  // terms that the modes of S and S' above M add at the ends
};

Equations allocate_equations(const Nodes& nodes);

// Fill in nodes, block and loads of gap k.
void fill_gap(int k, Nodes& nodes, Equations& equations, const FieldModel& model);

// Load on the own gap, and charges, of the singular opening that an edge leaves when it moves;
// `density` is space for the nodes of the gap.
void end_charges(const Nodes& nodes, const Equations& equations, int k, int side,
                 const GaussRule& rule, double* density, double* load, double* charge);

}  // namespace adhesis
