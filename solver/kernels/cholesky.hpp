// Factor and solve small symmetric positive definite systems.
//
// Factors are A = LᵀL with L lower, by rows and from the last one on: every loop then starts at
// the beginning of a row.
#pragma once

#include "arrays.hpp"

namespace adhesis {

// Factor an n×n matrix in place of its lower triangle. False if a pivot is not positive.
bool factor_rows(double* a, int n);

// Solve for one right-hand side, in place, with a factor.
void solve_column(const double* factor, int n, double* x);

// Invert an n×n matrix; returns whether it is positive definite.
bool invert_definite(const double* matrix, int n, double* inverse);

}  // namespace adhesis
