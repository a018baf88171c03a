#include "response.hpp"

#include <utility>

namespace adhesis {

namespace {

// Loads of a gap: by its field, by p, by its motion to the right, and by both ends' openings.
constexpr int columns = 5;
enum Column { by_field, by_pressure, by_motion, by_left_end };

// What is computed on the way, for the nodes of the gap.
struct Space {
  using Column = std::array<double, MOST_CHARGES>;
  std::array<Column, columns> loads, solved;
  std::array<Column, 2> singular;  // charges of both ends' openings
  Column near = {}, near_slope = {}, smooth, density;
};

// Compute the potential g of both neighbours at the nodes of a gap, and its derivative by θ.
//
// They change it most sharply. Without them the derivative of the interpolated potential is more
// accurate, for uneven gaps by an order of magnitude.
WIDE void add_near_potential(const Nodes& nodes, const Vector& opening, int k, Space& space) {
  const int count = nodes.gap_count(), first = nodes.offset[k], m = nodes.size_of(k);
  const double *sine = &nodes.sine[first], *cosine = &nodes.cosine[first];
  double* __restrict near = space.near.data(), * __restrict slope = space.near_slope.data();
  for (int side = 0; side < std::min(2, count - 1); ++side) {
    const int other = (k - 1 + 2 * side + count) % count;
    for (int j = nodes.offset[other], end = j + nodes.size_of(other); j < end; ++j) {
      const double charge = nodes.weight[j] * opening[j] / (4 * pi);
      const double sj = nodes.sine[j], cj = nodes.cosine[j];
      for (int i = 0; i < m; ++i) {
        double pole = 1 / (sine[i] * cj - cosine[i] * sj);
        double value = charge * pole * pole;
        near[i] -= value;
        slope[i] += value * (cosine[i] * cj + sine[i] * sj) * pole;
      }
    }
  }
}

void load_gap(const LinearResponse& response, int k, const GaussRule& rule, Space& space) {
  const Nodes& nodes = response.nodes;
  const Equations& equations = response.equations;
  const int first = nodes.offset[k], m = rule.count;
  const double pressure = response.about_pressure[k];
  const double *about = &response.about[first], *weight = &nodes.weight[first];
  add_near_potential(nodes, response.scaled_opening, k, space);
  for (int i = 0; i < m; ++i)
    space.smooth[i] = about[i] * rule.weights[i] / weight[i] - space.near[i];
  for (int i = 0; i < m; ++i) {
    double by_eta = 0;
    for (int j = 0; j < m; ++j)
      by_eta += rule.derivative[i * m + j] * (space.smooth[j] - space.smooth[i]);
    const double w = rule.weights[i];
    space.loads[by_field][i] = -(equations.load[first + i] + pressure * weight[i] + w * about[i]);
    space.loads[by_pressure][i] = weight[i];
    space.loads[by_motion][i] =
        -(equations.load_of_slope[first + i] + weight[i] * space.near_slope[i] + w * by_eta);
  }
  for (int side = 0; side < 2; ++side)
    end_charges(nodes, equations, k, side, rule, space.density.data(),
                space.loads[by_left_end + side].data(), space.singular[side].data());
}

}  // namespace

LinearResponse::LinearResponse(Nodes given, double digits)
    : nodes(std::move(given)), equations(allocate_equations(nodes)), tree(nodes, digits, ROOM) {
  const int count = nodes.gap_count(), n = nodes.size();
  inverse = unset(nodes.square.back());
  charges.fill(Charges(tree.size()));
  about_pressure.resize(count);
  edges.resize(2 * count);
  softness.assign(count, 1);
  is_stale.assign(count, true);
  for (Vector* values : {&about, &scaled_opening, &mean_by_potential}) values->resize(n);
  for (Pair* pair : {&closing_by_potential, &charge_by_edge, &held_charge, &motion_by_potential})
    for (Vector& values : *pair) values.resize(n);
  for (Vector& values : potential) values.resize(tree.size());
}

WIDE void LinearResponse::linearise(int k, const EdgeLaw& law) {
  const GaussRule& rule = gauss_rules()[nodes.orders[k]];
  const int m = rule.count, first = nodes.offset[k];
  const double* own = &inverse[nodes.square[k]];
  Space space;
  load_gap(*this, k, rule, space);
  for (int c = 0; c < columns; ++c)
    for (int i = 0; i < m; ++i) space.solved[c][i] = dot(own + i * m, space.loads[c].data(), m);
  std::copy_n(space.solved[by_field].data(), m, &scaled_opening[first]);

  // C at both edges by each load, and the strength of the edges' singular openings
  std::array<std::array<double, columns>, 2> opening;
  std::array<double, 2> strength;
  const EndTerms& end_terms = equations.end_terms[k];
  for (int side = 0; side < 2; ++side) {
    const double scale = std::sqrt(2 * nodes.slope[k][side]);
    const double* end_values = rule.end_values[side].data();
    for (int c = 0; c < columns; ++c)
      opening[side][c] = scale * dot(end_values, space.solved[c].data(), m);
    opening[side][by_field] -= scale * end_terms[side][0];
    opening[side][by_motion] -= scale * end_terms[side][1];
    strength[side] = -opening[side][by_field] * std::sqrt(nodes.slope[k][side] / 8);
    double* by_potential = &closing_by_potential[side][first];
    std::fill_n(by_potential, m, 0.0);
    for (int i = 0; i < m; ++i) add_scaled(scale * end_values[i], own + i * m, by_potential, m);
    for (int j = 0; j < m; ++j) by_potential[j] *= rule.weights[j];
  }

  for (int side = 0; side < 2; ++side) {
    Edge& edge = edges[2 * k + side];
    auto [critical, drift] = critical_opening(nodes.gaps[k].end[side], law);
    edge.opening = opening[side][by_field];
    edge.closing_by_pressure = opening[side][by_pressure];
    edge.residual = edge.opening - critical;
    if (law.pins()) {
      const auto [range, by_theta] = pinning_range(nodes.gaps[k].end[side], law);
      edge.pinning_range = {range, outwards(side) * by_theta};
    }
    // by the opening of the other end
    const double far = opening[side][by_left_end + 1 - side] + std::sqrt(nodes.slope[k][side] / 2);
    edge.tangent[1 - side] = far * strength[1 - side];
    // the sum over both edges is the motion of the gap
    edge.tangent[side] =
        outwards(side) * (opening[side][by_motion] - drift) + edge.tangent[1 - side];
  }

  for (int i = 0; i < m; ++i) {
    const double w = rule.weights[i];
    held_charge[0][first + i] = w * space.solved[by_field][i];
    held_charge[1][first + i] = -w * space.solved[by_pressure][i];
    for (int side = 0; side < 2; ++side)
      charge_by_edge[side][first + i] =
          strength[side] * (w * space.solved[by_left_end + side][i] + space.singular[side][i]);
  }
  is_stale[k] = true;
}

WIDE void LinearResponse::condense(int k) {
  const Vector& w = gauss_rules()[nodes.orders[k]].weights;
  const int m = nodes.size_of(k), first = nodes.offset[k];
  const double pressure = about_pressure[k];
  Edge &left = edges[2 * k], &right = edges[2 * k + 1];
  auto& [negative, nearest] = tree.runs[k].count;
  negative = 0;
  nearest = 1;
  left.compliance = right.compliance = {0, 0};
  const auto [residual_left, a] = left.imbalance(0);
  const auto [residual_right, d] = right.imbalance(1);
  const double b = left.tangent[1], c = right.tangent[0];
  if (!(left.held || right.held)) {
    const double det = a * d - b * c;
    left.compliance = {d / det, -b / det};
    right.compliance = {-c / det, a / det};
    negative = 1;
    if (!(det < 0)) negative = a + d < 0 ? 2 : 0;
    nearest = std::abs(det) / (std::abs(a * d) + std::abs(b * c));
  } else {
    for (int side = 0; side < 2; ++side) {
      Edge& edge = edges[2 * k + side];
      if (edge.held) continue;
      const double own = side == 0 ? a : d;
      edge.compliance[side] = 1 / own;
      negative = own < 0;
    }
  }
  const double pull_left = -residual_left - a * left.here - b * right.here;
  const double pull_right = -residual_right - c * left.here - d * right.here;
  const double* potential_here = &about[first];
  const double *by_left = &closing_by_potential[0][first],
               *by_right = &closing_by_potential[1][first];
  for (int side = 0; side < 2; ++side) {
    Edge& edge = edges[2 * k + side];
    auto [x, y] = edge.compliance;
    double* follows = &motion_by_potential[side][first];
    for (int j = 0; j < m; ++j) follows[j] = x * by_left[j] + y * by_right[j];
    edge.isolated_correction = edge.here + x * pull_left + y * pull_right;
    edge.motion[1] = x * left.closing_by_pressure + y * right.closing_by_pressure;
    edge.motion[0] =
        edge.isolated_correction - edge.motion[1] * pressure - dot(follows, potential_here, m);
  }
  const double *own = &inverse[nodes.square[k]], *stretch = &tree.stretch[first];
  double* response = &tree.response[tree.runs[k].response];
  const double *q_left = &charge_by_edge[0][first], *q_right = &charge_by_edge[1][first];
  const double *n_left = &motion_by_potential[0][first], *n_right = &motion_by_potential[1][first];
  for (int i = 0; i < m; ++i) {
    double* __restrict row = response + i * m;
    for (int j = 0; j < m; ++j)
      row[j] = w[i] * own[i * m + j] * w[j] -
               0.5 * (q_left[i] * n_left[j] + q_left[j] * n_left[i]) -
               0.5 * (q_right[i] * n_right[j] + q_right[j] * n_right[i]);
    mean_by_potential[first + i] = dot(row, stretch, m);
    const double by_p =
        held_charge[1][first + i] + q_left[i] * left.motion[1] + q_right[i] * right.motion[1];
    charges[1].isolated[first + i] = by_p;
    charges[0].isolated[first + i] =
        held_charge[0][first + i] + q_left[i] * left.isolated_correction +
        q_right[i] * right.isolated_correction - pressure * by_p + dot(row, potential_here, m);
  }
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
                                       const LoadingDevice& device) {
  const int count = gap_count(), n = nodes.size();
  factor_runs();
  Pair motion = {Vector(2 * count), Vector(2 * count)};
  tree.pass_down(Flags(tree.run_count(), true), charges, potential);
  for (int column = 0; column < 2; ++column) {
    const Vector& g = potential[column];
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
  for (int k : std::exchange(displaced, {})) {
    about_pressure[k] = out.pressure;
    for (int i = nodes.offset[k]; i < nodes.offset[k + 1]; ++i)
      about[i] = potential_at(i, out.pressure);
    linearise(k, law);
  }
  return out;
}

void LinearResponse::update_softness(const Pair& motion, double by_pressure, const EdgeLaw& law,
                                     const LoadingDevice& device) {
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
    double soft = more * stiff * std::abs(motion[1][e] / edge.closing_by_pressure);
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

double LinearResponse::pressure_at(double prescribed, const LoadingDevice& device) const {
  const double by_separation = device.separation_weight * mean[0];
  return (2 * pi * prescribed - by_separation) / prescribed_by_pressure(device);
}

Vector LinearResponse::motion_to(const Vector& ends) const {
  Vector motion(ends.size());
  for (int e = 0; e < int(ends.size()); ++e)
    motion[e] = outwards(e) * (ends[e] - nodes.gaps[e / 2].end[e % 2]);
  return motion;
}

}  // namespace adhesis
