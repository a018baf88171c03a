#include "descent.hpp"

#include <optional>

#include "edge_model.hpp"

namespace adhesis {

namespace {

// Measure by how much the openings of the model are wrong, in units of what is allowed.
//
// `residual` is C - C_c of the field at the end. On the way the errors are taken to grow as the
// square of its length, and far from balance more is allowed.
double model_error(const ModelFlow& flow, const Vector& residual, const Integers& edges,
                   const Vector& ends, const EdgeLaw& law, const Panels& panels) {
  double worst = 0;
  for (size_t e = 0; e < residual.size(); ++e) {
    const double critical = critical_opening(ends[edges[e]], law, panels).value;
    const double at_end = std::abs(residual[e] + critical - flow.opening[e]);
    for (size_t i = 0; i < flow.lengths.size(); ++i) {
      const double share = flow.lengths[i] / flow.lengths.back();
      const double error = share * share * at_end;
      const double unbalance = std::max(std::abs(flow.residuals[i][e]) - error, 0.0);
      const double allowed = MODEL_ERROR * law.critical + MODEL_SHARE * unbalance;
      // not written as > : an error that is no number is too large
      if (!(error <= worst * allowed)) worst = error / allowed;
    }
  }
  return worst;
}

// Choose the next reach after a long step of this length, in longest steps, and error.
double next_reach(double before, double length, double error) {
  const double safe = REACH_SAFETY / std::sqrt(std::max(error, 1e-9));
  const double factor = std::min(REACH_GROWTH, std::max(REACH_CUT, safe));
  double reach = length * factor;
  if (error <= 1) reach = std::max(reach, factor >= 1 ? before : 0.0);
  return std::min(reach, LONGEST_REACH);
}

// Compute the norm of the forces C_c² - C |C| from C - C_c at some edges.
double force_at(const Vector& residual, const Integers& edges, const Vector& ends,
                const EdgeLaw& law, const Panels& panels) {
  double square = 0;
  for (size_t i = 0; i < edges.size(); ++i) {
    const double critical = critical_opening(ends[edges[i]], law, panels).value;
    const double opening = residual[i] + critical;
    const double force = critical * critical - opening * std::abs(opening);
    square += force * force;
  }
  return std::sqrt(square);
}

// Damp the edges that run by so many times the tangent of their gaps.
Vector damp_running(const Flags& runs, double times, const LinearResponse& response) {
  Vector damping(runs.size());
  for (size_t e = 0; e < runs.size(); ++e) {
    const auto& tangent = response.edges[e].tangent;
    if (runs[e]) damping[e] = times * (std::abs(tangent[0]) + std::abs(tangent[1]));
  }
  return damping;
}

bool let_run(Flags& runs, int edge) {
  if (runs[edge]) return false;
  runs[edge] = true;
  return true;
}

// Let the edges of gaps next to a fold run, or those of all; returns whether they are more.
bool run_soft(Flags& runs, const LinearResponse& response, bool everywhere) {
  const double softest = largest(response.softness);
  bool more = false;
  for (int e = 0; e < int(runs.size()); ++e)
    if (everywhere || response.softness[e / 2] > SOFT_SHARE * softest) more |= let_run(runs, e);
  return more;
}

// Let edges run that are out of balance or move far; returns whether they are more.
bool run_more(Flags& runs, const LinearResponse& response, const ResponseSolution& now,
              const EdgeLaw& law) {
  bool more = false;
  for (int e = 0; e < int(runs.size()); ++e) {
    const Edge& edge = response.edges[e];
    const bool unbalanced = std::abs(edge.residual) > RUNNING * law.critical;
    const bool far = std::abs(now.motion[e] - edge.here) > FOLLOWING * law.longest_step;
    if (unbalanced || far) more |= let_run(runs, e);
  }
  return more;
}

// Let edges run that would follow too far; returns whether there are any.
bool run_far(Flags& runs, const Integers& edges, const Vector& way, const EdgeLaw& law) {
  Flags inside(runs.size());
  for (int e : edges) inside[e] = true;
  bool more = false;
  for (int e = 0; e < int(runs.size()); ++e) {
    // written so that NaN is too far
    const bool near = std::abs(way[e]) <= FURTHEST_FOLLOWING * law.longest_step;
    if (!(inside[e] || near)) {
      runs[e] = true;
      more = true;
    }
  }
  return more;
}

// List the edges that run, and those beside them.
Integers beside(const Flags& runs) {
  const int count = int(runs.size());
  Integers out;
  for (int e = 0; e < count; ++e)
    if (runs[e] || runs[(e + 1) % count] || runs[(e + count - 1) % count]) out.push_back(e);
  return out;
}

// A step of the edges that run, the others following.
struct Step {
  ModelFlow flow;
  Vector way;   // motions of all edges
  Vector ends;  // where they end
  bool vanished;
};

}  // namespace

Descent descend(LinearResponse& response, Vector ends, double prescribed, int most_steps,
                bool equal_speeds, Flags& runs, double reach, const EdgeLaw& law,
                const Model& model) {
  const Panels& panels = *model.panels;
  const Device& device = model.device;
  Descent out;
  Integers edges;  // that run, and those beside them
  for (int e = 0; e < int(runs.size()); ++e)
    if (runs[e]) edges.push_back(e);
  Vector before = ends;
  Step step;
  double pressure = response.pressure_at(prescribed, device);
  double strongest = 0, damped = LEAST_DAMPING;
  bool moved = true, judges = false;
  Vector damping = damp_running(runs, damped, response);
  while (out.steps < most_steps) {
    if (moved) {
      if (!move_references(response, ends, damping, pressure, prescribed, law, model)) {
        out.event = DescentEvent::outgrown;
        break;
      }
    } else {
      condense_gaps(response, damp_edges(response, ends, damping), model);
    }
    ++out.steps;
    moved = false;
    ResponseSolution now = response.solve(prescribed, law, device);
    if (!std::isfinite(now.pressure)) {
      out.event = DescentEvent::no_field;
      break;
    }
    if (!now.stable) {
      if (!run_soft(runs, response, damped > DAMPING_GROWTH)) damped *= DAMPING_GROWTH;
      if (damped > MOST_DAMPING) {
        if (!judges) {
          out.event = DescentEvent::no_field;
          break;
        }
        ends = before;  // the step was too long
        judges = false;
        moved = true;
        damped = LEAST_DAMPING;
        reach = std::max(REACH_CUT * reach, SHORTEST_REACH);
      }
      damping = damp_running(runs, damped, response);
      continue;
    }
    pressure = now.pressure;
    std::optional<CondensedEdges> condensed;
    if (judges) {
      judges = false;
      condensed.emplace(response, edges, now, device);
      const double error =
          model_error(step.flow, condensed->residual(now), edges, ends, law, panels);
      const double length = largest(step.flow.motion) / law.longest_step;
      reach = std::max(next_reach(reach, length, error), SHORTEST_REACH);
      if (error > 1 && length > 1.5 * SHORTEST_REACH) {
        ends = before;
        moved = true;
        continue;
      }
    }
    if (run_more(runs, response, now, law)) {
      damping = damp_running(runs, damped, response);
      continue;
    }
    const Integers some = beside(runs);
    if (!condensed || some.size() != edges.size()) {
      edges = some;
      condensed.emplace(response, edges, now, device);
    }
    const Vector residual = condensed->residual(now);
    const Matrix tangent = condensed->tangent();
    const double force = force_at(residual, edges, ends, law, panels);
    strongest = std::max(strongest, force);
    const std::vector<Gap> gaps = map_gaps(ends);
    const int count = int(edges.size());
    bool is_long = reach >= LEAST_REACH && !near_balance(force, strongest, law);
    bool far = false;
    while (true) {
      EdgeModel openings(edges, ends, residual, tangent, law, panels);
      const double longest = (is_long ? reach : std::min(reach, SHORT_REACH)) * law.longest_step;
      Vector limit(count), to(count);
      for (int i = 0; i < count; ++i)
        limit[i] = motion_limit(gaps[edges[i] / 2], edges[i] % 2, longest,
                                is_long ? LONG_CLOSING : CLOSING_SHARE);
      step.flow = flow_through(openings, limit, equal_speeds, is_long, strongest, law);
      for (int i = 0; i < count; ++i)
        to[i] = response.edges[edges[i]].here + step.flow.motion[i];
      step.way = condensed->follow(to, now, pressure);
      for (size_t e = 0; e < step.way.size(); ++e) step.way[e] -= response.edges[e].here;
      for (int i = 0; i < count; ++i) step.way[edges[i]] = step.flow.motion[i];  // no rounding
      far = run_far(runs, edges, step.way, law);
      step.ends = move_edges(ends, step.way);
      step.vanished = shortest_length(step.ends) < law.smallest;
      const bool runs_on = step.flow.is_at_limit ||
                           largest(step.flow.motion) > RUNNING_LENGTH * law.longest_step;
      if (far || !is_long || (runs_on && !step.vanished)) break;
      is_long = false;
      now = response.solve(prescribed, law, device);
    }
    if (far) {
      damping = damp_running(runs, damped, response);
      continue;
    }
    judges = count > 0;
    before = ends;
    ends = step.ends;
    moved = true;
    if (step.vanished) {
      out.event = DescentEvent::vanished;
      break;
    }
    if (largest(step.way) < law.rest_step && !step.flow.is_at_limit) {
      out.event = DescentEvent::at_rest;
      break;
    }
    damping = damp_running(runs, damped, response);
  }
  out.ends = ends;
  out.reach = reach;
  return out;
}

}  // namespace adhesis
