#include "condensed.hpp"

namespace adhesis {

namespace {

struct Push {
  Vector motion;     // of all edges
  Vector potential;  // at all charges
};

// Compute the motions at fixed p by forces, as -(C_e - C_c), on some edges, and the potentials.
// Of the gaps that are not wanted they are not computed.
Push push_edges(const LinearResponse& response, const Integers& edges, const Vector& force,
                const Flags& wanted_gaps) {
  const Tree& tree = response.tree;
  const Nodes& nodes = response.nodes;
  const int count = response.gap_count();
  Charges charges(tree.size());
  Push out{Vector(2 * count), Vector(tree.size())};
  Flags loaded(tree.run_count());
  for (int c = 0; c < int(edges.size()); ++c) {
    const int k = edges[c] / 2;
    loaded[k] = true;
    for (int e = 2 * k; e < 2 * k + 2; ++e)
      out.motion[e] += response.edges[e].compliance[edges[c] % 2] * force[c];
  }
  for (int k = 0; k < count; ++k) {
    if (!loaded[k]) continue;
    for (int side = 0; side < 2; ++side)
      add_scaled(out.motion[2 * k + side], &response.charge_by_edge[side][nodes.offset[k]],
                 &charges.isolated[nodes.offset[k]], nodes.size_of(k));
  }
  Flags wanted(wanted_gaps);
  wanted.resize(tree.run_count());
  for (int run = count; run < tree.run_count(); ++run) {
    auto [one, two] = tree.runs[run].half;
    wanted[run] = wanted[one] || wanted[two];
    loaded[run] = loaded[one] || loaded[two];
    if (loaded[run]) tree.charge(run, charges);
  }
  tree.pass_down(wanted, charges, out.potential);
  for (int e = 0; e < 2 * count; ++e)
    if (wanted[e / 2])
      out.motion[e] += dot(&response.motion_by_potential[e % 2][nodes.offset[e / 2]],
                           &out.potential[nodes.offset[e / 2]], nodes.size_of(e / 2));
  return out;
}

}  // namespace

CondensedEdges::CondensedEdges(LinearResponse& response, Integers edges,
                               const ResponseSolution& now, const Device& device)
    : response_(response), edges_(std::move(edges)), device_(device),
      stiffness_(int(edges_.size())) {
  const int n = stiffness_.n;
  Flags wanted(response.gap_count());
  for (int e : edges_) wanted[e / 2] = true;
  Matrix compliance(n);
  for (int c = 0; c < n; ++c) {
    const Push push = push_edges(response, {edges_[c]}, {1.0}, wanted);
    const double more = pressure_by_force(edges_[c], now);
    for (int f = 0; f < n; ++f)
      compliance(f, c) = push.motion[edges_[f]] + now.by_pressure[edges_[f]] * more;
    stiffness_(c, c) = 1;
  }
  eliminate(compliance.values.data(), n, stiffness_.values.data(), n);
}

// By reciprocity the mean opening, times 2π, follows a force as C_e follows p, times π/4.
double CondensedEdges::pressure_by_force(int edge, const ResponseSolution& now) const {
  const double weight = device_.separation_weight;
  const double by_pressure = weight * response_.mean[1] - 2 * pi * device_.compliance;
  const double opened = weight * response_.edges[edge].opening * now.by_pressure[edge];
  return 0.25 * pi * opened / by_pressure;
}

Matrix CondensedEdges::tangent() const {
  Matrix out = stiffness_;
  for (int e = 0; e < out.n; ++e) out(e, e) -= response_.edges[edges_[e]].damping;
  return out;
}

Vector CondensedEdges::residual(const ResponseSolution& now) const {
  const int n = stiffness_.n;
  Vector out(n);
  for (int e = 0; e < n; ++e)
    for (int f = 0; f < n; ++f)
      out[e] -= stiffness_(e, f) * (now.motion[edges_[f]] - response_.edges[edges_[f]].here);
  return out;
}

Vector CondensedEdges::follow(const Vector& motion, const ResponseSolution& now,
                              double& pressure) {
  const int n = stiffness_.n;
  Vector force(n);
  double more = 0;
  for (int e = 0; e < n; ++e) {
    for (int f = 0; f < n; ++f) force[e] += stiffness_(e, f) * (motion[f] - now.motion[edges_[f]]);
    more += force[e] * pressure_by_force(edges_[e], now);
  }
  Push push = push_edges(response_, edges_, force, Flags(response_.gap_count(), true));
  for (int e = 0; e < int(push.motion.size()); ++e)
    push.motion[e] += now.motion[e] + now.by_pressure[e] * more;
  add_scaled(1, push.potential.data(), response_.potential[0].data(), int(push.potential.size()));
  pressure = now.pressure + more;
  return push.motion;
}

}  // namespace adhesis
