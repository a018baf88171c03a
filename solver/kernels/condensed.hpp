// Edges that are held, all others following on the tree of the linear response.
//
// How the openings at these edges change when one of them moves is their condensed tangent: a Schur
// complement of the tangent of all edges.
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

// Held edges, rising, of a response that was solved at the prescribed quantity.
class HeldEdges {
 public:
  HeldEdges(LinearResponse& response, const Integers& edges, const ResponseSolution& now,
            const LoadingDevice& device)
      : response_(response), edges_(edges), now_(now), device_(device) {}

  // C_e - C_c at the edges, C_c that of edges that advance.
  Vector residual() const;

  // -∂C_e/∂p at the edges.
  Vector closing_by_pressure() const;

  // ∂(C_e - C_c)/∂n_f between the edges at the prescribed d.
  Matrix tangent() const;

  // Motions of all edges from their references when these move on by `motion`. The potentials of
  // the response are those with these motions from now on; `pressure` receives p.
  Vector follow(const Vector& motion, double& pressure);

 private:
  LinearResponse& response_;
  const Integers& edges_;
  const ResponseSolution& now_;
  const LoadingDevice& device_;

  Vector pressure_by_motion(const Vector& closing) const;  // ∂p/∂n_e at the prescribed d
};

}  // namespace adhesis
