// Openings of gaps at fine nodes, and their minima: where a gap may touch between its edges.
//
// A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) b_n come from f;
// above them the straight crack gives b_n = -s_n/(n+1), s_n the moments of S_full over the gap.
#pragma once

#include "field.hpp"
#include "sine_transform.hpp"

namespace adhesis {

struct FineOpening {
  Vector theta, theta_by_t;  // θ, falling, and dθ/dt at the nodes of a circle
  Vector opening, modes;     // T and b_n
};

// Count the sine nodes of gap k at `per_wave` nodes per shortest wave of the profile; there are no
// fewer than modes of the field.
int count_sine_nodes(const Field& field, int k, double per_wave);

// Evaluate the opening of gap k at the nodes of a circle.
FineOpening open_gap(const Field& field, int k, const Circle& circle);

// Sum b_n sin((n+1)t), cos t = η(θ), over n, at four places.
std::array<double, 4> sum_modes(const Gap& gap, const std::array<double, 4>& theta,
                                const Vector& modes);

// Integrate S_full T dθ over the gaps: by f, less π/2 s_n²/(n+1) of all modes above those of f.
double work_of_gaps(const Field& field);

// A minimum by the parabola through three nodes.
struct Candidate {
  double theta, opening, half;  // half the curvature
  double width, error;          // distance of the outer nodes; error of the opening
};

// Find local minima where θ falls; of the minima θ rises. The error is estimated from the cubics
// through a fourth node on either side.
std::vector<Candidate> local_minima(const Vector& x, const Vector& y);

// `rim` is the opening up to which the surfaces part at least on the way to either end of the gap,
// within the range of adhesion; infinite beyond it.
struct Minimum {
  double theta, opening, curvature, rim;
  int gap;
};

// Find the minima of some gaps; the lower ones of surfaces that attract each other from a `range`
// on are located more finely.
std::vector<Minimum> find_minima(const Field& field, const Integers& gaps, double range);

}  // namespace adhesis
