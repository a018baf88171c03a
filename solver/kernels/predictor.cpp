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
  for (int i = 0; i < std::numeric_limits<double>::digits; ++i) {
    const double middle = 0.5 * (low + high);
    (polynomial(leading, middle) > on ? high : low) = middle;
  }
  return low;
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
  leading = find_leading_edge();
}

bool Predictor::may_lead(int edge) const { return std::abs(rate[edge]) > LEADING_SHARE * fastest; }

LeadingEdge Predictor::follow_edge(int edge) const {
  const double gone = (ends[edge] - ends_before_[edge]) * outwards(edge);
  const double before = gone / (way * rate_before_[edge]);
  const double here = gone / (way * rate[edge]);
  LeadingEdge out = {edge, gone};
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
  LeadingEdge found = follow_edge(first);
  for (int edge = 0; edge < int(rate.size()); ++edge) {
    if (!may_lead(edge)) continue;
    const LeadingEdge other = follow_edge(edge);
    if (other.fold_distance < found.fold_distance) found = other;
  }
  return found;
}

LeadingEdge Predictor::other_leading() const {
  LeadingEdge out;
  if (leading.fold_distance == infinity) return out;
  const int count = int(rate.size()) / 2;
  for (int edge = 0; edge < 2 * count; ++edge) {
    const int apart = std::abs(edge / 2 - leading.edge / 2);
    if (std::min(apart, count - apart) <= 1 || !may_lead(edge)) continue;
    const LeadingEdge other = follow_edge(edge);
    if (other.fold_distance < out.fold_distance) out = other;
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
  const double here_by = leading.gone / rate[leading.edge];
  const double before_by = leading.gone / rate_before_[leading.edge];
  const bool leads = !std::isnan(leading.here);
  const double lead = leads ? led(on / way, way, leading) : 0;
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
  if (leading.fold_distance == infinity) return straight;
  // next to a fold: the step before it would be shorter than what is left before it
  if (leading.fold_distance < 0.7 * resolution) return across(leading.fold_distance, resolution);
  const double left = std::max(LEFT_BEFORE_FOLD * leading.fold_distance, BEYOND_FOLD * resolution);
  const double near = leading.fold_distance - left;
  const double lead = most / std::abs(leading.gone);
  if (!(lead < leading.fold)) return near;
  const double mean_slope = leading.here + lead * (leading.square + lead * leading.cube);
  return std::min(std::abs(way) * lead * mean_slope, near);
}

double Predictor::across(double distance, double resolution) const {
  return (1 + LEFT_BEFORE_FOLD) * distance + BEYOND_FOLD * resolution;
}

}  // namespace adhesis
