// Model of the edge openings about solved edges: half-plane cracks that interact.
//
// Over a shortest wave the opening C of an edge changes by the roughness under it, which is that of
// a half-plane crack and known beforehand. The rest, the finite length of the gap and the motion of
// the other edges, changes slowly. With n the outward motion of the contact,
//
//     dC_e = dR_e + own_e dn_e + Σ_{f≠e} coupling_ef C_f dn_f,
//
// R the opening of the half-plane crack, and the coupling symmetric: both follow from the tangent.
// Between neighbours, across a gap or patch of length l, the coupling K goes as 1/l: it is -1/(2l)
// across a narrow gap, and less across a patch, which bears less load when it shrinks. As
// derivatives of C_e by n_e and by n_f may be exchanged,
//
//     ∂own_e/∂n_f = ∂(K C_f)/∂n_e = K' (∂l/∂n_e) C_f + K² C_e.
//
// Beside a narrow gap or patch C_e depends on l alone, as a power of it: l^-Kl across a gap, which
// n makes narrower, and l^Kl across a patch. By its own motion own_e changes as this power's slope.
#pragma once

#include "condensed.hpp"

namespace adhesis {

// An edge on its way from where it was solved.
struct MovingEdge {
  int edge;   // its number
  int after;  // index of the edge after it, -1 if that is none of the moving ones
  double theta, motion = 0;
  double opening;            // C
  ValueAndSlope half_plane;  // R, and its derivative by θ
  CriticalOpening critical;  // C_c
  double own;                // ∂C/∂n, less that of a half-plane crack
};

class EdgeModel {
 public:
  std::vector<MovingEdge> edges;

  // Make the model of some edges from C_e - C_c and ∂(C_e - C_c)/∂n_f there.
  EdgeModel(const Integers& edges, const Vector& ends, const Vector& residual,
            const Matrix& tangent, const EdgeLaw& law, const Panels& panels);

  // Move the edges outwards by these steps.
  void advance(const Vector& step);

  // Forces C_c² - C |C|.
  Vector forces() const;

  // H_ef = ∂(C_e |C_e| - C_c²)/∂n_f, symmetric: closing edges act on no others. Pinned
  // edges, which have no force, are kept where they are.
  Matrix hessian() const;

 private:
  const EdgeLaw& law_;
  const Panels& panels_;
  Matrix coupling_;  // ∂C_e/∂n_f over C_f; zero on the diagonal

  // Move the edges by half the steps; coupling and rates of neighbours follow the lengths between.
  void follow_lengths(const Vector& step);
};

}  // namespace adhesis
