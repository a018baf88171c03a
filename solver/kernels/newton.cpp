#include "newton.hpp"

#include "signals.hpp"

namespace adhesis {

Equilibrium find_equilibrium(LinearResponse& response, Vector ends, double prescribed,
                             double reach, bool strict, const EdgeLaw& law, const Model& model) {
  const int edges = int(ends.size());
  Equilibrium out;
  const Flags none_held(edges);
  Vector travelled(edges), step(edges), moved(edges);
  double last = infinity;
  bool judged_again = false;
  double pressure = response.pressure_at(prescribed, model.device);
  while (true) {
    check_signals();
    ++out.corrections;
    if (!move_references(response, ends, none_held, pressure, prescribed, law, model)) {
      out.is_outgrown = true;
      break;
    }
    out.at = response.solve(prescribed, law, model.device);
    pressure = out.at.pressure;
    if (!std::isfinite(pressure)) break;
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
    const bool stalled = size <= law.field_error && size > STALLED_SHARE * last;
    // not written as > : a size that is no number is a failure, too
    const double most = std::max(HIERARCHICAL_NEWTON_GROWTH * last, law.rest_step);
    const bool within = size <= std::min(reach, most);
    if (!(within && largest(travelled) <= reach && shortest_length(moved) > 0)) break;
    ends = moved;
    const bool at_rest = stalled || (!strict && size <= law.rest_step);
    if (at_rest || !any_outdated(response, ends, law)) {
      out.found = true;
      break;
    }
    if (out.corrections == MOST_CORRECTIONS) break;
    last = size;
  }
  out.potential = response.potential_at(pressure);
  out.references = response.nodes.gaps;
  out.orders = response.nodes.orders;
  out.ends = ends;
  return out;
}

}  // namespace adhesis
