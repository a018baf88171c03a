// Griffith's condition at the edges, C_e = C_c, and motions of the edges.
//
// Edges are numbered along the profile: 2k and 2k + 1 are the left and the right end of gap k.
// Motions are outwards of the contact: a left end of a gap moves to the right.
//
// With one work of adhesion every edge has C_e = C_c in equilibrium. With two of them an edge
// advances at C_c and recedes at C_c sqrt(γ_open/γ); between both it is pinned. Its memory is the
// place where it was at the last state: ahead of it the edge advances, behind it the edge recedes,
// and there it is held while C lies between both openings. A path of states therefore depends on
// its past, and within a jump an edge that ran too far comes back as it went.
#pragma once

#include "model.hpp"
#include "tolerances.hpp"

namespace adhesis {

// The law by which the edges move, with the tolerances of one problem; lengths in θ.
struct EdgeLaw {
  double critical;          // critical opening on a flat piece
  double newton_tolerance;  // a correction this small ends Newton's iteration
  double field_error;       // largest displacement of an equilibrium by the error of the field
  double rest_step;         // a descent with shorter steps is left to Newton's iteration
  double longest_step;      // longest short step of an edge in a descent
  double smallest;          // narrower patches and gaps are removed
  double rough_rate;        // of an opening over a shortest wave, by roughness or by C_c
  double force_error;       // a force C_c² - C² this small is the error of the field
  double pinning;           // sqrt(γ_open/γ) - 1, by which C_c of a receding edge is larger
  Vector memory = {};       // ends at the last state; empty for one work of adhesion
};

inline double outwards(int edge) { return edge % 2 == 0 ? 1 : -1; }

// C_c at θ of an edge that advances, and its derivative.
inline ValueAndSlope critical_opening(double theta, const EdgeLaw& law, const Panels& panels) {
  auto [measure, slope] = measure_at(theta, panels);
  double root = std::sqrt(measure);
  return {law.critical * root, law.critical * slope / (2 * root)};
}

// How far an edge has advanced from its memory; exactly 0 where it may be pinned.
inline double way_from_memory(int edge, double theta, const EdgeLaw& law) {
  const double way = outwards(edge) * (theta - law.memory[edge]);
  return std::abs(way) > 0.5 * law.newton_tolerance ? way : 0;
}

// C_c of an edge with the opening C, and its derivative by θ; of a pinned edge it is C.
struct CriticalOpening {
  double value, slope;
  bool pinned;
};

CriticalOpening critical_of(int edge, double theta, double opening, const EdgeLaw& law,
                            const Panels& panels);

// Mark the edges at their memory; none with one work of adhesion.
Flags at_memory(const Vector& ends, const EdgeLaw& law);

inline Vector move_edges(const Vector& ends, const Vector& motion) {
  Vector out(ends);
  for (int e = 0; e < int(ends.size()); ++e) out[e] += outwards(e) * motion[e];
  return out;
}

inline double shortest_length(const Vector& ends) {
  double least = ends.front() + 2 * pi - ends.back();
  for (size_t e = 1; e < ends.size(); ++e) least = std::min(least, ends[e] - ends[e - 1]);
  return std::min(least, 2 * pi);
}

// Longest step that counts as rest: less where gaps or patches are short.
inline double rest_within(const Vector& ends, const EdgeLaw& law) {
  return law.rest_step * std::min(1.0, CLOSING_SHARE * shortest_length(ends) / law.longest_step);
}

// Limit the motion of an edge: `longest`, or a share of the gap or patch that it may close.
inline double motion_limit(const Gap& gap, int side, double longest, double share) {
  return std::min(longest, share * std::min(gap.length(), gap.patch[side]));
}

}  // namespace adhesis
