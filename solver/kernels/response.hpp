// Linear response of all gaps and their edges.
//
// An edge follows its own opening: C_e = C_c at each. Between given edges and in a given potential
// of the others every gap is solved by itself, with the motions of its two edges eliminated (static
// condensation): about these edges, its reference, it responds to potentials g and a mean stress p
// by
//
//     q = q0 + p q1 - R g,        n = n0 + p n1 + M g,
//
// its charges and the motions of its edges. The tree solves for all gaps and all edges together.
// While edges move little from their reference the response stays; where they move further it is
// renewed.
#pragma once

#include "edge_law.hpp"
#include "tree.hpp"

namespace adhesis {

// An edge in its reference.
struct Edge {
  double opening = 0, residual = 0;    // C and C - C_c, C_c that of an edge that advances
  ValueAndSlope pinning_range = {};    // C_c of one that recedes less that, and its derivative by n
  bool recedes = false;                // whether it is behind its memory
  double closing_by_pressure = 0;      // -∂C/∂p between held edges
  std::array<double, 2> tangent = {};  // ∂(C - C_c)/∂n of both edges of its gap, at the others' g
  bool held = false;                   // whether it stays where it is,
  double here = 0;                     // so far from the reference; 0 if it is not held
  std::array<double, 2> compliance = {};  // inverse of the tangents of edges that are not held
  double isolated_correction = 0;         // motion that would balance the gap by itself
  std::array<double, 2> motion = {};      // without potentials and p, and by a unit of p

  // C - C_c and its derivative by the edge's own motion. Both thresholds are known, so a response
  // stays valid where an edge begins to recede.
  ValueAndSlope imbalance(int side) const {
    if (!recedes) return {residual, tangent[side]};
    return {residual - pinning_range.value, tangent[side] - pinning_range.slope};
  }
};

// All edges as the response has them at a prescribed quantity d.
struct ResponseSolution {
  Vector motion, rate;  // n from the reference, and dn/dd along the branch
  Vector by_pressure;   // ∂n/∂p
  double pressure = not_a_number, separation = not_a_number;
  double slope = not_a_number;  // dY/dd along the branch: Y is p, under a load q0 s
  bool stable = false;
};

struct LinearResponse {
  Nodes nodes;          // between the reference edges
  Equations equations;  // with S and S'
  Unset inverse;        // of the blocks
  Tree tree;
  std::array<Charges, 2> charges;  // without potentials and p, and by a unit of p
  Vector about, about_pressure;    // potentials and p of the references
  Vector scaled_opening;           // f there
  std::vector<Edge> edges;
  Pair closing_by_potential;        // -∂C_e/∂g by the potential at its nodes
  Pair charge_by_edge;              // charges by the motion of each edge
  Pair held_charge;                 // between held edges in the reference, and by a unit of p
  Pair motion_by_potential;         // motion of both edges by the potential at each node
  Vector mean_by_potential;         // mean opening, times 2π, likewise, with the other sign
  Pair potential;                   // of the last solution, without p and by a unit of p
  std::array<double, 2> mean = {};  // its mean opening, times 2π, likewise
  Vector softness;  // compliance of each gap's edges, over that from which on gaps are soft
  // Gaps moved so far, between held edges, that the old potential is not theirs: the next solution
  // ends with linearising them in its own.
  Integers displaced;
  bool is_lost = false;  // whether the last solution is that of a search that failed
  Flags is_stale;  // whether a gap's edges have to be eliminated anew, before the next solution

  // Allocate the response of gaps with these nodes, which have room as its tree has.
  LinearResponse(Nodes nodes, double digits);

  int gap_count() const { return nodes.gap_count(); }

  // Compute the response of gap k about its reference, between given edges.
  //
  // A moving edge leaves a singular opening. The edge's own term follows from the translation of
  // the whole gap through its own loads and the potential of the others.
  void linearise(int k, const EdgeLaw& law);

  // Solve for all edges, with d prescribed.
  ResponseSolution solve(double prescribed, const EdgeLaw& law, const LoadingDevice& device);

  // 2π ∂d/∂p, the edges following, in the last solution.
  double prescribed_by_pressure(const LoadingDevice& device) const {
    return device.separation_weight * mean[1] - 2 * pi * device.compliance;
  }

  // p with d prescribed, by the mean openings of the last solution.
  double pressure_at(double prescribed, const LoadingDevice& device) const;

  // Potential of the last solution at a node and p.
  double potential_at(int node, double pressure) const {
    return potential[0][node] + pressure * potential[1][node];
  }

  // Motion of all edges outwards from their references to these.
  Vector motion_to(const Vector& ends) const;

 private:
  // Eliminate the motions of a gap's edges: its charges and edges by potentials and p.
  void condense(int k);

  // Condense the gaps that are stale, and factor the runs that hold them.
  void factor_runs();

  void update_softness(const Pair& motion, double by_pressure, const EdgeLaw& law,
                       const LoadingDevice& device);
};

}  // namespace adhesis
