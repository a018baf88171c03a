// References of a linear response that move with the edges, and equilibria by Newton's iteration.
//
// A gap whose edge leaves its reference is linearised anew where it is now, in the potential of the
// last solution or, if it has moved far, of the next, and the runs of the tree that hold the gap
// are computed anew. So a state next to a known one costs the changed gaps and one pass through the
// tree. All edges are in equilibrium where none is outdated any more.
//
// Where a patch comes or goes the response is set up anew: taking over the other gaps saves time
// beyond some 150 of them only. It is, too, where a gap or run needs more nodes than there is room
// for.
#pragma once

#include "field.hpp"
#include "response.hpp"

namespace adhesis {

struct Outdated {
  bool changed, far;  // whether a gap has left its reference, and whether far
};

// Return whether gap k, now `gap`, is to be renewed: it has left its reference, or was out of
// balance in it. The response is wrong to second order, in which the motion squared over the gap or
// the patch beside it may be the error of the field; the less the softer the gap is: next to a
// fold.
Outdated is_outdated(const LinearResponse& response, int k, const Gap& gap, const EdgeLaw& law);

bool any_outdated(const LinearResponse& response, const Vector& ends, const EdgeLaw& law);

// Move the references of gaps to these edges where they have departed from them.
//
// `states` are those of the edges from now on. `pressure` is p, with which the last solution
// gives the potentials. If that one `is_lost`, moved gaps are linearised again in the next. A gap
// that needs more nodes gets them, where it `raises` orders. Returns false if the edges have no
// field: then the response serves for no others.
bool move_references(LinearResponse& response, const Vector& ends, const EdgeStates& states,
                     double pressure, double prescribed, const EdgeLaw& law,
                     const FieldModel& model, bool raises = true, bool is_lost = false);

// Hold some edges where they are, and no others, and note which of all recede.
void hold_edges(LinearResponse& response, const Vector& ends, const EdgeStates& states);

// Renew the response for a known equilibrium; returns false as move_references does.
bool settle_response(LinearResponse& response, const Vector& ends, double prescribed,
                     const EdgeLaw& law, const FieldModel& model);

// Solve these gaps with their edges held, if they have a field, and linearise there; `orders` are
// the least orders of their rules, or none.
std::optional<LinearResponse> set_up_response(const Vector& ends, double prescribed,
                                              Integers orders, const EdgeLaw& law,
                                              const FieldModel& model);

struct Equilibrium {
  bool found = false;  // whether one was found within reach, stable if strict
  Vector ends;
  ResponseSolution at;  // its pressure is NaN if the edges have no field
  int corrections = 0;
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
                             bool strict, const EdgeLaw& law, const FieldModel& model);

}  // namespace adhesis
