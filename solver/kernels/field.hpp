// Elastic field of given gaps: equation (1) of gap_field.py, solved on the tree of gaps.
#pragma once

#include <optional>

#include "tree.hpp"

namespace adhesis {

struct Field {
  FieldModel model;
  Nodes nodes;
  Equations equations;
  Pair solved;                       // (B + G)⁻¹ of S~ and of X
  double unit_mean = not_a_number;   // Xᵀ (B + G)⁻¹ X
  double resistance = not_a_number;  // -2π/resistance is ∂p/∂d at fixed edges
  double pressure = not_a_number;    // p; NaN, as are all C, if there is no field
  double separation = not_a_number;  // q0 s
  Vector scaled_opening;             // f: the openings over sqrt(1-η²)
  Vector edge_opening;               // C at each edge

  explicit Field(const FieldModel& model) : model(model) {}
};

// Solve the field of gaps with these ends.
Field solve_field(const Vector& ends, double prescribed, const Integers& orders,
                  const FieldModel& model);

// Evaluate C = sqrt(2 dη/dθ) f(±1) at every gap end, less the terms of higher modes if asked for.
Vector edge_openings(const Vector& f, const Nodes& nodes, const Equations& equations,
                     bool with_end_terms);

}  // namespace adhesis
