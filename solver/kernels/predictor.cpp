#include "predictor.hpp"

#include "edge_law.hpp"

namespace adhesis {

namespace {

// d on the way λ of the leading edge.
double polynomial(const LeadingEdge& leading, double way) {
  return way * (leading.here + way * (leading.square + way * leading.cube));
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

Predictor::Predictor(double d, Vector ends, Vector rate,
                     std::optional<std::tuple<double, Vector, Vector>> before)
    : d(d), ends(std::move(ends)), rate(std::move(rate)), fastest(largest(this->rate)) {
  if (!before) return;
  double d_before;
  std::tie(d_before, rate_before_, ends_before_) = std::move(*before);
  if (rate_before_.size() != this->rate.size()) return;
  way = d - d_before;
  if (way == 0) return;
  leading_ = find_leading_edge();
  fold = {leading_.edge, leading_.fold_distance};
}

bool Predictor::may_lead(int edge) const { return std::abs(rate[edge]) > LEADING_SHARE * fastest; }

LeadingEdge Predictor::follow_edge(int edge) const {
  const double gone = (ends[edge] - ends_before_[edge]) * outwards(edge);
  const double before = gone / (way * rate_before_[edge]);
  const double here = gone / (way * rate[edge]);
  LeadingEdge out = {edge, gone, not_a_number, not_a_number, not_a_number, infinity, infinity};
  if (!(0 < before && before < infinity && 0 < here && here < infinity)) return out;
  out.here = here;
  out.square = 2 * here + before - 3;
  out.cube = here + before - 2;
  const double root = std::sqrt(out.square * out.square - 3 * out.cube * here);
  if (root > out.square) {
    const double extremum = here / (root - out.square);
    if (extremum < PREDICTION_TRUSTED) {
      out.fold = extremum;
      out.fold_distance = std::abs(way) * polynomial(out, extremum);
      return out;
    }
  }
  // by the derivatives alone
  out.square = (here - before) / 2;
  out.cube = 0;
  if (before > here && here * here < 2 * PREDICTION_TRUSTED * (before - here)) {
    out.fold = here / (before - here);
    out.fold_distance = std::abs(way) * here * out.fold / 2;
  }
  return out;
}

// Of the edges that are not much slower than the fastest it is the one that comes to a fold first;
// the fastest, if none does.
LeadingEdge Predictor::find_leading_edge() const {
  int first = 0;
  while (std::abs(rate[first]) < fastest) ++first;
  LeadingEdge leading = follow_edge(first);
  for (int edge = 0; edge < int(rate.size()); ++edge) {
    if (!may_lead(edge)) continue;
    const LeadingEdge other = follow_edge(edge);
    if (other.fold_distance < leading.fold_distance) leading = other;
  }
  return leading;
}

FoldAhead Predictor::other_fold() const {
  FoldAhead out;
  if (fold.distance == infinity) return out;
  const int count = int(rate.size()) / 2;
  for (int edge = 0; edge < 2 * count; ++edge) {
    const int apart = std::abs(edge / 2 - fold.edge / 2);
    if (std::min(apart, count - apart) <= 1 || !may_lead(edge)) continue;
    const LeadingEdge other = follow_edge(edge);
    if (other.fold_distance < out.distance) out = {edge, other.fold_distance};
  }
  return out;
}

Vector Predictor::predict_ends(double at) const {
  const double on = at - d;
  Vector motion(ends.size());
  if (!(on * way > 0 && std::abs(on) < PREDICTION_TRUSTED * std::abs(way))) {
    add_scaled(on, rate.data(), motion.data(), int(motion.size()));
    return move_edges(ends, motion);
  }
  const double here_by = leading_.gone / rate[leading_.edge];
  const double before_by = leading_.gone / rate_before_[leading_.edge];
  const bool leads = !std::isnan(leading_.here);
  const double lead = leads ? led(on / way, way, leading_) : 0;
  for (int e = 0; e < int(ends.size()); ++e) {
    if (!leads) {
      motion[e] = rate[e] * on + (rate[e] - rate_before_[e]) * on * on / (2 * way);
      continue;
    }
    const double here = rate[e] * here_by, before = rate_before_[e] * before_by;
    const double moved = outwards(e) * (ends[e] - ends_before_[e]);
    if (lead < CUBIC_OF_OTHERS_TRUSTED) {
      const double square = 2 * here + before - 3 * moved, cube = here + before - 2 * moved;
      motion[e] = lead * (here + lead * (square + lead * cube));
    } else {
      motion[e] = lead * (here + lead * (here - before) / 2);
    }
  }
  return move_edges(ends, motion);
}

double Predictor::reach(double most, double resolution) const {
  const double straight = most / std::max(fastest, std::numeric_limits<double>::min());
  if (fold.distance == infinity) return straight;
  // next to a fold: the step before it would be shorter than what is left before it
  if (fold.distance < 0.7 * resolution) return across(fold.distance, resolution);
  const double left = std::max(LEFT_BEFORE_FOLD * fold.distance, BEYOND_FOLD * resolution);
  const double near = fold.distance - left;
  const double lead = most / std::abs(leading_.gone);
  if (!(lead < leading_.fold)) return near;
  const double mean_slope = leading_.here + lead * (leading_.square + lead * leading_.cube);
  return std::min(std::abs(way) * lead * mean_slope, near);
}

double Predictor::across(double distance, double resolution) const {
  return (1 + LEFT_BEFORE_FOLD) * distance + BEYOND_FOLD * resolution;
}

}  // namespace adhesis
