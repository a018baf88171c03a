// Inputs of a field besides its gaps: the compressed profile, the device, the accuracy.
#pragma once

#include <memory>

#include "quadrature.hpp"

namespace adhesis {

// Rule on a finest panel from 0 to 1, and ∫ w dθ from 0 to the start of each panel.
struct LengthRule {
  Vector nodes, weights, before;
};

// The full-contact stress, compressed on panels; see full_contact_stress.py.
struct Panels {
  double width;
  int finest_count;
  Vector x, w;                       // Gauss-Legendre rule of a panel
  Vector stress, slope;              // Chebyshev coefficients of S, S' on each panel
  Vector tilt;                       // of h'
  Vector pattern;                    // of γ(θ)/γ; empty where that is 1
  std::array<Vector, 2> half_plane;  // of C of a half-plane crack that begins, ends at θ
  std::array<Vector, 2> weights;     // ω for S and S' of every panel of every level
  Integers level_start;              // row of the weights at which each level starts
  Vector end_x, end_w;               // Gauss-Legendre rule on (0, 1) of an end piece
  LengthRule length;
  int highest_harmonic;  // of the profile

  int nodes() const { return int(x.size()); }
};

// d = separation_weight q0 s - compliance p is prescribed.
struct LoadingDevice {
  double separation_weight, compliance;
};

struct FieldModel {
  LoadingDevice device;
  double digits;  // -ln of the relative accuracy of the field
  std::shared_ptr<const Panels> panels;
};

struct ValueAndSlope {
  double value, slope;
};

// Evaluate a piecewise Chebyshev series, and its derivative by θ.
ValueAndSlope evaluate_series(const Vector& coefficients, double theta, const Panels& panels);

// Evaluate a piecewise Chebyshev series at many positions, θ over the width of a panel; `out` may
// be where they are.
void interpolate(const Vector& coefficients, const double* position, int count,
                 const Panels& panels, double* out);

// w = sqrt(1 + h'²) γ(θ)/γ, the work of adhesion of a projected length over γ, and dw/dθ.
ValueAndSlope measure_at(double theta, const Panels& panels);

// Integrate w dθ from 0 to θ.
double length_up_to(double theta, const Panels& panels);

// C and dC/dθ of a half-plane crack that begins (side 0) or ends (1) at θ.
inline ValueAndSlope half_plane_opening(double theta, int side, const Panels& panels) {
  return evaluate_series(panels.half_plane[side], theta, panels);
}

// Compute the moments of S and S' over a gap; see gap_moments.cpp.
//
// `s` has a row for each load and a column for each mode, `ends` a value for both ends and each
// load: ends[side][load].
void gap_moments(const Gap& gap, const Panels& panels, int modes, double* s,
                 std::array<std::array<double, 2>, 2>& ends);

}  // namespace adhesis
