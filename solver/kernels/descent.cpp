#include "descent.hpp"

#include <algorithm>

#include "cholesky.hpp"

namespace adhesis {

namespace {

// Let the softest edge run where the others are not stable; false if all are held. It is sought
// among the gaps of the smallest run of the tree that is not stable.
bool run_weakest(Flags& runs, const LinearResponse& response, const ResponseSolution& now) {
  std::array<int, 2> range = {0, response.gap_count() - 1};
  for (const Run& run : response.tree.runs)
    if (run.count.negative > 0 && run.range[1] - run.range[0] < range[1] - range[0])
      range = run.range;
  int weakest = -1;
  double softest = -1;
  for (int e = 2 * range[0]; e < 2 * range[1] + 2; ++e) {
    const Edge& edge = response.edges[e];
    if (edge.held) continue;
    const double stiff = std::abs(edge.tangent[0]) + std::abs(edge.tangent[1]);
    const double soft = std::abs(now.by_pressure[e] / edge.closing_by_pressure) * stiff;
    if (soft > softest) {
      weakest = e;
      softest = soft;
    }
  }
  if (weakest >= 0) runs[weakest] = true;
  return weakest >= 0;
}

// Let edges run that are out of balance in their references, if these are in a known potential;
// returns whether they are more.
bool run_unbalanced(Flags& runs, const LinearResponse& response, const EdgeLaw& law) {
  if (law.critical == 0) return false;
  bool more = false;
  for (int e = 0; e < int(runs.size()); ++e) {
    const Edge& edge = response.edges[e];
    const bool pinned = law.pins() && edge.held;
    const double residual = edge.imbalance(e % 2).value;
    const auto& displaced = response.displaced;
    if (std::binary_search(displaced.begin(), displaced.end(), e / 2)) continue;
    if (std::abs(residual) > UNBALANCED * law.critical && !pinned && !runs[e])
      runs[e] = more = true;
  }
  return more;
}

// Let edges run that would follow too far, or across their memory; returns whether there are any.
bool run_far(Flags& runs, const LinearResponse& response, const Vector& way, const Vector& ends,
             const EdgeLaw& law) {
  bool more = false;
  for (int e = 0; e < int(runs.size()); ++e) {
    // written so that NaN is too far
    bool near = std::abs(way[e]) <= ELSEWHERE * law.longest_step;
    if (law.pins()) {
      const double gone = way_from_memory(e, ends[e], law);
      near = near && gone * (gone + way[e]) >= 0;
    }
    if (!(response.edges[e].held || near)) runs[e] = more = true;
  }
  return more;
}

// Cut the motion of every edge to its limit; returns whether any was longer.
bool cut(Vector& way, const std::vector<Gap>& gaps, const EdgeLaw& law) {
  bool is_cut = false;
  for (int e = 0; e < int(way.size()); ++e) {
    const double limit = motion_limit(gaps[e / 2], e % 2, law.longest_step, CLOSING_SHARE);
    if (std::abs(way[e]) > limit) {
      way[e] = std::copysign(limit, way[e]);
      is_cut = true;
    }
  }
  return is_cut;
}

// Mark the edges that run, those beside them, and those at their memory, which may be pinned: all
// that are in the model of the openings.
EdgeStates held_edges(const Flags& runs, const Vector& ends, const EdgeLaw& law) {
  const int count = int(runs.size());
  EdgeStates out = states_at(ends, law);
  Flags& some = out.held;
  for (int e = 0; e < count; ++e)
    if (runs[e]) some[e] = some[(e + 1) % count] = some[(e + count - 1) % count] = true;
  return out;
}

// Find the share of a step that keeps every motion within its limit.
double share_within(const EdgeModel& model, const Vector& step, const Vector& limit) {
  double share = 1;
  for (size_t e = 0; e < step.size(); ++e) {
    const double towards = step[e] < 0 ? -1 : 1;
    const double left = limit[e] - towards * model.edges[e].motion;
    if (std::abs(step[e]) > left) share = std::min(share, left / std::abs(step[e]));
  }
  return share;
}

// Shorten steps that lead across the memory: there an edge may be pinned. From there it moves with
// its force only.
void stop_at_memory(const EdgeModel& model, const Vector& force, Vector& step, const EdgeLaw& law) {
  for (size_t c = 0; c < step.size(); ++c) {
    const double way = way_from_memory(model.edges[c].edge, model.edges[c].theta, law);
    if (way == 0) {
      if (step[c] * force[c] <= 0) step[c] = 0;
    } else if (way * (way + step[c]) < 0) {
      step[c] = -way;
    }
  }
}

// Flow through the model.
struct ModelFlow {
  Vector motion;                  // outward motion of the contact at every edge
  Vector opening;                 // C of the model at the end
  Vector lengths;                 // largest motion up to each step
  std::vector<Vector> residuals;  // C - C_c of the model after each step
  bool is_at_limit = false;       // whether an edge came to its limit
};

// Whether forces that were as large as `strongest` have come near a minimum or saddle.
bool near_balance(double force, double strongest, const EdgeLaw& law) {
  const double small = NEAR_BALANCE * law.critical * law.critical;
  return force < small && FORCES_FELL * force < strongest;
}

// Follow the flow ṅ = C_c² - C² by linearly implicit Euler steps, (1/Δτ + H) Δn = force, until an
// edge is at its limit, or at rest; a long step, or near balance. `strongest` is the largest norm
// of the forces on the way so far. A short step ends where the forces have fallen, too: how far a
// shallow minimum is from a saddle only the field shows. With equal speeds, for comparison, the
// time Δτ is each edge's own.
ModelFlow flow_through(EdgeModel& model, const Vector& limit, bool equal_speeds, bool is_long,
                       double strongest, const EdgeLaw& law) {
  const int count = int(model.edges.size());
  ModelFlow out;
  const double longest = (is_long ? 1 : MODEL_SHORT_STEP) * law.longest_step;
  double length = 0, share = 1, first = 0, shortest = law.rest_step;
  for (double own : limit) shortest = std::min(shortest, law.rest_step * own / law.longest_step);
  while (share == 1) {
    const Vector force = model.forces();
    const double total = norm(force);
    strongest = std::max(strongest, total);
    first = std::max(first, total);
    if (is_long ? near_balance(total, strongest, law) : FORCES_FELL * total < first) break;
    const Matrix hessian = model.hessian();
    Vector step = implicit_step(hessian, force, longest, equal_speeds);
    if (law.pins()) stop_at_memory(model, force, step, law);
    if (!(largest(step) > shortest) && (distance_to_minimum(hessian, force) <= shortest ||
                                        total < law.force_error || largest(step) == 0))
      break;
    share = share_within(model, step, limit);
    if (share < 1)
      for (double& motion : step) motion *= share;
    model.advance(step);
    Vector residual(count);
    for (int e = 0; e < count; ++e) {
      residual[e] = model.edges[e].opening - model.edges[e].critical.value;
      length = std::max(length, std::abs(model.edges[e].motion));
    }
    out.residuals.push_back(residual);
    out.lengths.push_back(length);
  }
  for (const MovingEdge& edge : model.edges) {
    out.motion.push_back(edge.motion);
    out.opening.push_back(edge.opening);
  }
  out.is_at_limit = share < 1;
  return out;
}

// Measure by how much the openings of the model are wrong at the end of a long step, in units of
// what is allowed.
//
// `residual` is C - C_c of the field there. On the way the errors are taken to grow as the square
// of its length, and far from balance more is allowed. An error that is no number is infinite.
double model_error(const ModelFlow& flow, const Vector& residual, const Integers& edges,
                   const Vector& ends, const EdgeLaw& law) {
  double worst = 0;
  for (size_t e = 0; e < residual.size(); ++e) {
    const double critical = critical_opening(ends[edges[e]], law).value;
    const double at_end = std::abs(residual[e] + critical - flow.opening[e]);
    for (size_t i = 0; i < flow.lengths.size(); ++i) {
      const double share = flow.lengths[i] / flow.lengths.back();
      const double error = share * share * at_end;
      const double unbalance = std::max(std::abs(flow.residuals[i][e]) - error, 0.0);
      const double allowed = MODEL_ERROR * law.critical + MODEL_SHARE * unbalance;
      if (std::isnan(error / allowed)) return infinity;
      if (error > worst * allowed) worst = error / allowed;
    }
  }
  return worst;
}

// Choose the next reach after a long step of this length, in longest steps, and error.
double next_reach(double before, double length, double error) {
  const double safe = REACH_SAFETY / std::sqrt(std::max(error, 1e-9));
  const double factor = std::min(STEP_GROWTH, std::max(STEP_REDUCTION, safe));
  double reach = length * factor;
  if (error <= 1) reach = std::max(reach, factor >= 1 ? before : 0.0);
  return reach;
}

// Let held edges flow through the model; `strongest` is the largest norm of forces so far.
//
// A long step that comes to rest, or to where a gap or patch vanishes, is taken as a short one.
ModelFlow flow_on(const EdgeModel& start, const Integers& edges, const Vector& ends,
                  double strongest, double reach, bool equal_speeds, const EdgeLaw& law) {
  const int count = int(edges.size());
  const double force = norm(start.forces());
  const std::vector<Gap> gaps = map_gaps(ends);
  bool is_long = reach >= LEAST_REACH && !near_balance(force, strongest, law);
  while (true) {
    EdgeModel openings = start;
    const double longest = (is_long ? reach : std::min(reach, 1.0)) * law.longest_step;
    const double share = is_long ? LONG_CLOSING : CLOSING_SHARE;
    Vector limit(count), motion(ends.size());
    for (int i = 0; i < count; ++i)
      limit[i] = motion_limit(gaps[edges[i] / 2], edges[i] % 2, longest, share);
    ModelFlow flow = flow_through(openings, limit, equal_speeds, is_long, strongest, law);
    for (int i = 0; i < count; ++i) motion[edges[i]] = flow.motion[i];
    const bool vanished = shortest_length(move_edges(ends, motion)) < law.smallest;
    const bool runs_on = flow.is_at_limit || largest(motion) > FOLLOWING * law.longest_step;
    if (!is_long || (runs_on && !vanished)) return flow;
    is_long = false;
  }
}

// Whether edges that have run from `start` took much force C_c² - C² from each other.
//
// By the tangent at their end, to first order. The order of both ends of a gap or patch that has
// vanished does not matter.
bool may_race(const Integers& edges, const Matrix& tangent, const Vector& start, const Vector& ends,
              const EdgeLaw& law) {
  for (int i = 0; i < tangent.n; ++i) {
    const int e = edges[i];
    const double way = outwards(e) * (ends[e] - start[e]);
    if (std::abs(way) < law.longest_step) continue;
    double taken = 0;
    for (int j = 0; j < tangent.n; ++j) {
      const int f = edges[j];
      const double apart = std::abs(ends[e] - ends[f]);
      if (i == j || std::min(apart, 2 * pi - apart) < law.smallest) continue;
      const double along = outwards(f) * (ends[f] - start[f]);
      if (std::abs(along) > law.longest_step) {
        const double force = law.critical * (tangent(i, j) + tangent(j, i)) * along;
        // written so that a force that is no number stays one
        taken += way * force < 0 ? 0 : std::copysign(1, way) * force;
      }
    }
    // not written as > : a force that is no number may be large
    if (!(taken <= HELD_BACK * law.critical * law.critical)) return true;
  }
  return false;
}

}  // namespace

double distance_to_minimum(const Matrix& hessian, const Vector& force) {
  Matrix factor = hessian;
  if (!factor_rows(factor.values.data(), factor.n)) return infinity;
  Vector step = force;
  solve_column(factor.values.data(), factor.n, step.data());
  return largest(step);
}

Vector implicit_step(const Matrix& hessian, const Vector& force, double longest,
                     bool equal_speeds) {
  const int n = hessian.n;
  const double strongest = largest(force);
  Vector step(n);
  for (double growth = 1 / longest; growth < infinity;) {
    Matrix factor = hessian;
    for (int e = 0; e < n; ++e) {
      double own = equal_speeds ? std::max(std::abs(force[e]), SLOWEST * strongest) : strongest;
      factor(e, e) += growth * own;
    }
    if (!factor_rows(factor.values.data(), n)) {
      growth /= STEP_REDUCTION;
      continue;
    }
    step = force;
    solve_column(factor.values.data(), n, step.data());
    const double size = largest(step);
    if (size <= longest) break;
    for (double& motion : step) motion *= longest / size;
    growth *= std::min(1 / STEP_REDUCTION, 1.1 * size / longest);
  }
  return step;
}

Descent descend(LinearResponse& response, Vector ends, const Vector& start, double prescribed,
                int most_steps, bool equal_speeds, const EdgeLaw& law, const FieldModel& model) {
  const Panels& panels = *model.panels;
  const LoadingDevice& device = model.device;
  EdgeLaw loose = law;  // references need not be more exact than a rest
  if (law.critical > 0) loose.field_error = std::max(law.field_error, law.rest_step);
  Flags runs(ends.size());
  Descent out;
  double reach = FIRST_REACH;  // of the next long step, in longest steps
  EdgeStates states = held_edges(runs, ends, law);
  Integers edges = indices(states.held), modelled;
  Vector before = ends, fallen;
  ModelFlow flow;
  Matrix tangent;
  double pressure = response.pressure_at(prescribed, device), strongest = 0, least = infinity;
  bool moved = true, judges = false;
  bool is_first = true;  // whether no step has been judged yet
  while (out.steps < most_steps) {
    check_signals();
    if (moved) {
      // Next to a fold the error of a finer field may show a minimum: the first step is judged by
      // the field that it began with. Later forces are large, and what finer fields end is not.
      const bool raises = !(judges && is_first);
      // In the potentials of a search that failed beyond a fold all edges would be out of balance.
      const bool is_lost = response.is_lost && out.steps == 0;
      if (!move_references(response, ends, states, pressure, prescribed, loose, model, raises,
                           is_lost)) {
        out.event = DescentEvent::no_field;
        break;
      }
    }
    if (run_unbalanced(runs, response, law)) {
      states = held_edges(runs, ends, law);
      edges = indices(states.held);
      moved = false;
    }
    if (!moved) hold_edges(response, ends, states);
    ++out.steps;
    moved = false;
    const ResponseSolution now = response.solve(prescribed, law, device);
    if (!std::isfinite(now.pressure)) {
      out.event = DescentEvent::no_field;
      break;
    }
    pressure = now.pressure;
    HeldEdges condensed(response, edges, now, device);
    const Vector residual = condensed.residual();
    if (judges) {
      judges = is_first = false;
      const Vector at_end = HeldEdges(response, modelled, now, device).residual();
      const double error = model_error(flow, at_end, modelled, ends, law);
      const double length = largest(flow.motion) / law.longest_step;
      reach = std::max(next_reach(reach, length, error), MODEL_SHORT_STEP);
      if (error > 1 && length > 1.5 * MODEL_SHORT_STEP) {
        ends = before;
        moved = true;
        continue;
      }
    }
    const bool none = law.critical > 0 && out.steps > 1 && indices(runs).empty();
    bool more = run_unbalanced(runs, response, law), is_cut = false;
    more = more || ((none || !now.stable) && run_weakest(runs, response, now));
    if (!(now.stable || more)) {
      out.event = DescentEvent::no_field;
      break;
    }
    Vector way;
    if (!more) {
      tangent = condensed.tangent();
      modelled = edges;
      const EdgeModel start_of_step(edges, ends, residual, tangent, law, panels);
      const double force = norm(start_of_step.forces());
      strongest = std::max(strongest, force);
      if (near_balance(force, strongest, law) && force < least) {
        least = force;
        fallen = ends;
      }
      if (force > FORCES_FELL * least) out.passed = fallen;
      flow = flow_on(start_of_step, edges, ends, strongest, reach, equal_speeds, law);
      way = condensed.follow(flow.motion, pressure);
      const Vector here = response.motion_to(ends);
      for (size_t e = 0; e < way.size(); ++e) way[e] -= here[e];
      for (size_t i = 0; i < edges.size(); ++i) way[edges[i]] = flow.motion[i];  // no rounding
      if (law.critical == 0)
        is_cut = cut(way, map_gaps(ends), law);
      else
        more = run_far(runs, response, way, ends, law);
    }
    if (more) {
      states = held_edges(runs, ends, law);
      edges = indices(states.held);
      continue;
    }
    judges = !edges.empty();
    moved = true;
    before = ends;
    ends = move_edges(ends, way);
    for (int e = 0; law.pins() && e < int(ends.size()); ++e)
      if (way_from_memory(e, ends[e], law) == 0) ends[e] = law.memory[e];  // not by rounding
    if (shortest_length(ends) < law.smallest) {
      out.event = DescentEvent::vanished;
      break;
    }
    if (largest(way) < rest_within(ends, law) && !(flow.is_at_limit || is_cut)) break;
  }
  out.raced = law.critical > 0 && may_race(modelled, tangent, start, ends, law);
  out.ends = ends;
  return out;
}

}  // namespace adhesis
