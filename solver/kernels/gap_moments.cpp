// Moments of the full-contact stress over a gap.
//
// In the coordinate η of a gap,
//
//     s_n = (2/π) ∫ S U_n(η) sqrt(1 - η²) dθ,     s^± = (1/π) ∫ S sqrt((1 ± η)/(1 ∓ η)) dθ.
//
// A gap is tiled with panels no longer than their distance from its ends; the cost of a moment
// grows with log(gap/λ_min). The two end pieces, with their square-root weight, are integrated with
// S interpolated on the finest panels.
#include "model.hpp"
#include "tolerances.hpp"

namespace adhesis {

namespace {

constexpr double surely_smooth = 2.0;  // modes·length/distance of a panel that surely spans less

// Nodes of the moments: 1 - η and 1 + η, and the weights times S and S'.
struct MomentNodes {
  std::array<Vector, 2> from_end;  // 1 + η and 1 - η: η measured from the left and the right end
  std::array<Vector, 2> source;
  int count;

  // Begin anew, with room for as many nodes.
  void begin(int most) {
    count = 0;
    for (auto* part : {&from_end, &source})
      for (Vector& values : *part) values.resize(std::max(values.size(), size_t(most)));
  }
};

// Compute artanh z/z, y = z², where |z| is hardly above 1/3.
double artanh_over(double y) {
  double series = 1.0 / 15 + y * (1.0 / 17 + y * (1.0 / 19 + y * (1.0 / 21 + y / 23)));
  series = 1.0 / 7 + y * (1.0 / 9 + y * (1.0 / 11 + y * (1.0 / 13 + y * series)));
  return 1 + y * (1.0 / 3 + y * (1.0 / 5 + y * series));
}

// Bound the number of nodes of both end pieces.
int most_end_nodes(const Gap& gap, const Panels& panels) {
  int cells = 2;
  for (double length : gap.patch)
    for (; length < 2 * panels.width; length *= 2) ++cells;
  return cells * int(std::max(panels.x.size(), panels.end_x.size()));
}

// Place nodes from the end of a gap inwards, in cells graded to the patch beyond that end.
WIDE void place_end_piece(const Gap& gap, int side, double length, const Panels& panels,
                          MomentNodes& nodes) {
  const Poles poles = poles_of(gap, side);
  const double scale = 1 / gap.alpha;
  const double origin = gap.end[side] / panels.width;
  const double per = (side == 0 ? 1 : -1) / panels.width;
  double r[64], position[64], value[64];  // distances of the nodes of a cell from the end
  double begin = 0, stop = std::min(length, poles.near);
  while (begin < length) {
    const bool first = begin == 0;
    const int rule = int(first ? panels.end_x.size() : panels.x.size());
    double* nearer = &nodes.from_end[side][nodes.count];
    double* farther = &nodes.from_end[1 - side][nodes.count];
    double* weight = &nodes.source[0][nodes.count];
    if (first) {
      // the square root at the end becomes smooth in y
      for (int i = 0; i < rule; ++i) {
        double y = panels.end_x[i];
        r[i] = y * y * stop;
        weight[i] = 2 * y * panels.end_w[i] * stop;
      }
    } else {
      const double middle = 0.5 * (begin + stop), half = 0.5 * (stop - begin);
      for (int i = 0; i < rule; ++i) {
        r[i] = middle + half * panels.x[i];
        weight[i] = half * panels.w[i];
      }
    }
    for (int i = 0; i < rule; ++i) {
      nearer[i] = 0.5 * scale * log_ratio(r[i], poles);
      farther[i] = 2 - nearer[i];
      position[i] = origin + per * r[i];
    }
    interpolate(panels.slope, position, rule, panels, value);
    for (int i = 0; i < rule; ++i) nodes.source[1][nodes.count + i] = weight[i] * value[i];
    interpolate(panels.stress, position, rule, panels, value);
    for (int i = 0; i < rule; ++i) weight[i] *= value[i];
    nodes.count += rule;
    begin = stop;
    stop = std::min(2 * begin, length);
    if (length - stop < 0.25 * begin) stop = length;
  }
}

// A panel of the tree: its first finest panel, its size in these, and its row of the weights.
struct Tile {
  long first, size;
  int row;
};

// Tile the gap between finest panels `first` and `last`, for as many modes.
void tile_gap(const Gap& gap, long first, long last, int modes, const Panels& panels,
              std::vector<Tile>& tiles) {
  tiles.clear();
  const int levels = int(panels.level_start.size());
  for (long panel = first; panel < last; panel += tiles.back().size) {
    int level = 0;
    long size = 1;
    while (level + 1 < levels) {
      const long twice = 2 * size;
      if ((panel & (twice - 1)) != 0 || panel + twice > last) break;
      const double length = double(twice) * panels.width;
      const double start = double(panel) * panels.width - gap.end[0];
      const double stop = gap.end[1] - double(panel + twice) * panels.width;
      if (start < length || stop < length) break;
      // the highest mode turns by modes·Δη/sqrt(1-η²) over the panel
      if (modes * length > surely_smooth * std::min(start, stop)) {
        FromEnds a = from_ends(gap, start, 0), b = from_ends(gap, stop, 1);
        double nearest = std::min(a.minus * a.plus, b.minus * b.plus);
        if (modes * (b.plus - a.plus) > PANEL_PHASE * std::sqrt(nearest)) break;
      }
      ++level;
      size = twice;
    }
    long row = (panel >> level) & ((panels.finest_count >> level) - 1);
    tiles.push_back({panel, size, panels.level_start[level] + int(row)});
  }
}

// Place the nodes of compressed panels.
//
// A panel is no longer than its distance from either end, so the logarithm of the map differs at
// its nodes from that at its centre by 2 artanh z with |z| ≤ 1/3: a short series.
WIDE void place_tiles(const Gap& gap, const std::vector<Tile>& tiles, const Panels& panels,
                      MomentNodes& nodes) {
  const int p = panels.nodes();
  const double scale = 1 / (2 * gap.alpha);
  for (const Tile& tile : tiles) {
    double centre = (double(tile.first) + 0.5 * double(tile.size)) * panels.width - gap.end[0];
    double half = 0.5 * double(tile.size) * panels.width;
    const int side = centre < gap.length() - centre ? 0 : 1;
    const Poles poles = poles_of(gap, side);
    if (side == 1) {
      centre = gap.length() - centre;
      half = -half;
    }
    const double a = poles.near + centre, b = poles.far - centre;
    const double distance = log_ratio(centre, poles) * scale;
    double* nearer = &nodes.from_end[side][nodes.count];
    double* farther = &nodes.from_end[1 - side][nodes.count];
    for (int i = 0; i < p; ++i) {
      double d = half * panels.x[i];
      double z = d * (a + b) / (2 * a * b + d * (b - a));
      nearer[i] = distance + 2 * z * artanh_over(z * z) * scale;
    }
    for (int i = 0; i < p; ++i) farther[i] = 2 - nearer[i];
    for (int which = 0; which < 2; ++which) {
      const double* weights = &panels.weights[which][tile.row * p];
      for (int i = 0; i < p; ++i) nodes.source[which][nodes.count + i] = weights[i];
    }
    nodes.count += p;
  }
}

// Place Gauss-Chebyshev nodes of the first kind, η = cos t, which serve s_n and s^± alike.
void place_short_gap(const Gap& gap, int modes, const Panels& panels, MomentNodes& nodes) {
  const int count = std::max(3 * panels.nodes() + 6, 2 * modes);
  nodes.begin(count + 4);
  Vector cosine(count), sine(count), theta(count), theta_by_t(count), value(count);
  for (int i = 0; i < count; ++i) {
    const double half = (i + 0.5) * pi / (2 * count), low = std::sin(half), high = std::cos(half);
    nodes.from_end[1][i] = 2 * low * low;
    nodes.from_end[0][i] = 2 * high * high;
    cosine[i] = high * high - low * low;
    sine[i] = 2 * low * high;
  }
  place_nodes(gap, cosine, sine, theta.data(), theta_by_t.data());
  for (int i = 0; i < count; ++i) {
    theta[i] /= panels.width;
    theta_by_t[i] *= pi / count;
  }
  for (int which = 0; which < 2; ++which) {
    interpolate(which == 0 ? panels.stress : panels.slope, theta.data(), count, panels,
                value.data());
    for (int i = 0; i < count; ++i) nodes.source[which][i] = theta_by_t[i] * value[i];
  }
  nodes.count = count;
}

void place_moment_nodes(const Gap& gap, int modes, const Panels& panels, MomentNodes& nodes) {
  const double width = panels.width;
  long first = long(std::floor(gap.end[0] / width)) + 2;  // end pieces are one to two panels long
  long last = long(std::ceil(gap.end[1] / width)) - 2;
  if (last < first) return place_short_gap(gap, modes, panels, nodes);  // they would meet
  thread_local std::vector<Tile> tiles;
  tile_gap(gap, first, last, modes, panels, tiles);
  const int most = most_end_nodes(gap, panels) + int(tiles.size()) * panels.nodes();
  nodes.begin(most + 4);
  place_end_piece(gap, 0, double(first) * width - gap.end[0], panels, nodes);
  place_end_piece(gap, 1, gap.end[1] - double(last) * width, panels, nodes);
  place_tiles(gap, tiles, panels, nodes);
}

[[gnu::always_inline]] inline double sum_lanes(Four x) { return (x[0] + x[1]) + (x[2] + x[3]); }

}  // namespace

WIDE void gap_moments(const Gap& gap, const Panels& panels, int modes, double* s,
                      std::array<std::array<double, 2>, 2>& ends) {
  thread_local MomentNodes nodes;  // kept, as gaps of many sizes follow each other
  place_moment_nodes(gap, modes, panels, nodes);
  for (; nodes.count % 4 != 0; ++nodes.count) {  // whole vectors, the last ones without weight
    nodes.from_end[0][nodes.count] = nodes.from_end[1][nodes.count] = 1;
    for (int which = 0; which < 2; ++which) nodes.source[which][nodes.count] = 0;
  }
  // sin((n+1)t), cos t = η, by its recurrence; four nodes at a time, for all modes
  double total[8 * MOST_CHARGES];  // four of either load
  std::fill_n(total, 8 * modes, 0.0);
  Four low[2] = {}, high[2] = {};
  for (int i = 0; i < nodes.count; i += 4) {
    const Four minus = load_four(&nodes.from_end[1][i]), plus = load_four(&nodes.from_end[0][i]);
    const Four product = minus * plus;
    Four now, previous = {}, twice;
    Four source[2] = {};
    for (int lane = 0; lane < 4; ++lane) {
      now[lane] = std::sqrt(product[lane]);
      twice[lane] = 2 * FromEnds{minus[lane], plus[lane]}.eta();
    }
    for (int which = 0; which < 2; ++which) {
      source[which] = load_four(&nodes.source[which][i]);
      const Four share = source[which] / (now * pi);
      low[which] += share * minus;
      high[which] += share * plus;
    }
    for (int n = 0; n < modes; ++n) {
      double* sums = &total[8 * n];
      store_four(load_four(sums) + source[0] * now, sums);
      store_four(load_four(sums + 4) + source[1] * now, sums + 4);
      const Four next = twice * now - previous;
      previous = now;
      now = next;
    }
  }
  for (int which = 0; which < 2; ++which) {
    ends[0][which] = sum_lanes(low[which]);
    ends[1][which] = sum_lanes(high[which]);
    for (int n = 0; n < modes; ++n)
      s[which * modes + n] = sum_lanes(load_four(&total[8 * n + 4 * which])) * (2 / pi);
  }
}

}  // namespace adhesis
