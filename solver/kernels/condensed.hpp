// Tangent of a few edges with all others following, from the tree of the linear response.
//
// Forces on a few edges move all edges by the compliance Z of the response. Its part among these
// edges is the inverse of their tangent, with the others following: a Schur complement.
#pragma once

#include "response.hpp"

namespace adhesis {

// A square matrix, by rows.
struct Matrix {
  int n;
  Vector values;

  explicit Matrix(int n = 0) : n(n), values(n * n) {}
  double& operator()(int i, int j) { return values[i * n + j]; }
  double operator()(int i, int j) const { return values[i * n + j]; }
};

// Some edges, rising, of a response that was solved at the prescribed quantity.
class CondensedEdges {
 public:
  CondensedEdges(LinearResponse& response, Integers edges, const ResponseSolution& now,
                 const Device& device);

  // ∂(C_e - C_c)/∂n_f between the edges, all others following, without their damping.
  Matrix tangent() const;

  // C_e - C_c at the edges where they are, all others following.
  Vector residual(const ResponseSolution& now) const;

  // Motions of all edges from their references when these have a given motion. The potentials of
  // the response are those with these motions from now on; `pressure` receives p.
  Vector follow(const Vector& motion, const ResponseSolution& now, double& pressure);

  const Integers& edges() const { return edges_; }

 private:
  LinearResponse& response_;
  Integers edges_;
  Device device_;
  Matrix stiffness_;  // with the damping

  double pressure_by_force(int edge, const ResponseSolution& now) const;
};

}  // namespace adhesis
