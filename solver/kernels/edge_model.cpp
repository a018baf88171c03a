#include "edge_model.hpp"

namespace adhesis {

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
    edge.critical = critical_of(edge.edge, edge.theta, edge.opening, law);
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
  for (MovingEdge& edge : edges)
    edge.critical = critical_of(edge.edge, edge.theta, edge.opening, law_);
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
    const double sign = is_patch ? -1 : 1, by_length = sign * first / later;
    const double by_own = (first * length + sign) / later;
    const double of_one = by_own * one.own, of_two = by_own * two.own;
    one.own +=
        0.5 * (of_one * step[e] + (by_length * two.opening + first * last * one.opening) * step[f]);
    two.own +=
        0.5 * (of_two * step[f] + (by_length * one.opening + first * last * two.opening) * step[e]);
  }
  for (size_t e = 0; e < edges.size(); ++e)
    edges[e].theta += outwards(edges[e].edge) * 0.5 * step[e];
}

Vector EdgeModel::forces() const {
  Vector force;
  for (const MovingEdge& edge : edges)
    force.push_back(edge.critical.value * edge.critical.value -
                    edge.opening * std::abs(edge.opening));
  return force;
}

Matrix EdgeModel::hessian() const {
  Matrix out(int(edges.size()));
  for (int e = 0; e < out.n; ++e) {
    const MovingEdge& edge = edges[e];
    const double twice = 2 * std::max(edge.opening, 0.0);
    for (int f = 0; f < out.n; ++f)
      out(e, f) = twice * std::max(edges[f].opening, 0.0) * coupling_(e, f);
    const double sign = outwards(edge.edge);
    const double rate = edge.own + sign * edge.half_plane.slope;  // ∂C/∂n
    out(e, e) =
        2 * (std::abs(edge.opening) * rate - edge.critical.value * (sign * edge.critical.slope));
  }
  for (int e = 0; e < out.n; ++e) {
    if (!edges[e].critical.pinned) continue;
    for (int f = 0; f < out.n; ++f) out(e, f) = out(f, e) = e == f ? 1 : 0;
  }
  return out;
}

}  // namespace adhesis
