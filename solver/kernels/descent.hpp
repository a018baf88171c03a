// Descent in energy along a jump: the gradient flow of the edges, on the tree of gaps.
//
// With n the outward motions and f = C_c² - C² the forces, the edges follow ṅ = f. Few of them run
// at a time: their tangent, with all others following, is condensed from the linear response. With
// it the flow of these edges is integrated through a model of their openings, over several shortest
// waves where they run, and over a fraction of one near equilibria and saddles, where a gap closes
// or a patch vanishes. The field at the end of each step shows how wrong the model was. The others
// follow linearly.
//
// Where the edges are not stable, those that run are damped in the response: in the tangent of
// their gap a force 1/Δτ resists their motion. The condensed tangent is taken without it.
#pragma once

#include "renewal.hpp"

namespace adhesis {

enum class DescentEvent {
  at_rest,     // the steps have become short: Newton's iteration finds the equilibrium
  vanished,    // a gap or patch is below the smallest length
  step_limit,  // the steps that were allowed are used up
  no_field,    // the edges have no field
  outgrown,    // some gap needs more nodes than the linear response has
};

struct Descent {
  DescentEvent event = DescentEvent::step_limit;
  Vector ends;
  int steps = 0;  // solutions of the linear response
  double reach;   // of the next long step, in longest steps
};

// Descend until an event. `runs` marks the edges that run already, and is changed; `reach` is that
// of the first long step. With equal speeds, for comparison, each edge has the time Δτ in which its
// own force would move it by the longest step.
Descent descend(LinearResponse& response, Vector ends, double prescribed, int most_steps,
                bool equal_speeds, Flags& runs, double reach, const EdgeLaw& law,
                const Model& model);

}  // namespace adhesis
