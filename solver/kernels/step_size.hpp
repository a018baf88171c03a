// Control of the length of long steps in a descent.
//
// Long steps, of the flow through the model, go as far as their reach: their error is the
// difference between the openings of the model and those of the field at the end, and grows as the
// square of their length.
#pragma once

#include "edge_model.hpp"

namespace adhesis {

// Measure by how much the openings of the model are wrong, in units of what is allowed.
//
// `residual` is C - C_c of the field at the end. On the way the errors are taken to grow as the
// square of its length, and far from balance more is allowed.
double model_error(const ModelFlow& flow, const Vector& residual, const Integers& edges,
                   const Vector& ends, const EdgeLaw& law);

// Choose the next reach after a long step of this length, in longest steps, and error.
double next_reach(double before, double length, double error);

}  // namespace adhesis
