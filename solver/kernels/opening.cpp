#include "opening.hpp"

#include "tolerances.hpp"

namespace adhesis {

namespace {

// Place the fine nodes of a gap, and compute s_n of all their modes.
FineOpening fine_moments(const Gap& gap, const Circle& circle, const Panels& panels) {
  const int count = circle.count - 1;
  FineOpening out{Vector(count), Vector(count), Vector(count), Vector(count)};
  const std::span<const double> cosine(&circle.cosine[1], count), sine(&circle.sine[1], count);
  place_nodes(gap, cosine, sine, out.theta.data(), out.theta_by_t.data());
  Vector& load = out.opening;  // not known yet
  for (int i = 0; i < count; ++i) load[i] = out.theta[i] / panels.width;
  interpolate(panels.stress, load.data(), count, panels, load.data());
  for (int i = 0; i < count; ++i) load[i] *= out.theta_by_t[i];
  sine_sums(load, circle, out.modes);
  for (double& mode : out.modes) mode *= 2.0 / (count + 1);
  return out;
}

// Locate a minimum by narrowing parabolas. Where one has it far away, or has none, the next is as
// wide, further down.
void refine(const Gap& gap, const Vector& modes, Candidate& minimum) {
  double width = 0.5 * minimum.width / 8, low = infinity, half = 0;
  int left = MINIMUM_REFINEMENTS;
  for (int i = 0; i < MOST_CORRECTIONS && left > 0; ++i) {
    const double theta = minimum.theta;
    const auto [before, here, after, same] =
        sum_modes(gap, {theta - width, theta, theta + width, theta}, modes);
    half = (after - 2 * here + before) / (2 * width * width);
    const double slope = (after - before) / (2 * width);
    const double whole = half > 0 ? -slope / (2 * half) : std::copysign(infinity, -slope);
    const double step = std::min(std::max(whole, -4 * width), 4 * width);
    minimum.theta += step;
    low = here + slope * step + half * step * step;
    if (step != whole) continue;
    width /= 8;
    --left;
  }
  minimum.opening = low;
  minimum.half = std::max(half, std::numeric_limits<double>::min());
}

// Round up a number N of nodes to one that many gaps share, N + 1 with small prime factors.
int fast_size(int fewest) {
  constexpr int many_nodes = 500;  // from so many on, sizes of the transform lie closer together
  int eighth = 1;
  while (16 * eighth <= fewest + 1) eighth *= 2;
  for (int step : {9, 10, 12, 15}) {
    if (fewest <= many_nodes && step != 12) continue;
    if (step * eighth - 1 >= fewest) return step * eighth - 1;
  }
  return 16 * eighth - 1;
}

}  // namespace

std::vector<Candidate> local_minima(const Vector& x, const Vector& y) {
  std::vector<Candidate> out;
  const int count = int(y.size());
  for (int i = count - 2; i > 0; --i) {
    if (!(y[i] <= y[i + 1] && y[i] < y[i - 1])) continue;
    const double first = (y[i] - y[i + 1]) / (x[i] - x[i + 1]);
    const double second = (y[i - 1] - y[i]) / (x[i - 1] - x[i]);
    const double width = x[i - 1] - x[i + 1];
    const double half = (second - first) / width;
    const double slope = first + half * (x[i] - x[i + 1]);
    double cubic = 0;
    for (int j : {i - 2, i + 2}) {
      if (j < 0 || j >= count) continue;
      const int beside = j < i ? i - 1 : i + 1, far = j < i ? i + 1 : i - 1;
      const double outer = (y[j] - y[beside]) / (x[j] - x[beside]);
      const double other = (outer - (j < i ? second : first)) / (x[j] - x[i]);
      cubic = std::max(cubic, std::abs((other - half) / (x[j] - x[far])));
    }
    out.push_back({x[i] - slope / (2 * half), y[i] - slope * slope / (4 * half), half, width,
                   0.05 * cubic * width * width * width});
  }
  return out;
}

int count_sine_nodes(const Field& field, int k, double per_wave) {
  const Gap& gap = field.nodes.gaps[k];
  const int top = field.model.panels->highest_harmonic;
  double widest = 0;
  const auto circle = circle_of(24);
  for (int i = 1; i < circle->count; ++i)
    widest = std::max(widest, theta_at(gap, circle->cosine[i]).stretch * circle->sine[i]);
  const int waves = int(std::ceil(0.5 * per_wave * widest * top));
  const int ends = int(FEWEST_SINE_NODES * std::max(1.0, per_wave / SHAPE_NODES));
  return fast_size(std::max(waves + ends, field.nodes.size_of(k)));
}

FineOpening open_gap(const Field& field, int k, const Circle& circle) {
  const Nodes& nodes = field.nodes;
  const GaussRule& rule = gauss_rules()[nodes.orders[k]];
  FineOpening out = fine_moments(nodes.gaps[k], circle, *field.model.panels);
  const int m = rule.count;
  for (int n = m; n < int(out.modes.size()); ++n) out.modes[n] /= -(n + 1);
  for (int n = 0; n < m; ++n) {
    double total = 0;
    for (int j = 0; j < m; ++j)
      total += rule.weights[j] * field.scaled_opening[nodes.offset[k] + j] * rule.modes[j * m + n];
    out.modes[n] = 2 / pi * total;
  }
  sine_sums(out.modes, circle, out.opening);
  return out;
}

std::array<double, 4> sum_modes(const Gap& gap, const std::array<double, 4>& theta,
                                const Vector& modes) {
  Four eta, b1 = {}, b2 = {};
  std::array<double, 4> out;
  for (int lane = 0; lane < 4; ++lane) eta[lane] = eta_at(gap, theta[lane]).eta;
  for (int n = int(modes.size()) - 1; n >= 0; --n) {
    const Four next = 2 * eta * b1 - b2 + modes[n];
    b2 = b1;
    b1 = next;
  }
  for (int lane = 0; lane < 4; ++lane)
    out[lane] = b1[lane] * std::sqrt(eta_at(gap, theta[lane]).square);
  return out;
}

double work_of_gaps(const Field& field) {
  const Panels& panels = *field.model.panels;
  const Nodes& nodes = field.nodes;
  double total = 0;
  for (int k = 0; k < nodes.gap_count(); ++k) {
    constexpr double per_wave = 2.5;  // two for the modes of the shortest wave, the rest decay
    const int count = count_sine_nodes(field, k, per_wave);
    const FineOpening fine = fine_moments(nodes.gaps[k], *circle_of(count + 1), panels);
    for (int n = nodes.size_of(k); n < count; ++n) total += fine.modes[n] * fine.modes[n] / (n + 1);
  }
  return -pi / 2 * total +
         dot(field.equations.load.data(), field.scaled_opening.data(), nodes.size());
}

std::vector<Minimum> find_minima(const Field& field, const Integers& gaps, double range) {
  std::vector<Minimum> out;
  for (int k : gaps) {
    const Gap& gap = field.nodes.gaps[k];
    const int count = count_sine_nodes(field, k, SHAPE_NODES);
    const FineOpening fine = open_gap(field, k, *circle_of(count + 1));
    const auto begin = fine.opening.begin(), end = fine.opening.end();
    for (Candidate minimum : local_minima(fine.theta, fine.opening)) {
      if (minimum.opening < range + MINIMUM_DOUBT * minimum.error) refine(gap, fine.modes, minimum);
      double rim = infinity;
      if (range > 0 && minimum.opening <= range) {
        const auto place =
            std::lower_bound(fine.theta.begin(), fine.theta.end(), minimum.theta, std::greater<>());
        const auto split =
            begin + std::clamp<std::ptrdiff_t>(place - fine.theta.begin(), 1, count - 1);
        rim = std::min(*std::max_element(begin, split), *std::max_element(split, end));
      }
      out.push_back({minimum.theta, minimum.opening, 2 * minimum.half, rim, k});
    }
  }
  return out;
}

}  // namespace adhesis
