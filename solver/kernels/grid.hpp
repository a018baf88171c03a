// Inner loops of the method grid, on all nodes; `inside` is 1 on the contact set Ω, else 0.
#pragma once

#include "arrays.hpp"

namespace adhesis {

using Numbers = std::span<const double>;
using Changed = std::span<double>;  // in place

// Sum the values, in the order of dot.
double total(Numbers values);

// Set the values outside Ω to zero, in place; returns whether they all were.
bool restrict_inside(Changed values, Numbers inside);

// Compute the residual on Ω, zero elsewhere; returns the largest absolute one.
double residual_inside(Numbers target, Numbers displacement, Numbers inside, Changed out);

// Set the next search direction: the correction on Ω plus `factor` times the last one.
void update_direction(Changed direction, Numbers inside, Numbers correction, double factor);

// Take a step along the direction; returns the largest absolute residual on Ω.
double advance(Changed stress, Changed displacement, Changed residual, Numbers direction,
               Numbers response, Numbers inside, double step);

}  // namespace adhesis
