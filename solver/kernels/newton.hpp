// Equilibrium of all edges by Newton's iteration on their linear response.
#pragma once

#include "renewal.hpp"

namespace adhesis {

struct Equilibrium {
  bool found = false;  // whether one was found within reach, stable if strict
  Vector ends;
  Vector potential;     // of the other gaps at the reference nodes, as G
  ResponseSolution at;  // its pressure is NaN if the edges have no field
  int corrections = 0;
  std::vector<Gap> references;  // of the gaps, and the orders of their rules
  Integers orders;
  // Place of C between both critical openings, 0 where an edge begins to advance and 1 where it
  // begins to recede, and its derivative by d; NaN for edges that are not pinned. Empty with one
  // work of adhesion.
  Vector pinned_share, pinned_rate;
};

// Find the equilibrium next to these edges. The references of gaps follow where they move by more
// than that to which the response is accurate. Where the edges are not stable on the way, or the
// corrections hardly shrink, the iteration ends. Unless `strict`, edges that are nearly in
// equilibrium are taken as they are.
Equilibrium find_equilibrium(LinearResponse& response, Vector ends, double prescribed, double reach,
                             bool strict, const EdgeLaw& law, const Model& model);

}  // namespace adhesis
