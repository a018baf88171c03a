// Inner loops of the method grid, on all n nodes; `inside` is 1 on the contact set Ω, else 0.
#pragma once

#include "arrays.hpp"

namespace adhesis {

// Sum the values, in the order of dot.
double total(const double* values, int n);

// Set the values outside Ω to zero, in place; returns whether they all were.
bool restrict_inside(double* values, const double* inside, int n);

// Compute the residual on Ω, zero elsewhere; returns the largest absolute one.
double residual_inside(const double* target, const double* displacement, const double* inside,
                       double* out, int n);

// Set the next search direction: the correction on Ω plus `factor` times the last one.
void update_direction(double* direction, const double* inside, const double* correction,
                      double factor, int n);

// State of the conjugate gradients that a step changes.
struct GridState {
  double *stress, *displacement, *residual;
};

// Take a step along the direction; returns the largest absolute residual on Ω.
double advance(GridState state, const double* direction, const double* response,
               const double* inside, double step, int n);

// bᵀA⁻¹b for a symmetric positive definite A (Cholesky); overwrites A.
double inverse_form(double* matrix, const double* vector, int n);

}  // namespace adhesis
