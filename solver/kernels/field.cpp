#include "field.hpp"

#include "cholesky.hpp"

namespace adhesis {

namespace {

// w A⁻¹ w of a gap: its response to potentials with the edges held.
void weigh_inverse(const double* inverse, const GaussRule& rule, double* response) {
  const int m = rule.count;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < m; ++j)
      response[i * m + j] = rule.weights[i] * inverse[i * m + j] * rule.weights[j];
}

Tree build_tree(const Nodes& nodes, double digits) {
  Tree tree(nodes, digits);
  for (int k = 0; k < nodes.gap_count(); ++k) tree.place_gap(nodes, k);
  for (int run = tree.count; run < tree.run_count(); ++run) tree.place_charges(run);
  return tree;
}

// Multiply a column by the inverse diagonal blocks.
Vector apply_inverse(const Nodes& nodes, const Unset& inverse, const Vector& x) {
  Vector out(x.size());
  for (int k = 0; k < nodes.gap_count(); ++k) {
    const int m = nodes.size_of(k), first = nodes.offset[k];
    for (int i = 0; i < m; ++i)
      out[first + i] = dot(&inverse[nodes.square[k] + i * m], &x[first], m);
  }
  return out;
}

// Apply (B + G)⁻¹ to a load.
Vector solve_load(const Nodes& nodes, const Unset& inverse, const Tree& tree, const Vector& weights,
                  const Vector& load) {
  const int n = nodes.size();
  Charges charges(tree.size());
  Vector potential(tree.size());
  Vector solved = apply_inverse(nodes, inverse, load);
  for (int i = 0; i < n; ++i) charges.isolated[i] = weights[i] * solved[i];
  for (int run = tree.count; run < tree.run_count(); ++run) tree.charge(run, charges);
  tree.pass_down(Flags(tree.run_count(), true), {&charges, 1}, {&potential, 1});
  Vector rest(n);
  for (int i = 0; i < n; ++i) rest[i] = load[i] - weights[i] * potential[i];
  return apply_inverse(nodes, inverse, rest);
}

}  // namespace

Vector edge_openings(const Vector& f, const Nodes& nodes, const Equations& equations,
                     bool with_end_terms) {
  Vector out(2 * nodes.gap_count());
  for (int e = 0; e < int(out.size()); ++e) {
    const int k = e / 2, side = e % 2;
    const Vector& end_values = gauss_rules()[nodes.orders[k]].end_values[side];
    double value = dot(end_values.data(), &f[nodes.offset[k]], nodes.size_of(k));
    if (with_end_terms) value -= equations.end_terms[k][side][0];
    out[e] = std::sqrt(2 * nodes.slope[k][side]) * value;
  }
  return out;
}

Field solve_field(const Vector& ends, double prescribed, const Integers& orders,
                  const FieldModel& model) {
  const std::vector<GaussRule>& rules = gauss_rules();
  const std::vector<Gap> gaps = map_gaps(ends);
  const int count = int(gaps.size());
  Field field(model);
  field.edge_opening.assign(ends.size(), not_a_number);
  if (!in_order(gaps)) return field;
  field.nodes = Nodes(gaps, orders);
  field.equations = allocate_equations(field.nodes);
  const Nodes& nodes = field.nodes;
  const int n = nodes.size();
  const Unset inverse = unset(nodes.square.back());
  for (int k = 0; k < count; ++k) {
    fill_gap(k, field.nodes, field.equations, model);
    const int at = nodes.square[k];
    if (!invert_definite(&field.equations.blocks[at], nodes.size_of(k), &inverse[at])) return field;
  }
  Tree tree = build_tree(nodes, model.digits);
  Vector weights(n);
  for (int k = 0; k < count; ++k) {
    const GaussRule& rule = rules[nodes.orders[k]];
    std::copy(rule.weights.begin(), rule.weights.end(), weights.begin() + nodes.offset[k]);
    weigh_inverse(&inverse[nodes.square[k]], rule, &tree.response[tree.runs[k].response]);
  }
  for (int run = count; run < tree.run_count(); ++run) tree.factor(run);
  field.solved = {solve_load(nodes, inverse, tree, weights, field.equations.load),
                  solve_load(nodes, inverse, tree, weights, nodes.weight)};
  const double load_mean = dot(nodes.weight.data(), field.solved[0].data(), n);
  field.unit_mean = dot(nodes.weight.data(), field.solved[1].data(), n);
  auto [weight, compliance] = model.device;
  field.resistance = weight * field.unit_mean + 2 * pi * compliance;
  field.pressure = -(2 * pi * prescribed + weight * load_mean) / field.resistance;
  field.separation = prescribed;
  if (compliance != 0)
    field.separation = -(load_mean + field.pressure * field.unit_mean) / (2 * pi);
  field.scaled_opening.resize(n);
  for (int i = 0; i < n; ++i)
    field.scaled_opening[i] = -field.solved[0][i] - field.pressure * field.solved[1][i];
  field.edge_opening = edge_openings(field.scaled_opening, nodes, field.equations, true);
  return field;
}

}  // namespace adhesis
