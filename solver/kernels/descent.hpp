// Descent in energy along a jump: the gradient flow of the edges, on the tree of gaps.
//
// With n the outward motions and f = C_c² - C² the forces, the edges follow ṅ = f. Few of them run
// at a time. These, and those beside them, are held in the linear response, so that the others are
// stable and follow; of the held ones the tangent is condensed. With it their flow is integrated
// through a model of their openings, over several shortest waves where they run, and over a
// fraction of one near equilibria and saddles, where a gap closes or a patch vanishes. The field at
// the end of each step shows how wrong the model was.
#pragma once

#include "edge_model.hpp"
#include "equilibrium.hpp"

namespace adhesis {

enum class DescentEvent {
  at_rest,   // steps have become short, for Newton's iteration, or those allowed are used up
  vanished,  // a gap or patch is below the smallest length
  no_field,  // the edges have no field
};

struct Descent {
  DescentEvent event = DescentEvent::at_rest;
  Vector ends;
  int steps = 0;  // solutions of the linear response
  // Whether the order in which the edges ran may have decided where they ended: some took so much
  // force from others. Edges that increase each other's force end alike in any order.
  bool raced = false;
  // Ends where forces had fallen most before they rose again, empty if nowhere: whether there is a
  // minimum may be decided by the error of the field.
  Vector passed;
};

// Descend until an event; `start` is where the edges began to run. Without adhesion the edges are
// stable but where patches come or go: all take Newton's steps, each edge within its limit. With
// equal speeds, for comparison, each edge has the time Δτ in which its own force would move it by
// the longest step.
Descent descend(LinearResponse& response, Vector ends, const Vector& start, double prescribed,
                int most_steps, bool equal_speeds, const EdgeLaw& law, const FieldModel& model);

// Take a linearly implicit step, (1/Δτ + H) Δn = force, in which no edge moves further than
// `longest`.
//
// The time Δτ is that in which the largest force alone would move its edge so far; with equal
// speeds every edge has its own time, in which its own force would. It is less where 1/Δτ + H is
// not positive definite: the step would not be downhill.
Vector implicit_step(const Matrix& hessian, const Vector& force, double longest, bool equal_speeds);

// Compute the largest motion to the minimum of a quadratic model; infinite without one.
double distance_to_minimum(const Matrix& hessian, const Vector& force);

}  // namespace adhesis
