// Sine transforms, Σ_j x_j sin(π j k/N), N = 2^a 3^b 5^c with a ≥ 2.
//
// The N - 1 numbers are folded to N real ones, those are taken as N/2 complex ones for a Fourier
// transform (Stockham's, of mixed radix), and its two halves are separated again (Press et al.,
// Numerical Recipes, section 12.4).
#pragma once

#include <memory>

#include "arrays.hpp"

namespace adhesis {

// Cosine and sine of π j/N for j = 0 … 2N - 1.
struct Circle {
  int count;  // N
  Vector cosine, sine;

  explicit Circle(int count);
};

// Return the circle of these points, which is kept unless it is large.
std::shared_ptr<const Circle> circle_of(int count);

// Set out_k to Σ_j x_j sin(π (j+1)(k+1)/N), both of N - 1 numbers.
void sine_sums(const Vector& x, const Circle& circle, Vector& out);

}  // namespace adhesis
