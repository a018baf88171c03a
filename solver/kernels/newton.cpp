#include "newton.hpp"

#include "condensed.hpp"

namespace adhesis {

namespace {

// Pin edges that come back to their memory, and release those whose opening no longer holds them;
// returns whether there are any.
bool pin_edges(LinearResponse& response, Vector& ends, EdgeStates& states,
               const ResponseSolution& now, const EdgeLaw& law, const Model& model) {
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
                    const EdgeLaw& law, const Model& model) {
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
                             bool strict, const EdgeLaw& law, const Model& model) {
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
    // not written as > : a size that is no number is a failure, too
    const double longest = std::max(NEWTON_SHRINKS * last, law.rest_step);
    const bool within = size <= std::min(reach, longest);
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
  out.potential = response.potential_at(pressure);
  out.references = response.nodes.gaps;
  out.orders = response.nodes.orders;
  out.ends = ends;
  if (out.found && law.pins()) share_openings(out, response, states.held, law, model);
  return out;
}

}  // namespace adhesis
