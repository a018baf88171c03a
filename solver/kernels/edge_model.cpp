#include "edge_model.hpp"

#include "cholesky.hpp"

namespace adhesis {

namespace {

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

}  // namespace

double distance_to_minimum(const Matrix& hessian, const Vector& force) {
  Matrix factor = hessian;
  if (!factor_rows(factor.values.data(), factor.n, factor.n)) return infinity;
  Vector step = force;
  solve_column(factor.values.data(), factor.n, factor.n, step.data());
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
    if (!factor_rows(factor.values.data(), n, n)) {
      growth /= STEP_REDUCTION;
      continue;
    }
    step = force;
    solve_column(factor.values.data(), n, n, step.data());
    const double size = largest(step);
    if (size <= longest) break;
    for (double& motion : step) motion *= longest / size;
    growth *= std::min(1 / STEP_REDUCTION, 1.1 * size / longest);
  }
  return step;
}

EdgeModel::EdgeModel(const Integers& numbers, const Vector& ends, const Vector& residual,
                     const Matrix& tangent, const EdgeLaw& law, const Panels& panels)
    : edges(numbers.size()), law_(law), panels_(panels), coupling_(int(numbers.size())) {
  const int count = int(numbers.size());
  for (int i = 0; i < count; ++i) {
    MovingEdge& edge = edges[i];
    edge.edge = numbers[i];
    edge.theta = ends[edge.edge];
    auto [critical, drift] = critical_opening(edge.theta, law);
    edge.half_plane = half_plane_opening(edge.theta, edge.edge % 2, panels);
    edge.opening = residual[i] + critical;
    edge.own = tangent(i, i) + outwards(edge.edge) * (drift - edge.half_plane.slope);
    const int following = (i + 1) % count;
    edge.after = numbers[following] == (numbers[i] + 1) % int(ends.size()) ? following : -1;
    evaluate(edge);
  }
  // of tangent(e, f) over C_f and its transpose, which are equal, that with the larger opening
  for (int e = 0; e < count; ++e) {
    for (int f = 0; f < e; ++f) {
      const double ce = edges[e].opening, cf = edges[f].opening;
      double value = 0;
      if (std::abs(cf) > std::abs(ce))
        value = tangent(e, f) / cf;
      else if (ce != 0)
        value = tangent(f, e) / ce;
      coupling_(e, f) = coupling_(f, e) = value;
    }
  }
}

void EdgeModel::evaluate(MovingEdge& edge) const {
  auto [critical, drift, pinned] = critical_of(edge.edge, edge.theta, edge.opening, law_);
  edge.pinned = pinned;
  edge.rate = edge.own + outwards(edge.edge) * edge.half_plane.slope;
  edge.critical = critical;
  edge.critical_rate = outwards(edge.edge) * drift;
}

void EdgeModel::advance(const Vector& step) {
  const int count = int(edges.size());
  Vector by_motion(count);
  for (int e = 0; e < count; ++e) by_motion[e] = edges[e].opening * step[e];
  follow_lengths(step);
  for (int e = 0; e < count; ++e) {
    MovingEdge& edge = edges[e];
    const double end = edge.theta + outwards(edge.edge) * 0.5 * step[e];
    const ValueAndSlope half_plane = half_plane_opening(end, edge.edge % 2, panels_);
    edge.opening += edge.own * step[e] + half_plane.value - edge.half_plane.value +
                    dot(&coupling_.values[e * count], by_motion.data(), count);
    edge.half_plane = half_plane;
    edge.motion += step[e];
  }
  follow_lengths(step);
  for (MovingEdge& edge : edges) evaluate(edge);
}

void EdgeModel::follow_lengths(const Vector& step) {
  for (int e = 0; e < int(edges.size()); ++e) {
    const int f = edges[e].after;
    if (f < 0) continue;
    MovingEdge &one = edges[e], &two = edges[f];
    const bool is_patch = one.edge % 2 == 1;
    const double length = two.theta - one.theta + (f <= e ? 2 * pi : 0);
    const double both = 0.5 * (step[e] + step[f]);
    const double later = length + (is_patch ? both : -both);
    const double first = coupling_(e, f), last = first * length / later;
    coupling_(e, f) = coupling_(f, e) = last;
    const double by_length = (is_patch ? -first : first) / later;
    one.own +=
        (by_length * two.opening + first * last * one.opening) * (is_patch ? both : 0.5 * step[f]);
    two.own +=
        (by_length * one.opening + first * last * two.opening) * (is_patch ? both : 0.5 * step[e]);
  }
  for (size_t e = 0; e < edges.size(); ++e)
    edges[e].theta += outwards(edges[e].edge) * 0.5 * step[e];
}

Vector EdgeModel::forces() const {
  Vector force(edges.size());
  for (size_t e = 0; e < edges.size(); ++e)
    force[e] =
        edges[e].critical * edges[e].critical - edges[e].opening * std::abs(edges[e].opening);
  return force;
}

Matrix EdgeModel::hessian() const {
  Matrix out(int(edges.size()));
  for (int e = 0; e < out.n; ++e) {
    const MovingEdge& edge = edges[e];
    const double twice = 2 * std::max(edge.opening, 0.0);
    for (int f = 0; f < out.n; ++f)
      out(e, f) = twice * std::max(edges[f].opening, 0.0) * coupling_(e, f);
    out(e, e) = 2 * (std::abs(edge.opening) * edge.rate - edge.critical * edge.critical_rate);
  }
  for (int e = 0; e < out.n; ++e) {
    if (!edges[e].pinned) continue;
    for (int f = 0; f < out.n; ++f) out(e, f) = out(f, e) = e == f ? 1 : 0;
  }
  return out;
}

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
      residual[e] = model.edges[e].opening - model.edges[e].critical;
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

bool near_balance(double force, double strongest, const EdgeLaw& law) {
  const double small = NEAR_BALANCE * law.critical * law.critical;
  return force < small && FORCES_FELL * force < strongest;
}

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
      // not written as > : an error that is no number is too large
      if (!(error <= worst * allowed)) worst = error / allowed;
    }
  }
  return worst;
}

double next_reach(double before, double length, double error) {
  const double safe = REACH_SAFETY / std::sqrt(std::max(error, 1e-9));
  const double factor = std::min(STEP_GROWTH, std::max(STEP_REDUCTION, safe));
  double reach = length * factor;
  if (error <= 1) reach = std::max(reach, factor >= 1 ? before : 0.0);
  return reach;
}

}  // namespace adhesis
