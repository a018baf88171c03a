#include "predictor.hpp"

#include "edge_law.hpp"

namespace adhesis {

namespace {

// d on the way λ of the leading edge.
double polynomial(const LeadingEdge& leading, double way) {
  return way * (leading.here + way * (leading.square + way * leading.cube));
}

// Take d as a polynomial of the motion of one edge.
LeadingEdge follow_edge(int edge, const TwoPoints& points, double fastest) {
  const double gone = (points.ends[edge] - points.ends_before[edge]) * outwards(edge);
  const double before = gone / (points.way * points.rate_before[edge]);
  const double here = gone / (points.way * points.rate[edge]);
  LeadingEdge out = {edge,         fastest,      gone,     not_a_number,
                     not_a_number, not_a_number, infinity, infinity};
  if (!(0 < before && before < infinity && 0 < here && here < infinity)) return out;
  out.here = here;
  out.square = 2 * here + before - 3;
  out.cube = here + before - 2;
  const double root = std::sqrt(out.square * out.square - 3 * out.cube * here);
  if (root > out.square) {
    const double fold = here / (root - out.square);
    if (fold < PREDICTION_TRUSTED) {
      out.fold = fold;
      out.fold_distance = std::abs(points.way) * polynomial(out, fold);
      return out;
    }
  }
  // by the derivatives alone
  out.square = (here - before) / 2;
  out.cube = 0;
  if (before > here && here * here < 2 * PREDICTION_TRUSTED * (before - here)) {
    out.fold = here / (before - here);
    out.fold_distance = std::abs(points.way) * here * out.fold / 2;
  }
  return out;
}

// Solve for the way of the leading edge where d has gone `on`, both in units of ways.
double led(double on, double way, const LeadingEdge& leading) {
  const double here = leading.here, fold = leading.fold;
  if (on * std::abs(way) >= leading.fold_distance) return fold;
  double low = 0, high = std::min(fold, 2 * on / here);
  double lead = std::min(on / here, high);
  for (int i = 0; i < std::numeric_limits<double>::digits; ++i) {
    const double value = polynomial(leading, lead) - on;
    (value > 0 ? high : low) = lead;
    const double slope = here + lead * (2 * leading.square + 3 * lead * leading.cube);
    const double newton = slope > 0 ? lead - value / slope : infinity;
    if (std::abs(newton - lead) < 1e-9 * high) break;
    lead = low < newton && newton < high ? newton : 0.5 * (low + high);
  }
  return lead;
}

}  // namespace

LeadingEdge leading_edge(const TwoPoints& points) {
  const double fastest = largest(points.rate);
  int first = 0;
  while (std::abs(points.rate[first]) < fastest) ++first;
  LeadingEdge leading = follow_edge(first, points, fastest);
  for (int edge = 0; edge < int(points.rate.size()); ++edge) {
    if (!(std::abs(points.rate[edge]) > LEADING_SHARE * fastest)) continue;
    const LeadingEdge other = follow_edge(edge, points, fastest);
    if (other.fold_distance < leading.fold_distance) leading = other;
  }
  return leading;
}

OtherFold other_fold(const TwoPoints& points, int leading) {
  const double fastest = largest(points.rate);
  const int count = int(points.rate.size()) / 2;
  OtherFold out;
  for (int edge = 0; edge < 2 * count; ++edge) {
    const int apart = std::abs(edge / 2 - leading / 2);
    if (std::min(apart, count - apart) <= 1) continue;
    if (!(std::abs(points.rate[edge]) > LEADING_SHARE * fastest)) continue;
    const LeadingEdge other = follow_edge(edge, points, fastest);
    if (other.fold_distance < out.distance) out = {edge, other.fold_distance};
  }
  return out;
}

Vector predict_ends(const TwoPoints& points, double on, const LeadingEdge& leading) {
  const auto& [ends, rate, ends_before, rate_before, way] = points;
  const double here_by = leading.gone / rate[leading.edge];
  const double before_by = leading.gone / rate_before[leading.edge];
  const bool leads = !std::isnan(leading.here);
  const double lead = leads ? led(on / way, way, leading) : 0;
  Vector motion(ends.size());
  for (int e = 0; e < int(ends.size()); ++e) {
    if (!leads) {
      motion[e] = rate[e] * on + (rate[e] - rate_before[e]) * on * on / (2 * way);
      continue;
    }
    const double here = rate[e] * here_by, before = rate_before[e] * before_by;
    const double moved = outwards(e) * (ends[e] - ends_before[e]);
    if (lead < CUBIC_OF_OTHERS_TRUSTED) {
      const double square = 2 * here + before - 3 * moved, cube = here + before - 2 * moved;
      motion[e] = lead * (here + lead * (square + lead * cube));
    } else {
      motion[e] = lead * (here + lead * (here - before) / 2);
    }
  }
  return move_edges(ends, motion);
}

}  // namespace adhesis
