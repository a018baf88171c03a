#include "clearance.hpp"

#include "tolerances.hpp"

namespace adhesis {

namespace {

Vector low_openings(const Field& field, int k, const GaussRule& rule) {
  Vector out(rule.count);
  for (int i = 0; i < rule.count; ++i)
    out[i] =
        field.scaled_opening[field.nodes.offset[k] + i] * std::sqrt(1 - rule.eta[i] * rule.eta[i]);
  return out;
}

// Bound the clearance left in gap k, which was searched; negative if it has to be searched again.
double clearance_since(const Field& field, int k, const SearchedGap& was,
                       const SearchLengths& lengths, const GaussRule& rule) {
  const Gap& gap = field.nodes.gaps[k];
  const double furthest = ELSEWHERE * lengths.longest_step;
  const double begin = gap.end[0] - was.end[0], end = gap.end[1] - was.end[1];
  if (std::abs(begin) > furthest || std::abs(end) > furthest || field.nodes.orders[k] != was.order)
    return -1;
  const double within = NO_MINIMUM_WITHIN * lengths.wave;
  const double by_edges = lengths.closing_per_motion * (std::max(begin, 0.0) + std::max(-end, 0.0));
  const Vector opening = low_openings(field, k, rule);
  double closed = 0, most = 0;
  bool none_inside = true;
  for (int i = 0; i < rule.count; ++i) {
    // the slope between the node's neighbours, or the gap's end
    const bool first = i == 0, last = i == rule.count - 1;
    const double before = first ? was.end[0] : was.theta[i - 1];
    const double after = last ? was.end[1] : was.theta[i + 1];
    const double low = first ? 0 : was.opening[i - 1], high = last ? 0 : was.opening[i + 1];
    const double here = field.nodes.theta[field.nodes.offset[k] + i];
    const double moved = here - was.theta[i];
    if (std::abs(moved) > furthest) return -1;
    const double expected = was.opening[i] + (high - low) / (after - before) * moved;
    const double closing = expected - opening[i];
    closed = std::max(closed, closing);
    most = std::max(most, expected);
    // a minimum may appear at any node, but hardly beside the ends
    if (std::min(here - gap.end[0], gap.end[1] - here) > within) {
      none_inside = false;
      const double room = expected > lengths.range ? expected - lengths.range : expected;
      const double rest = room - std::max(closing, 0.0) - by_edges;
      if (!(rest > CLEARANCE_LEFT * room)) return -1;
    } else if (opening[i] < 0 && 0 <= expected) {
      return -1;
    }
  }
  double clearance = was.clearance;
  if (clearance == infinity && none_inside) clearance = most;
  const double rest = clearance - closed - by_edges;
  if (clearance < infinity && !(rest > CLEARANCE_LEFT * clearance)) return -1;
  return was.clearance < infinity ? rest : infinity;
}

}  // namespace

double seed_width(double curvature, const SearchLengths& lengths) {
  const double first = std::pow(16 * lengths.surface / (pi * curvature * curvature), 1.0 / 3);
  return std::min(std::max(0.5 * first, lengths.narrowest), lengths.longest_step);
}

double clearance_of(const Minimum& minimum, const SearchLengths& lengths) {
  const double width = seed_width(minimum.curvature, lengths);
  if (lengths.range > 0 && minimum.opening < lengths.range && minimum.rim <= lengths.range)
    return std::min(minimum.opening, lengths.range - minimum.rim);
  // Overlap of a narrow patch of width w: κw²/8 times a logarithm of the distance over which the
  // surface follows it, 10 to 20 here.
  const double overlap = width <= lengths.narrowest ? 4 * minimum.curvature * width * width : 0;
  return minimum.opening - lengths.range + overlap;
}

Search search(const Field& field, const SearchedGaps& searched, const SearchLengths& lengths) {
  const Nodes& nodes = field.nodes;
  const int count = nodes.gap_count();
  Search out;
  out.searched.resize(count);
  Integers again;  // the gaps that have to be searched
  size_t before = 0;
  for (int k = 0; k < count; ++k) {
    const double least = nodes.gaps[k].end[0] - ELSEWHERE * lengths.longest_step;
    while (before < searched.size() && searched[before]->end[0] < least) ++before;
    double left = -1;
    if (before < searched.size())
      left = clearance_since(field, k, *searched[before], lengths, gauss_rules()[nodes.orders[k]]);
    // a clearance that is left is positive: below zero it would have to be searched
    if (left == -1) {
      again.push_back(k);
    } else {
      out.searched[k] = searched[before];
      out.least = std::min(out.least, left);
    }
  }
  out.count = int(again.size());
  out.minima = find_minima(field, again, lengths.range);
  Vector found(count, infinity);  // least clearances at the minima
  for (const Minimum& minimum : out.minima) {
    double clearance = clearance_of(minimum, lengths);
    // where surfaces attract each other already, more than the closing of a gap decides
    if (minimum.opening < lengths.range) clearance = std::min(clearance, 0.0);
    found[minimum.gap] = std::min(found[minimum.gap], clearance);
  }
  for (int k : again) {
    const GaussRule& rule = gauss_rules()[nodes.orders[k]];
    const auto first = nodes.theta.begin() + nodes.offset[k];
    out.searched[k] = std::make_shared<SearchedGap>(
        SearchedGap{nodes.gaps[k].end, nodes.orders[k], Vector(first, first + rule.count),
                    low_openings(field, k, rule), found[k]});
  }
  return out;
}

}  // namespace adhesis
