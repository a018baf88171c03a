#include "condensed.hpp"

namespace adhesis {

namespace {

// What edges do that are pushed; it may serve for one push after the other.
struct Push {
  Vector motion;     // of all edges
  Vector potential;  // at all charges
  Charges charges;
  Flags loaded;  // the runs that hold a pushed edge

  explicit Push(const Tree& tree)
      : potential(tree.size()), charges(tree.size()), loaded(tree.run_count()) {}

  // Clear the charges, zero but for those of loaded runs.
  void clear(const Tree& tree) {
    for (int index = 0; index < tree.run_count(); ++index) {
      if (!loaded[index]) continue;
      const Run& run = tree.runs[index];
      std::fill_n(&charges.isolated[run.node], run.rank, 0.0);
      for (int half : run.half)
        if (half >= 0)
          std::fill_n(&charges.potential_of_sibling[tree.runs[half].node], tree.runs[half].rank,
                      0.0);
      loaded[index] = false;
    }
  }
};

// Compute the motions of all edges at fixed p by those of some that are held, and the potentials.
// Of the gaps that are not wanted they are not computed.
void push_edges(const LinearResponse& response, const Integers& edges, const Vector& motion,
                const Flags& wanted_gaps, Push& out) {
  const Tree& tree = response.tree;
  const Nodes& nodes = response.nodes;
  const int count = response.gap_count();
  out.clear(tree);
  out.motion.assign(2 * count, 0);
  Charges& charges = out.charges;
  Flags& loaded = out.loaded;
  for (int c = 0; c < int(edges.size()); ++c) {
    const int e = edges[c], beside = e ^ 1;  // the other end of the gap
    loaded[e / 2] = true;
    out.motion[e] += motion[c];
    // its compliance is zero where it is held, too
    const Edge& other = response.edges[beside];
    out.motion[beside] -= other.compliance[beside % 2] * other.tangent[e % 2] * motion[c];
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
  tree.pass_down(wanted, {&charges, 1}, {&out.potential, 1});
  for (int e = 0; e < 2 * count; ++e)
    if (wanted[e / 2])
      out.motion[e] += dot(&response.motion_by_potential[e % 2][nodes.offset[e / 2]],
                           &out.potential[nodes.offset[e / 2]], nodes.size_of(e / 2));
}

// Compute the change of C_e - C_c by motions of the gap's edges and potentials there.
double opening_change(const LinearResponse& response, int e, const Vector& motion,
                      const double* potential) {
  const int k = e / 2, first = response.nodes.offset[k];
  const auto& tangent = response.edges[e].tangent;
  return tangent[0] * motion[2 * k] + tangent[1] * motion[2 * k + 1] -
         dot(&response.closing_by_potential[e % 2][first], potential, response.nodes.size_of(k));
}

}  // namespace

Vector HeldEdges::residual() const {
  Vector out, change;
  for (int e : edges_) {
    const int k = e / 2, first = response_.nodes.offset[k];
    change.assign(response_.nodes.size_of(k), 0);
    for (int i = 0; i < int(change.size()); ++i)
      change[i] = response_.potential_at(first + i, now_.pressure) - response_.about[first + i];
    const Edge& edge = response_.edges[e];
    out.push_back(edge.residual + opening_change(response_, e, now_.motion, change.data()) -
                  edge.closing_by_pressure * (now_.pressure - response_.about_pressure[k]));
  }
  return out;
}

Vector HeldEdges::closing_by_pressure() const {
  Vector out;
  for (int e : edges_)
    out.push_back(response_.edges[e].closing_by_pressure -
                  opening_change(response_, e, now_.by_pressure,
                                 &response_.potential[1][response_.nodes.offset[e / 2]]));
  return out;
}

// By reciprocity the mean opening, times 2π, follows n_e as C_e follows p, times C_e π/4.
Vector HeldEdges::pressure_by_motion(const Vector& closing) const {
  const double weight = device_.separation_weight;
  const double by_pressure = response_.prescribed_by_pressure(device_);
  Vector out(closing);
  for (size_t c = 0; c < edges_.size(); ++c)
    out[c] *= 0.25 * pi * weight * response_.edges[edges_[c]].opening / by_pressure;
  return out;
}

Matrix HeldEdges::tangent() const {
  const int n = int(edges_.size());
  Flags wanted(response_.gap_count());
  for (int e : edges_) wanted[e / 2] = true;
  const Vector closing = closing_by_pressure(), more = pressure_by_motion(closing);
  Matrix out(n);
  Push push(response_.tree);
  for (int c = 0; c < n; ++c) {
    push_edges(response_, {edges_[c]}, {1.0}, wanted, push);
    for (int f = 0; f < n; ++f)
      out(f, c) = opening_change(response_, edges_[f], push.motion,
                                 &push.potential[response_.nodes.offset[edges_[f] / 2]]) -
                  closing[f] * more[c];
  }
  return out;
}

Vector HeldEdges::follow(const Vector& motion, double& pressure) {
  const Vector by_motion = pressure_by_motion(closing_by_pressure());
  double more = 0;
  for (size_t c = 0; c < edges_.size(); ++c) more += by_motion[c] * motion[c];
  Push push(response_.tree);
  push_edges(response_, edges_, motion, Flags(response_.gap_count(), true), push);
  for (int e = 0; e < int(push.motion.size()); ++e)
    push.motion[e] += now_.motion[e] + now_.by_pressure[e] * more;
  add_scaled(1, push.potential.data(), response_.potential[0].data(), int(push.potential.size()));
  pressure = now_.pressure + more;
  return push.motion;
}

}  // namespace adhesis
