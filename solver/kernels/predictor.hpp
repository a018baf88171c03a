// Predict the next points of a branch, and the fold ahead, from two points and their rates.
//
// A branch turns back in d where it folds, while the edge that leads goes on: d is a smooth
// function of how far it has gone, with an extremum at the fold, and so are all other edges. Two
// points with their rates give a cubic of each. Where the way on is long against the way between
// them, the rates alone are believed, which is a parabola: then edges move as a δ + 2b sqrt(δ),
// δ = |d - d_c|. If no edge leads, the rates give a parabola in d.
#pragma once

#include "arrays.hpp"

namespace adhesis {

// Two points of a branch, `way` apart in d: ends and rates dn/dd of the edges at the second point,
// and at the one before it.
struct TwoPoints {
  Vector ends, rate, ends_before, rate_before;
  double way;
};

// The edge that leads between two points, and d along its motion.
//
// d is a polynomial of how far the edge goes on, both in units of their ways between the points:
// here·λ + square·λ² + cube·λ³; NaN if no edge leads.
struct LeadingEdge {
  int edge;
  double fastest, gone;  // |dn/dd| at the second point, and how far it has gone between them
  double here, square, cube;
  double fold, fold_distance;  // where the polynomial has its extremum, and that distance in d
};

// Find the leading edge, and the fold ahead.
//
// Of the edges that are not much slower than the fastest it is the one that comes to a fold first;
// the fastest, if none does.
LeadingEdge leading_edge(const TwoPoints& points);

// The fold ahead that others lead to than the leading edge: their edge, -1 for none, and distance.
struct OtherFold {
  int edge = -1;
  double distance = infinity;
};

// Find the nearest fold ahead that other gaps lead to than the leading edge's and those beside it.
OtherFold other_fold(const TwoPoints& points, int leading);

// Predict the ends at a distance `on` in d from the second point.
Vector predict_ends(const TwoPoints& points, double on, const LeadingEdge& leading);

}  // namespace adhesis
