// Map a gap to the coordinate in which its neighbours are far away.
//
// The half-space kernel dθ dθ'/(θ-θ')² keeps its form under every Möbius map. For a gap (l, r)
// between patches whose far sides are A < l and B > r, take
//
//     η = [ln((θ-A)/(B-θ)) - middle] / (2α),      η(l) = -1, η(r) = +1,
//
// in which it becomes α²/sinh²(α(η-η')) dη dη', while every other gap, and every periodic image,
// lies on the line Im η = π/(2α). Chebyshev series in η converge as ρ^-M with ρ = τ + sqrt(1 + τ²),
// τ = π/(2α).
#pragma once

#include <array>

#include "arrays.hpp"

namespace adhesis {

// A gap, or a run of neighbouring gaps: its ends in θ, and the widths of the patches beside it.
struct Gap {
  std::array<double, 2> end;
  std::array<double, 2> patch;
  double alpha;

  double length() const { return end[1] - end[0]; }
};

inline double alpha_of(double length, double left_patch, double right_patch) {
  return 0.25 * (std::log1p(length / left_patch) + std::log1p(length / right_patch));
}

// Make the gaps between ends (left, right, left, …), increasing within one period.
inline std::vector<Gap> map_gaps(const Vector& ends) {
  int count = int(ends.size()) / 2;
  std::vector<Gap> gaps(count);
  for (int k = 0; k < count; ++k) {
    double left = ends[2 * k], right = ends[2 * k + 1];
    double before = k > 0 ? ends[2 * k - 1] : ends[2 * count - 1] - 2 * pi;
    double after = k + 1 < count ? ends[2 * k + 2] : ends[0] + 2 * pi;
    double alpha = alpha_of(right - left, left - before, after - right);
    gaps[k] = Gap{{left, right}, {left - before, after - right}, alpha};
  }
  return gaps;
}

// Return whether every gap and patch has a length; false if an edge is NaN.
inline bool in_order(const std::vector<Gap>& gaps) {
  for (const Gap& gap : gaps)
    if (!(gap.length() > 0 && gap.patch[0] > 0 && gap.patch[1] > 0)) return false;
  return true;
}

// Distances of an end from both poles of the map: beside it, and at the far side.
struct Poles {
  double near, far;
};

inline Poles poles_of(const Gap& gap, int side) {
  return {gap.patch[side], gap.length() + gap.patch[1 - side]};
}

// Take the logarithm of the map at the distance r from an end.
inline double log_ratio(double r, Poles poles) {
  return std::log1p(r * (1 / poles.near + 1 / poles.far) / (1 - r / poles.far));
}

// 1 - η and 1 + η.
struct FromEnds {
  double minus, plus;

  double eta() const { return plus < minus ? plus - 1 : 1 - minus; }
};

// Compute 1 - η and 1 + η at the distance r from an end, to rounding.
inline FromEnds from_ends(const Gap& gap, double r, int side) {
  double distance = log_ratio(r, poles_of(gap, side)) / (2 * gap.alpha);
  return side == 0 ? FromEnds{2 - distance, distance} : FromEnds{distance, 2 - distance};
}

struct MappedPoint {
  double eta, square, slope;  // η, 1 - η² and dη/dθ
};

// Map θ, measured from the nearer end.
inline MappedPoint eta_at(const Gap& gap, double theta) {
  int side = theta - gap.end[0] < gap.end[1] - theta ? 0 : 1;
  double r = side == 0 ? theta - gap.end[0] : gap.end[1] - theta;
  FromEnds distance = from_ends(gap, r, side);
  Poles poles = poles_of(gap, side);
  double slope = (1 / (poles.near + r) + 1 / (poles.far - r)) / (2 * gap.alpha);
  return {distance.eta(), distance.minus * distance.plus, slope};
}

struct Place {
  double theta, stretch, inset;  // θ, dθ/dη, and the distance from the nearer end
};

// Find θ at η, measured from the nearer end.
inline Place theta_at(const Gap& gap, double eta) {
  int side = eta < 0 ? 0 : 1;
  Poles poles = poles_of(gap, side);
  double grown = std::expm1(2 * gap.alpha * (side == 0 ? 1 + eta : 1 - eta));
  double r = grown / (1 / poles.near + (1 + grown) / poles.far);
  double stretch = 2 * gap.alpha / (1 / (poles.near + r) + 1 / (poles.far - r));
  return {side == 0 ? gap.end[0] + r : gap.end[1] - r, stretch, r};
}

// The rate ln ρ of a gap: the error of M modes falls as ρ^-M.
inline double convergence_rate(const Gap& gap) { return std::asinh(pi / (2 * gap.alpha)); }

// Compute θ and dθ/dt at nodes η = cos t, t rising. As theta_at, with exp(y) - 1 from a table.
void place_nodes(const Gap& gap, std::span<const double> cosine, std::span<const double> sine,
                 double* theta, double* theta_by_t);

}  // namespace adhesis
