#include "equilibrium.hpp"

#include "cholesky.hpp"
#include "condensed.hpp"

namespace adhesis {

namespace {

// Put a gap, filled in already, into the tree; returns whether it has a field.
bool place_gap(LinearResponse& response, int k) {
  const Nodes& nodes = response.nodes;
  const int square = nodes.square[k], m = nodes.size_of(k);
  response.tree.place_gap(nodes, k);
  return invert_definite(&response.equations.blocks[square], m, &response.inverse[square]);
}

// Interpolate a potential g at θ from G = g dθ/dη at the nodes of a gap; beyond an end of the gap
// it is the potential at that end.
double interpolate_potential(const Gap& gap, const GaussRule& rule, const double* potential,
                             double theta) {
  MappedPoint at = eta_at(gap, std::min(std::max(theta, gap.end[0]), gap.end[1]));
  double above = 0, below = 0, sign = 1;
  for (int i = 0; i < rule.count; ++i) {
    double apart = at.eta - rule.eta[i];
    if (apart == 0) return at.slope * potential[i];
    double share = sign * rule.weights[i] / apart;
    above += share * potential[i];
    below += share;
    sign = -sign;
  }
  return at.slope * above / below;
}

// Move the reference of a gap, placed already, with the potential there; `old` is where it was,
// with nodes of `old_rule`.
void renew_gap(LinearResponse& response, int k, const Gap& old, const GaussRule& old_rule,
               double pressure, const EdgeLaw& law) {
  const Nodes& nodes = response.nodes;
  const int first = nodes.offset[k];
  response.about_pressure[k] = pressure;
  Vector known(old_rule.count);
  for (int i = 0; i < old_rule.count; ++i) known[i] = response.potential_at(first + i, pressure);
  for (int node = first; node < first + nodes.size_of(k); ++node)
    response.about[node] = response.tree.stretch[node] *
                           interpolate_potential(old, old_rule, known.data(), nodes.theta[node]);
  response.linearise(k, law);
}

// Place the runs anew whose halves have moved; returns whether there is room for their charges.
bool place_runs_anew(LinearResponse& response, const Flags& changed, const FieldModel& model) {
  Tree& tree = response.tree;
  Flags moved(changed);
  moved.resize(tree.run_count());
  for (int run = tree.count; run < tree.run_count(); ++run) {
    auto [one, two] = tree.runs[run].half;
    if (!(moved[one] || moved[two])) continue;
    if (!tree.place_anew(run, response.nodes.gaps, model.digits, moved)) return false;
  }
  return true;
}

}  // namespace

Outdated is_outdated(const LinearResponse& response, int k, const Gap& gap, const EdgeLaw& law) {
  const Gap& known = response.nodes.gaps[k];
  const double softness = response.softness[k];
  // in other potentials than those of its reference its edges follow otherwise
  const double balanced = UNBALANCED * law.critical;
  Outdated out = {false, false};
  for (int side = 0; side < 2; ++side) {
    const double moved = std::abs(gap.end[side] - known.end[side]);
    const double before = known.patch[side], patch = gap.patch[side];
    const double least = std::min(known.length(), before);
    const double scale = std::min(least, REFERENCE_SCALE * law.longest_step);
    double allowed = std::min(std::sqrt(law.field_error * scale) / (softness * softness),
                              REFERENCE_SHARE * least);
    // an edge acts on the field to second order only, in which all have the same sign
    if (law.critical == 0) allowed = law.field_error;
    // not written as > : references that are no numbers are no references
    if (!(moved <= std::max(law.newton_tolerance, allowed))) out.changed = true;
    if (!(moved <= REFERENCE_FAR * least)) out.far = true;
    if (!(std::abs(patch - before) <= REFERENCE_PATCH * std::min(before, patch)))
      out.changed = true;
    const Edge& edge = response.edges[2 * k + side];
    const bool pinned = law.pins() && edge.held;
    if (std::abs(edge.imbalance(side).value) * softness > balanced && balanced > 0 && !pinned)
      out.changed = true;
  }
  return out;
}

bool any_outdated(const LinearResponse& response, const Vector& ends, const EdgeLaw& law) {
  const std::vector<Gap> gaps = map_gaps(ends);
  for (int k = 0; k < int(gaps.size()); ++k)
    if (is_outdated(response, k, gaps[k], law).changed) return true;
  return false;
}

bool move_references(LinearResponse& response, const Vector& ends, const EdgeStates& states,
                     double pressure, double prescribed, const EdgeLaw& law,
                     const FieldModel& model, bool raises, bool is_lost) {
  const std::vector<Gap> gaps = map_gaps(ends);
  Nodes& nodes = response.nodes;
  const std::vector<Gap> before = nodes.gaps;
  const Integers orders = nodes.orders;
  const int count = nodes.gap_count();
  Flags changed(count), far(count);
  bool has_room = true;
  for (int k = 0; k < count; ++k) {
    const Outdated outdated = is_outdated(response, k, gaps[k], law);
    const int order = raises ? choose_order(gaps[k], model.digits) : 0;
    far[k] = outdated.far;
    changed[k] = outdated.changed || order > orders[k];
    if (!changed[k]) continue;
    nodes.gaps[k] = gaps[k];
    has_room = nodes.raise(k, order) && has_room;
  }
  EdgeStates both(states);
  for (int e = 0; e < 2 * count; ++e)
    if (far[e / 2]) both.held[e] = true;
  hold_edges(response, ends, both);
  for (int k = 0; k < count; ++k)
    if (changed[k] && has_room) fill_gap(k, nodes, response.equations, model);
  bool renewed = has_room;
  for (int k = 0; k < count; ++k) {
    if (!(changed[k] && renewed)) continue;
    renewed = place_gap(response, k);
    if (renewed) renew_gap(response, k, before[k], gauss_rules()[orders[k]], pressure, law);
  }
  if (!(renewed && place_runs_anew(response, changed, model))) {
    // While edges move towards one state, a gap must not lose modes again, or the field's error
    // would drive them to and fro.
    auto anew = set_up_response(ends, prescribed, nodes.orders, law, model);
    if (!anew) return false;
    response = std::move(*anew);
    hold_edges(response, ends, states);
    return true;
  }
  response.displaced = indices(is_lost ? changed : far);
  if (both.held != states.held) {  // their potentials are needed before their edges can follow
    response.solve(prescribed, law, model.device);
    hold_edges(response, ends, states);
  }
  return true;
}

void hold_edges(LinearResponse& response, const Vector& ends, const EdgeStates& states) {
  const auto& [held, recedes] = states;
  const Vector motion = response.motion_to(ends);
  for (int e = 0; e < int(ends.size()); ++e) {
    Edge& edge = response.edges[e];
    const double here = held[e] ? motion[e] : 0;
    if (bool(held[e]) != edge.held || here != edge.here || bool(recedes[e]) != edge.recedes)
      response.is_stale[e / 2] = true;
    edge.recedes = recedes[e];
    edge.held = held[e];
    edge.here = here;
  }
}

bool settle_response(LinearResponse& response, const Vector& ends, double prescribed,
                     const EdgeLaw& law, const FieldModel& model) {
  const double pressure = response.pressure_at(prescribed, model.device);
  if (!move_references(response, ends, states_at(ends, law), pressure, prescribed, law, model))
    return false;
  response.solve(prescribed, law, model.device);
  return true;
}

std::optional<LinearResponse> set_up_response(const Vector& ends, double prescribed,
                                              Integers orders, const EdgeLaw& law,
                                              const FieldModel& model) {
  const std::vector<Gap> gaps = map_gaps(ends);
  orders.resize(gaps.size());
  for (size_t k = 0; k < gaps.size(); ++k)
    orders[k] = std::max(orders[k], choose_order(gaps[k], model.digits));
  if (!in_order(gaps)) return std::nullopt;
  LinearResponse out(Nodes(gaps, std::move(orders), ROOM), model.digits);
  const int count = out.gap_count();
  for (int k = 0; k < count; ++k) {
    fill_gap(k, out.nodes, out.equations, model);
    if (!place_gap(out, k)) return std::nullopt;
  }
  for (int run = count; run < out.tree.run_count(); ++run) out.tree.place_charges(run);
  // solved with all edges held, and linearised there
  for (Edge& edge : out.edges) edge.held = true;
  for (int k = 0; k < count; ++k) {
    out.linearise(k, law);
    out.displaced.push_back(k);
  }
  if (!std::isfinite(out.solve(prescribed, law, model.device).pressure)) return std::nullopt;
  for (Edge& edge : out.edges) edge.held = law.pins();  // which are pinned is not known yet
  return out;
}

namespace {

// Pin edges that come back to their memory, and release those whose opening no longer holds them;
// returns whether there are any.
bool pin_edges(LinearResponse& response, Vector& ends, EdgeStates& states,
               const ResponseSolution& now, const EdgeLaw& law, const FieldModel& model) {
  auto& [pinned, recedes] = states;
  const Integers edges = indices(pinned);
  const Vector residual = HeldEdges(response, edges, now, model.device).residual();
  const Vector here = response.motion_to(ends);
  bool changed = false;
  for (int e = 0; e < int(ends.size()); ++e) {
    const double way = outwards(e) * (ends[e] - law.memory[e]) + now.motion[e] - here[e];
    if (pinned[e] || (recedes[e] ? way <= 0 : way >= 0)) continue;
    ends[e] = law.memory[e];
    pinned[e] = changed = true;
  }
  const double slack = law.force_error / law.critical;
  for (size_t c = 0; c < edges.size(); ++c) {
    const int e = edges[c];
    const double range = pinning_range(ends[e], law).value;
    recedes[e] = residual[c] > range + slack;
    if (!recedes[e] && !(residual[c] < -slack)) continue;
    pinned[e] = false;
    changed = true;
  }
  return changed;
}

// Compute where the openings of pinned edges lie between both critical ones, and the rates.
void share_openings(Equilibrium& out, LinearResponse& response, const Flags& pinned,
                    const EdgeLaw& law, const FieldModel& model) {
  const Integers edges = indices(pinned);
  const HeldEdges held(response, edges, out.at, model.device);
  const Vector residual = held.residual(), closing = held.closing_by_pressure();
  const double by_pressure = response.prescribed_by_pressure(model.device);
  out.pinned_share.assign(out.ends.size(), not_a_number);
  out.pinned_rate = out.pinned_share;
  for (size_t c = 0; c < edges.size(); ++c) {
    const double range = pinning_range(out.ends[edges[c]], law).value;
    out.pinned_share[edges[c]] = residual[c] / range;
    out.pinned_rate[edges[c]] = -closing[c] * 2 * pi / by_pressure / range;
  }
}

}  // namespace

Equilibrium find_equilibrium(LinearResponse& response, Vector ends, double prescribed, double reach,
                             bool strict, const EdgeLaw& law, const FieldModel& model) {
  const int edges = int(ends.size());
  Equilibrium out;
  EdgeStates states = states_at(ends, law, 0);  // one that is predicted to move is not held
  Vector travelled(edges), step(edges), moved(edges);
  double last = infinity;
  bool judged_again = false;
  double pressure = response.pressure_at(prescribed, model.device);
  while (true) {
    check_signals();
    ++out.corrections;
    if (!move_references(response, ends, states, pressure, prescribed, law, model)) {
      out.at = {};
      break;
    }
    out.at = response.solve(prescribed, law, model.device);
    pressure = out.at.pressure;
    if (!std::isfinite(pressure)) break;
    if (law.pins() && pin_edges(response, ends, states, out.at, law, model)) {
      if (out.corrections >= MOST_CORRECTIONS) break;
      last = infinity;
      continue;
    }
    if (strict && !out.at.stable) {
      if (judged_again || !any_outdated(response, ends, law)) break;
      judged_again = true;  // the first time the tangent was that of an outdated reference
      continue;
    }
    const Vector here = response.motion_to(ends);
    for (int e = 0; e < edges; ++e) {
      step[e] = out.at.motion[e] - here[e];
      travelled[e] += step[e];
      moved[e] = response.nodes.gaps[e / 2].end[e % 2] + outwards(e) * out.at.motion[e];
    }
    const double size = largest(step);
    const bool stalled = size <= law.field_error && size > NEWTON_SHRINKS * last;
    const double longest = std::max(NEWTON_SHRINKS * last, law.rest_step);
    const bool within = size <= std::min(reach, longest);
    // not written as <= : the length beside an edge that is no number is none
    if (!(within && largest(travelled) <= reach && shortest_length(moved) > 0)) break;
    ends = moved;
    const bool at_rest = stalled || (!strict && size <= rest_within(ends, law));
    if (at_rest || !any_outdated(response, ends, law)) {
      out.found = true;
      break;
    }
    if (out.corrections >= MOST_CORRECTIONS) break;
    last = size;
  }
  response.is_lost = !out.found;
  out.ends = ends;
  if (out.found && law.pins()) share_openings(out, response, states.held, law, model);
  return out;
}

}  // namespace adhesis
