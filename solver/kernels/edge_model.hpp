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
//     ∂own_e/∂n_f = ∂(K C_f)/∂n_e = K' (∂l/∂n_e) C_f + K² C_e,
//
// and beside a patch own_e changes likewise by the motion of e itself.
#pragma once

#include "condensed.hpp"

namespace adhesis {

// An edge on its way from where it was solved.
struct MovingEdge {
  int edge;   // its number
  int after;  // index of the edge after it, -1 if that is none of the moving ones
  double theta, motion = 0;
  double opening, rate;            // C, and ∂C/∂n
  ValueAndSlope half_plane;        // R, and its derivative by θ
  double critical, critical_rate;  // C_c, and its derivative by n
  bool pinned;                     // whether C lies between both critical openings
  double own;                      // ∂C/∂n, less that of a half-plane crack
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

  // Evaluate R, C_c and the rates at the present edges.
  void evaluate(MovingEdge& edge) const;

  // Move the edges by half the steps; coupling and rates of neighbours follow the lengths between.
  void follow_lengths(const Vector& step);
};

// Take a linearly implicit step, (1/Δτ + H) Δn = force, in which no edge moves further than
// `longest`.
//
// The time Δτ is that in which the largest force alone would move its edge so far; with equal
// speeds every edge has its own time, in which its own force would. It is less where 1/Δτ + H is
// not positive definite: the step would not be downhill.
Vector implicit_step(const Matrix& hessian, const Vector& force, double longest, bool equal_speeds);

// Compute the largest motion to the minimum of a quadratic model; infinite without one.
double distance_to_minimum(const Matrix& hessian, const Vector& force);

// Flow through the model.
struct ModelFlow {
  Vector motion;                  // outward motion of the contact at every edge
  Vector opening;                 // C of the model at the end
  Vector lengths;                 // largest motion up to each step
  std::vector<Vector> residuals;  // C - C_c of the model after each step
  bool is_at_limit = false;       // whether an edge came to its limit
};

// Follow the flow ṅ = C_c² - C² by linearly implicit Euler steps, (1/Δτ + H) Δn = force, until an
// edge is at its limit, or at rest; a long step, or near balance. `strongest` is the largest norm
// of the forces on the way so far. A short step ends where the forces have fallen, too: how far a
// shallow minimum is from a saddle only the field shows. With equal speeds, for comparison, the
// time Δτ is each edge's own.
ModelFlow flow_through(EdgeModel& model, const Vector& limit, bool equal_speeds, bool is_long,
                       double strongest, const EdgeLaw& law);

// Whether forces that were as large as `strongest` have come near a minimum or saddle.
bool near_balance(double force, double strongest, const EdgeLaw& law);

// Measure by how much the openings of the model are wrong at the end of a long step, in units of
// what is allowed.
//
// `residual` is C - C_c of the field there. On the way the errors are taken to grow as the square
// of its length, and far from balance more is allowed.
double model_error(const ModelFlow& flow, const Vector& residual, const Integers& edges,
                   const Vector& ends, const EdgeLaw& law);

// Choose the next reach after a long step of this length, in longest steps, and error.
double next_reach(double before, double length, double error);

}  // namespace adhesis
