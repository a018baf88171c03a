#include "response.hpp"

namespace adhesis {

LinearResponse::LinearResponse(Nodes given, Equations given_equations, Tree given_tree)
    : nodes(std::move(given)), equations(std::move(given_equations)), tree(std::move(given_tree)) {
  const int count = nodes.gap_count(), n = nodes.size();
  inverse.resize(nodes.square.back());
  charges.fill(Charges(tree.size()));
  about_pressure.resize(count);
  edges.resize(2 * count);
  softness.assign(count, 1);
  is_stale.assign(count, true);
  for (Vector* values : {&about, &scaled_opening, &mean_by_potential}) values->resize(n);
  for (Pair* pair : {&opening_by_potential, &charge_by_edge, &held_charge, &motion_by_potential})
    for (Vector& values : *pair) values.resize(n);
  for (Vector& values : potential) values.resize(tree.size());
}

void LinearResponse::factor_runs() {
  Flags changed(tree.run_count());
  for (int k = 0; k < tree.count; ++k) {
    changed[k] = is_stale[k];
    if (is_stale[k]) condense(k);
    is_stale[k] = false;
  }
  for (int run = tree.count; run < tree.run_count(); ++run) {
    auto [one, two] = tree.runs[run].half;
    if (changed[run] || changed[one] || changed[two]) {
      changed[run] = true;
      tree.factor(run);
      for (Charges& column : charges) tree.charge(run, column);
    }
  }
}

ResponseSolution LinearResponse::solve(double prescribed, const EdgeLaw& law,
                                       const Device& device) {
  const int count = gap_count(), n = nodes.size();
  factor_runs();
  Pair motion = {Vector(2 * count), Vector(2 * count)};
  for (int column = 0; column < 2; ++column) {
    Vector& g = potential[column];
    tree.pass_down(charges[column], g);
    mean[column] = dot(tree.stretch.data(), charges[column].isolated.data(), n) -
                   dot(mean_by_potential.data(), g.data(), n);
    for (int e = 0; e < 2 * count; ++e)
      motion[column][e] =
          edges[e].motion[column] + dot(&motion_by_potential[e % 2][nodes.offset[e / 2]],
                                        &g[nodes.offset[e / 2]], nodes.size_of(e / 2));
  }
  // weight·mean - 2π compliance·p = 2π d
  const double weight = device.separation_weight;
  const double by_pressure = prescribed_by_pressure(device);
  ResponseSolution out;
  out.pressure = pressure_at(prescribed, device);
  const double rate = 2 * pi / by_pressure;  // dp/dd
  out.separation = prescribed;
  if (device.compliance != 0) out.separation = (mean[0] + out.pressure * mean[1]) / (2 * pi);
  out.slope = weight != 0 ? rate : rate * mean[1] / (2 * pi);
  const int negative = tree.runs.back().count.negative;
  out.stable = (negative == 0 && by_pressure < 0) || (negative == 1 && by_pressure > 0);
  update_softness(motion, by_pressure, law, device);
  out.by_pressure = motion[1];
  out.motion = motion[0];
  add_scaled(out.pressure, motion[1].data(), out.motion.data(), 2 * count);
  out.rate.resize(2 * count);
  add_scaled(rate, motion[1].data(), out.rate.data(), 2 * count);
  return out;
}

void LinearResponse::update_softness(const Pair& motion, double by_pressure, const EdgeLaw& law,
                                     const Device& device) {
  // the compliance with which edges follow their openings, over that of their gap by itself or by
  // roughness of the shortest wave, at the prescribed d: edges by p, times how much more p changes
  // than with all edges held. Modes that p does not excite, as of symmetric states, show in how
  // near a 2×2 or a pair of runs is to singular.
  const int count = gap_count();
  double held_mean = dot(tree.stretch.data(), held_charge[1].data(), nodes.size());
  held_mean = device.separation_weight * held_mean - 2 * pi * device.compliance;
  const double more = std::abs(held_mean / by_pressure) / SOFT_EDGE;
  softness.assign(count, 1);
  for (int e = 0; e < 2 * count; ++e) {
    const Edge& edge = edges[e];
    double stiff = std::max(law.rough_rate, std::abs(edge.tangent[0]) + std::abs(edge.tangent[1]));
    double soft = more * stiff * std::abs(motion[1][e] / edge.opening_by_pressure);
    for (int beside : {count - 1, 0, 1}) {
      double& of_gap = softness[(e / 2 + beside) % count];
      of_gap = std::max(of_gap, soft);
    }
  }
  for (const Run& run : tree.runs) {
    const double soft = 1 / (SOFT_EDGE * run.count.nearest);
    if (!(soft > 1)) continue;
    for (int k = run.range[0]; k <= run.range[1]; ++k) softness[k] = std::max(softness[k], soft);
  }
}

double LinearResponse::pressure_at(double prescribed, const Device& device) const {
  const double by_separation = device.separation_weight * mean[0];
  return (2 * pi * prescribed - by_separation) / prescribed_by_pressure(device);
}

Vector LinearResponse::potential_at(double pressure) const {
  Vector out;
  for (int k = 0; k < gap_count(); ++k)
    for (int i = nodes.offset[k], end = i + nodes.size_of(k); i < end; ++i)
      out.push_back(potential[0][i] + pressure * potential[1][i]);
  return out;
}

Vector LinearResponse::motion_to(const Vector& ends) const {
  Vector motion(ends.size());
  for (int e = 0; e < int(ends.size()); ++e)
    motion[e] = outwards(e) * (ends[e] - nodes.gaps[e / 2].end[e % 2]);
  return motion;
}

void LinearResponse::linearise_in_current_potential(int k, double pressure, const EdgeLaw& law) {
  about_pressure[k] = pressure;
  for (int i = nodes.offset[k]; i < nodes.offset[k + 1]; ++i)
    about[i] = potential[0][i] + pressure * potential[1][i];
  linearise(k, law);
}

}  // namespace adhesis
