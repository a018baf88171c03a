// Bound the clearance left in gaps since they were last searched for minima.
//
// The fine opening of a gap costs as much as many fields, and most gaps are far from touching.
// Inside a gap the surface is free: between two states with nearly the same edges its opening
// changes smoothly, so the nodes of the field show by how much it has closed. Only beside an edge
// that moves there is more: C sqrt(r) changes by C δ/(2 sqrt(r)), for which that a fourth of the
// shortest wave away is taken.
//
// A gap is searched again when a good part of its clearance can be gone, or of its opening at any
// node: a minimum may appear there, whatever others there are. Beside the ends of a gap openings
// are small in any case; there it is searched again when one is negative.
//
// Where surfaces attract each other from a range on, a clearance is the opening less the range. A
// gap with a minimum within the range is always searched again: whether a patch grows there
// depends on more than its opening.
#pragma once

#include <memory>

#include "opening.hpp"

namespace adhesis {

// Lengths of a search, in units of 1/q0.
struct SearchLengths {
  double wave;                // λ_min
  double closing_per_motion;  // closing beside an edge over the motion of the edge
  double surface;             // Γ
  double narrowest;           // of a seed
  double longest_step;        // of an edge, and the widest seed
  double range;               // gap from which on surfaces attract each other
};

// A gap as it was when it was last searched; its clearance is infinite where there is no minimum.
struct SearchedGap {
  std::array<double, 2> end;
  int order;
  Vector theta, opening;  // nodes, and the opening of the lower modes there
  double clearance;
};

using SearchedGaps = std::vector<std::shared_ptr<const SearchedGap>>;

// Opening left at a minimum before a seed is put; not positive at a touch. A minimum in the range
// of an edge touches at zero, or from where the surfaces between it and the edge part on.
double clearance_of(const Minimum& minimum, const SearchLengths& lengths);

// Width of the seed at a touch with this curvature, of surfaces with energy Γ.
double seed_width(double curvature, const SearchLengths& lengths);

struct Search {
  double least = infinity;  // clearance left in the gaps that were not searched
  int count = 0;            // of gaps that were searched
  std::vector<Minimum> minima;
  SearchedGaps searched;
};

// Find the minima of a field, searching only gaps that may have closed.
Search search(const Field& field, const SearchedGaps& searched, const SearchLengths& lengths);

}  // namespace adhesis
