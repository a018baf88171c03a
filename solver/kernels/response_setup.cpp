#include "cholesky.hpp"
#include "renewal.hpp"

namespace adhesis {

namespace {

// Find the gaps of a response that serve for these, one for each; -1 for none.
Integers find_known_gaps(const LinearResponse& known, const std::vector<Gap>& gaps,
                         const EdgeLaw& law, const Model& model) {
  const std::vector<Gap>& references = known.nodes.gaps;
  const std::vector<GaussRule>& rules = gauss_rules();
  Integers found(gaps.size(), -1);
  int j = 0;
  for (int k = 0; k < int(gaps.size()); ++k) {
    while (j < int(references.size()) - 1 && !(references[j].end[1] > gaps[k].end[0])) ++j;
    const int order = known.nodes.orders[j];
    const double wanted = model.digits / convergence_rate(gaps[k]);
    if (rules[order].count < wanted && order < int(rules.size()) - 1) continue;
    if (!is_outdated(references[j], gaps[k], 1, law).changed) found[k] = j;
  }
  return found;
}

// Raise orders to `least` (which is empty for no bound) where they are below. While edges move
// towards one state, a gap must not lose modes again, or the field's error would drive them to and
// fro.
void raise_orders(Integers& orders, const Integers& least) {
  if (least.size() != orders.size()) return;
  for (size_t k = 0; k < orders.size(); ++k) orders[k] = std::max(orders[k], least[k]);
}

void copy_part(const Vector& from, int first, Vector& to, int into, int count) {
  std::copy_n(from.begin() + first, count, to.begin() + into);
}

void copy_part(const Pair& from, int first, Pair& to, int into, int count) {
  for (int side = 0; side < 2; ++side) copy_part(from[side], first, to[side], into, count);
}

// Copy nodes and equations of gap j of a response to gap k.
void copy_equations(const LinearResponse& known, int j, Nodes& nodes, Equations& equations, int k) {
  const int from = known.nodes.offset[j], to = nodes.offset[k], m = nodes.size_of(k);
  const int square = known.nodes.square[j];
  copy_part(known.nodes.theta, from, nodes.theta, to, m);
  copy_part(known.nodes.weight, from, nodes.weight, to, m);
  copy_part(known.nodes.sine, from, nodes.sine, to, m);
  copy_part(known.nodes.cosine, from, nodes.cosine, to, m);
  nodes.slope[k] = known.nodes.slope[j];
  copy_part(known.equations.blocks, square, equations.blocks, nodes.square[k], m * m);
  copy_part(known.equations.load, from, equations.load, to, m);
  copy_part(known.equations.load_of_slope, from, equations.load_of_slope, to, m);
  equations.end_terms[k] = known.equations.end_terms[j];
}

// Copy the charges and the response of a run, and how its halves act on each other.
void copy_run(const LinearResponse& known, int old, LinearResponse& out, int index) {
  const Tree& source = known.tree;
  Tree& tree = out.tree;
  const Run& from = source.runs[old];
  Run& to = tree.runs[index];
  const int rank = to.rank;
  copy_part(source.theta, from.node, tree.theta, to.node, rank);
  copy_part(source.stretch, from.node, tree.stretch, to.node, rank);
  copy_part(source.response, from.response, tree.response, to.response, rank * rank);
  to.count = from.count;
  for (int column = 0; column < 2; ++column)
    copy_part(known.charges[column].isolated, from.node, out.charges[column].isolated, to.node,
              rank);
  if (to.half[0] < 0) return;
  const Run &one = tree.runs[to.half[0]], &two = tree.runs[to.half[1]];
  const int n = one.rank, m = two.rank;
  copy_part(source.inverse, from.inverse, tree.inverse, to.inverse, n * n);
  copy_part(source.kernel, from.kernel, tree.kernel, to.kernel, n * m);
  const int lift = (n + m) * rank;
  copy_part(source.interpolation, from.interpolation, tree.interpolation, to.interpolation, lift);
  copy_part(source.inner_potential, from.interpolation, tree.inner_potential, to.interpolation,
            lift);
  for (int half = 0; half < 2; ++half) {
    const int theirs = source.runs[from.half[half]].node;
    const Run& own = tree.runs[to.half[half]];
    for (int column = 0; column < 2; ++column)
      copy_part(known.charges[column].potential_of_sibling, theirs,
                out.charges[column].potential_of_sibling, own.node, own.rank);
  }
}

// Copy how a gap and its edges respond, and the reference.
void copy_gap(const LinearResponse& known, int j, LinearResponse& out, int k) {
  const int from = known.nodes.offset[j], to = out.nodes.offset[k], m = out.nodes.size_of(k);
  copy_part(known.inverse, known.nodes.square[j], out.inverse, out.nodes.square[k], m * m);
  out.about_pressure[k] = known.about_pressure[j];
  copy_part(known.about, from, out.about, to, m);
  copy_part(known.scaled_opening, from, out.scaled_opening, to, m);
  copy_part(known.mean_by_potential, from, out.mean_by_potential, to, m);
  for (int side = 0; side < 2; ++side) out.edges[2 * k + side] = known.edges[2 * j + side];
  copy_part(known.motion_by_potential, from, out.motion_by_potential, to, m);
  copy_part(known.opening_by_potential, from, out.opening_by_potential, to, m);
  copy_part(known.charge_by_edge, from, out.charge_by_edge, to, m);
  copy_part(known.held_charge, from, out.held_charge, to, m);
}

}  // namespace

NewResponse set_up_response(const Vector& ends, double prescribed, const Integers& least,
                            const EdgeLaw& law, const Model& model) {
  Integers orders = choose_orders(map_gaps(ends), model.digits);
  raise_orders(orders, least);
  auto [field, factored] = solve_field(ends, prescribed, orders, 2, model);
  const int count = field.nodes.gap_count(), n = field.nodes.size();
  const Vector about = gap_potentials(field);
  NewResponse made = {
      LinearResponse(std::move(field.nodes), std::move(field.equations), std::move(factored.tree)),
      std::isfinite(field.pressure)};
  LinearResponse& out = made.response;
  if (!made.has_field) return made;
  out.inverse = std::move(factored.inverse);
  out.about = about;
  out.about_pressure.assign(count, field.pressure);
  out.scaled_opening = field.scaled_opening;
  std::copy(about.begin(), about.end(), out.potential[0].begin());
  out.mean[1] = -field.unit_mean;
  out.mean[0] =
      dot(out.nodes.weight.data(), out.scaled_opening.data(), n) - field.pressure * out.mean[1];
  for (Edge& edge : out.edges) edge.held = law.pins();  // which are pinned is not known yet
  for (int k = 0; k < count; ++k) out.linearise(k, law);
  out.factor_runs(Flags(count, true));
  return made;
}

NewResponse update_response(const LinearResponse& known, const Vector& ends, double prescribed,
                            const Integers& least, const EdgeLaw& law, const Model& model) {
  std::vector<Gap> gaps = map_gaps(ends);
  const int count = int(gaps.size());
  Integers orders = choose_orders(gaps, model.digits);
  const Integers source = find_known_gaps(known, gaps, law, model);
  const auto fresh = std::count_if(source.begin(), source.end(), [](int k) { return k < 0; });
  if (!in_order(gaps) || double(fresh) > REFERENCE_MOST_FAR * count)
    return set_up_response(ends, prescribed, least, law, model);
  raise_orders(orders, least);
  for (int k = 0; k < count; ++k) {
    if (source[k] < 0) continue;
    gaps[k] = known.nodes.gaps[source[k]];
    orders[k] = known.nodes.orders[source[k]];
  }
  Nodes nodes(std::move(gaps), orders);
  Equations equations = allocate_equations(nodes);
  for (int k = 0; k < count; ++k) {
    if (source[k] < 0)
      fill_gap(k, 2, nodes, equations, model);
    else
      copy_equations(known, source[k], nodes, equations, k);
  }
  auto [halves, same] = pair_again(known.tree.halves(), source);
  Integers rank(same.size(), 0);
  for (size_t run = 0; run < same.size(); ++run)
    if (same[run] >= 0) rank[run] = known.tree.runs[same[run]].rank;
  Tree tree(nodes, halves, rank, model.digits);
  for (int k = 0; k < count; ++k) {
    const Vector& w = gauss_rules()[nodes.orders[k]].weights;
    for (int i = 0; i < nodes.size_of(k); ++i) {
      tree.theta[nodes.offset[k] + i] = nodes.theta[nodes.offset[k] + i];
      tree.stretch[nodes.offset[k] + i] = nodes.weight[nodes.offset[k] + i] / w[i];
    }
  }
  NewResponse made = {LinearResponse(std::move(nodes), std::move(equations), std::move(tree)),
                      false};
  LinearResponse& out = made.response;
  for (int run = 0; run < out.tree.run_count(); ++run) {
    if (same[run] >= 0)
      copy_run(known, same[run], out, run);
    else if (run >= count)
      out.tree.place_charges(run);
  }
  Flags changed(out.tree.run_count()), new_gaps(count);
  for (int run = 0; run < out.tree.run_count(); ++run) changed[run] = same[run] < 0;
  for (int k = 0; k < count; ++k) {
    new_gaps[k] = source[k] < 0;
    out.edges[2 * k].held = out.edges[2 * k + 1].held = new_gaps[k];
    if (source[k] >= 0) {
      copy_gap(known, source[k], out, k);
      continue;
    }
    const int square = out.nodes.square[k];
    if (!invert_definite(&out.equations.blocks[square], out.nodes.size_of(k), &out.inverse[square]))
      return made;
    out.linearise(k, law);
  }
  out.factor_runs(changed);
  const double pressure = out.solve(prescribed, law, model.device).pressure;
  if (!std::isfinite(pressure)) return made;
  for (int k = 0; k < count; ++k) {
    if (new_gaps[k]) {
      out.edges[2 * k].held = out.edges[2 * k + 1].held = law.pins();
      out.linearise_in_current_potential(k, pressure, law);
    }
  }
  out.factor_runs(new_gaps);
  made.has_field = true;
  return made;
}

int count_unknown(const LinearResponse& known, const Vector& ends, const EdgeLaw& law,
                  const Model& model) {
  const Integers found = find_known_gaps(known, map_gaps(ends), law, model);
  return int(std::count(found.begin(), found.end(), -1));
}

}  // namespace adhesis
