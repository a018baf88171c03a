// Predict the next points of a branch, and the fold ahead, from two points and their rates.
//
// A branch turns back in d where it folds, while the edge that leads goes on: d is a smooth
// function of how far it has gone, with an extremum at the fold, and so are all other edges. Two
// points with their rates give a cubic of each. Where the way on is long against the way between
// them, the rates alone are believed, which is a parabola: then edges move as a δ + 2b sqrt(δ),
// δ = |d - d_c|. If no edge leads, the rates give a parabola in d.
#pragma once

#include <optional>
#include <tuple>

#include "arrays.hpp"

namespace adhesis {

// An edge that may lead, -1 for none, and d along its motion.
//
// d is a polynomial of how far the edge goes on, both in units of their ways between the points:
// here·λ + square·λ² + cube·λ³; NaN if it does not lead.
struct LeadingEdge {
  int edge = -1;
  double gone = 0;  // how far it has gone between the points
  double here = not_a_number, square = not_a_number, cube = not_a_number;
  // where the polynomial has its extremum, and that distance in d: of the fold ahead
  double fold = infinity, fold_distance = infinity;
};

// Predict a branch beyond a point and the one before it; beyond one alone it is straight.
class Predictor {
 public:
  const double d;
  const Vector ends, rate;  // at the point; rates are dn/dd
  double fastest;           // largest |dn/dd| of an edge there
  double way = 0;           // in d from the point before; 0 if that is not known
  LeadingEdge leading;

  // `before` are d, rates and ends at the point before; of another number of edges it serves not.
  Predictor(double d, Vector ends, Vector rate,
            std::optional<std::tuple<double, Vector, Vector>> before);

  // Find the edge of the nearest fold ahead that other gaps lead to than the leading edge's and
  // those beside it.
  LeadingEdge other_leading() const;

  // Predict the ends at d.
  Vector predict_ends(double at) const;

  // Step along which the edge that leads is expected to move no further than `most`. Towards a fold
  // it leads near to it, and from next to it (`resolution`) across.
  double reach(double most, double resolution) const;

  // Step across a fold at this distance.
  double across(double distance, double resolution) const;

 private:
  Vector ends_before_, rate_before_;

  LeadingEdge follow_edge(int edge) const;  // take d as a polynomial of its motion
  LeadingEdge find_leading_edge() const;
  bool may_lead(int edge) const;
};

}  // namespace adhesis
