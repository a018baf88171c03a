#include "tree.hpp"

#include <algorithm>

#include "tolerances.hpp"

namespace adhesis {

namespace {

// Make the interval of a run of gaps.
Gap interval(const std::vector<Gap>& gaps, int first, int last) {
  const double left = gaps[first].patch[0], right = gaps[last].patch[1];
  const double length = gaps[last].end[1] - gaps[first].end[0];
  return {{gaps[first].end[0], gaps[last].end[1]}, {left, right}, alpha_of(length, left, right)};
}

// Divide the gaps from `first` to `last` into two runs, and these likewise: at the widest patch of
// the middle third. Appends the halves of each run, and returns its number.
int divide(const std::vector<Gap>& gaps, int first, int last,
           std::vector<std::array<int, 2>>& halves) {
  if (first == last) return first;
  const int third = (last - first) / 3;
  int end = first + third;  // of the first run
  for (int k = end; k < last - third; ++k)
    if (gaps[k].patch[1] > gaps[end].patch[1]) end = k;
  const int one = divide(gaps, first, end, halves), two = divide(gaps, end + 1, last, halves);
  halves.push_back({one, two});
  return int(halves.size()) - 1;
}

// The coordinate s = sin(c η)/sin(c) of the charges of a run.
//
// In η the potentials of the others are analytic up to the lines Im η = ±τ, τ = π/(2α). The sine
// takes the strip between these nearly to an ellipse, so that series in s converge up to π/2 times
// as fast as in η (Kosloff, Tal-Ezer, J. Comput. Phys. 104:457, 1993). The images of the lines and
// the branch points of the inverse, s = ±1/sin(c), limit the rate; with `c` it is within 3 % of the
// largest, where both do alike.
struct RunMap {
  double c, sine, rate;

  explicit RunMap(const Gap& interval) {
    const double tau = pi / (2 * interval.alpha);
    c = 0.5 * pi / (1 + tau * (1.1 + 0.18 * tau));
    sine = std::sin(c);
    rate = std::min(std::asinh(std::sinh(c * tau) / sine), -std::log(std::tan(0.5 * c)));
  }
};

// Return the number of charges that a run needs.
int wanted_rank(const Gap& interval, double digits) {
  int wanted = int(std::ceil(digits / RunMap(interval).rate));
  return std::min(std::max(wanted, gauss_rules().front().count), MOST_CHARGES);
}

// Chebyshev nodes, rising, and their barycentric weights.
struct ChebyshevRule {
  Vector node, share;
};

// No lambda: g++ would try for seconds to make a constant of what it returns.
std::vector<ChebyshevRule> chebyshev_rules() {
  std::vector<ChebyshevRule> all;
  for (int count = 0; count <= MOST_CHARGES; ++count) {
    ChebyshevRule& rule = all.emplace_back();
    for (int i = 0; i < count; ++i) {
      const double t = pi * (count - i - 0.5) / count;
      rule.node.push_back(std::cos(t));
      rule.share.push_back(i % 2 == 0 ? std::sin(t) : -std::sin(t));
    }
  }
  return all;
}

const ChebyshevRule& chebyshev_rule(int rank) {
  static const std::vector<ChebyshevRule> rules = chebyshev_rules();
  return rules[rank];
}

// Compute K between two sets of charges.
WIDE void fill_kernel(const double* theta, const double* stretch, int rows, const double* other,
                      const double* other_stretch, int columns, double* out) {
  double sine[MOST_CHARGES], cosine[MOST_CHARGES];
  for (int j = 0; j < columns; ++j) {
    sine[j] = std::sin(0.5 * other[j]);
    cosine[j] = std::cos(0.5 * other[j]);
  }
  for (int i = 0; i < rows; ++i) {
    const double si = std::sin(0.5 * theta[i]), ci = std::cos(0.5 * theta[i]);
    const double scale = stretch[i] / (4 * pi);
    double* row = out + i * columns;
    for (int j = 0; j < columns; ++j) {
      double half = si * cosine[j] - ci * sine[j];
      row[j] = scale * other_stretch[j] / (half * half);
    }
  }
}

// Compute the interpolation of potentials from the nodes of an interval to points inside.
WIDE void fill_interpolation(const Gap& interval, const RunMap& map, const Vector& node,
                             const Vector& share, const double* theta, const double* stretch,
                             int points, double* out) {
  const int rank = int(node.size());
  for (int b = 0; b < points; ++b) {
    MappedPoint at = eta_at(interval, theta[b]);
    const double s = std::sin(map.c * at.eta) / map.sine, scale = stretch[b] * at.slope;
    double* row = out + b * rank;
    double total = 0;
    for (int a = 0; a < rank; ++a) row[a] = share[a] / (s - node[a]);
    for (int a = 0; a < rank; ++a) total += row[a];
    if (std::isfinite(total)) {
      for (int a = 0; a < rank; ++a) row[a] *= scale / total;
    } else {  // the point is a node
      for (int a = 0; a < rank; ++a) row[a] = s == node[a] ? scale : 0;
    }
  }
}

// Compute some rows and four columns of base + a b; without a base, of a b. The element of `a` in
// row i and column k lies at i row_step + k inner_step.
template <int rows>
[[gnu::always_inline]] inline void multiply_tile(const double* a, int row_step, int inner_step,
                                                 const double* b, int inner, int columns,
                                                 const double* base, double* out) {
  Four sum[rows] = {};
  if (base)
    for (int i = 0; i < rows; ++i) sum[i] = load_four(base + i * columns);
  int k = 0;
  for (; k + 4 <= inner; k += 4, a += 4 * inner_step, b += 4 * columns) {
    const Four b0 = load_four(b), b1 = load_four(b + columns);
    const Four b2 = load_four(b + 2 * columns), b3 = load_four(b + 3 * columns);
    for (int i = 0; i < rows; ++i) {
      const double* c = a + i * row_step;
      sum[i] +=
          (c[0] * b0 + c[inner_step] * b1) + (c[2 * inner_step] * b2 + c[3 * inner_step] * b3);
    }
  }
  for (; k < inner; ++k, a += inner_step, b += columns)
    for (int i = 0; i < rows; ++i) sum[i] += a[i * row_step] * load_four(b);
  for (int i = 0; i < rows; ++i) store_four(sum[i], out + i * columns);
}

// Compute out = base + a b by tiles, of at least four rows and columns; the last tiles overlap
// those before, where they compute the same again. Those above the diagonal of a symmetric product
// are not computed, but reflected.
[[gnu::always_inline]] inline void multiply_by_tiles(const double* a, int row_step, int inner_step,
                                                     const double* b, int rows, int inner,
                                                     int columns, const double* base, double* out,
                                                     bool is_symmetric) {
  for (int j = 0; j < columns; j += 4) {
    const int column = std::min(j, columns - 4);
    for (int i = is_symmetric ? j : 0; i < rows; i += 4) {
      const int row = std::min(i, rows - 4), at = row * columns + column;
      multiply_tile<4>(a + row * row_step, row_step, inner_step, b + column, inner, columns,
                       base ? base + at : nullptr, out + at);
    }
  }
  for (int i = 0; is_symmetric && i < rows; ++i)
    for (int j = 0; j < i; ++j) out[j * columns + i] = out[i * columns + j];
}

// out = base + a b, a of (rows, inner), b of (inner, columns).
WIDE void multiply(const double* a, const double* b, int rows, int inner, int columns, double* out,
                   const double* base = nullptr, bool is_symmetric = false) {
  multiply_by_tiles(a, inner, 1, b, rows, inner, columns, base, out, is_symmetric);
}

// out = base + aᵀ b, a of (inner, rows), b of (inner, columns).
WIDE void multiply_transposed(const double* a, const double* b, int inner, int rows, int columns,
                              double* out, const double* base = nullptr,
                              bool is_symmetric = false) {
  multiply_by_tiles(a, 1, rows, b, rows, inner, columns, base, out, is_symmetric);
}

// Compute out = aᵀ x, a of (rows, columns).
[[gnu::always_inline]] inline void apply_transposed(const double* a, int rows, int columns,
                                                    const double* x, double* out) {
  for (int j = 0; j < columns; j += 4) {
    const int column = std::min(j, columns - 4);
    multiply_tile<1>(x, 0, 1, a + column, rows, columns, nullptr, out + column);
  }
}

// Invert the left half of n rows of `stride`, a multiple of eight; the right half holds the unit
// matrix. By elimination with the largest pivots of columns, on both halves at once.
WIDE void invert(double* a, int n, int stride, double* inverse) {
  const int first = stride / 2;
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(a[i * stride + k]) > std::abs(a[best * stride + k])) best = i;
    if (best != k) std::swap_ranges(a + k * stride, a + (k + 1) * stride, a + best * stride);
    double* pivot_row = a + k * stride;
    const double pivot = 1 / pivot_row[k];
    for (int i = k + 1; i < n; ++i) {
      double* row = a + i * stride;
      const double factor = -(row[k] * pivot);
      for (int j = (k + 1) / 4 * 4; j < stride; j += 4)
        store_four(load_four(row + j) + factor * load_four(pivot_row + j), row + j);
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    double* row = a + k * stride;
    const double pivot = 1 / row[k];
    for (int j = first; j < stride; j += 4) {
      Four sum = load_four(row + j);
      for (int i = k + 1; i < n; ++i) sum += -row[i] * load_four(a + i * stride + j);
      store_four(sum * pivot, row + j);
    }
    std::copy_n(row + first, n, inverse + k * n);
  }
}

// Add up the squares of the eigenvalues of a matrix.
double trace_of_square(const double* a, int n) {
  double total = 0;
  for (int i = 0; i < n; ++i) {
    double row = 0;
    for (int j = 0; j < i; ++j) row += a[i * n + j] * a[j * n + i];
    total += 2 * row + a[i * n + i] * a[i * n + i];
  }
  return total;
}

// Bring the pivot of two rows with the largest determinant to row and column k.
void take_pivot(const std::array<double*, 3>& matrices, int k, int n) {
  auto [h, r, x] = matrices;
  int best = k;
  double most = 0;
  for (int i = k; i < n; ++i) {
    const int at = i * n + i;
    const double det = std::abs(h[at] * r[at] - x[at] * x[at]);
    if (det > most) {
      best = i;
      most = det;
    }
  }
  if (best == k) return;
  for (double* a : matrices) {
    std::swap_ranges(a + k * n, a + (k + 1) * n, a + best * n);
    for (int i = 0; i < n; ++i) std::swap(a[i * n + k], a[i * n + best]);
  }
}

}  // namespace

WIDE NegativeCount count_negative(double* h, double* r, int n) {
  Vector unit(n * n), of_h(n), of_r(n);
  for (int i = 0; i < n; ++i) unit[i * n + i] = 1;
  double* x = unit.data();
  NegativeCount out;
  for (int k = 0; k < n; ++k) {
    take_pivot({h, r, x}, k, n);
    const double a = h[k * n + k], b = x[k * n + k], c = r[k * n + k];
    const double det = a * c - b * b;
    out.nearest = std::min(out.nearest, std::abs(det));
    if (det < 0)
      out.negative += 1;
    else if (a + c < 0)
      out.negative += 2;
    for (int i = k + 1; i < n; ++i) {
      of_h[i] = x[i * n + k];
      of_r[i] = x[k * n + i];
    }
    const double *h_k = h + k * n, *r_k = r + k * n;
    for (int i = k + 1; i < n; ++i) {
      const double own_h = h[i * n + k], own_r = r[i * n + k];
      const double first = (c * own_h - b * of_h[i]) / det;
      const double second = (a * of_h[i] - b * own_h) / det;
      const double third = (c * of_r[i] - b * own_r) / det;
      const double fourth = (a * own_r - b * of_r[i]) / det;
      double *h_i = h + i * n, *x_i = x + i * n, *r_i = r + i * n;
      for (int j = k + 1; j < n; ++j) {
        h_i[j] -= first * h_k[j] + second * of_h[j];
        x_i[j] -= first * of_r[j] + second * r_k[j];
        r_i[j] -= third * of_r[j] + fourth * r_k[j];
      }
    }
  }
  return out;
}

Tree::Tree(const Nodes& nodes, double digits, double room) : count(nodes.gap_count()) {
  std::vector<std::array<int, 2>> halves(count, {-1, -1});
  divide(nodes.gaps, 0, count - 1, halves);
  runs.resize(halves.size());
  Run end;  // of all runs so far
  for (int i = 0; i < run_count(); ++i) {
    Run& run = runs[i];
    run = end;
    run.half = halves[i];
    int one = 0, two = 0;
    if (i < count) {
      run.range = {i, i};
      run.room = nodes.offset[i + 1] - nodes.offset[i];
    } else {
      const Run &left = runs[run.half[0]], &right = runs[run.half[1]];
      one = left.room;
      two = right.room;
      run.range = {left.range[0], right.range[1]};
      if (i < run_count() - 1) {  // outside the whole there is nothing
        run.interval = interval(nodes.gaps, run.range[0], run.range[1]);
        run.rank = wanted_rank(run.interval, digits);
        run.room = std::min(int(room * run.rank), MOST_CHARGES);
      }
    }
    end.node += run.room;
    end.response += run.room * run.room;
    end.inverse += one * one;
    end.kernel += one * two;
    end.interpolation += (one + two) * run.room;
  }
  theta.resize(end.node);
  stretch.resize(end.node);
  kernel = unset(end.kernel);
  interpolation = unset(end.interpolation);
  response = unset(end.response);
  inverse = unset(end.inverse);
  inner_potential = unset(end.interpolation);
}

void Tree::place_gap(const Nodes& nodes, int k) {
  const GaussRule& rule = gauss_rules()[nodes.orders[k]];
  for (int i = 0; i < rule.count; ++i) {
    const int node = nodes.offset[k] + i;
    theta[node] = nodes.theta[node];
    stretch[node] = nodes.weight[node] / rule.weights[i];
  }
  runs[k].interval = nodes.gaps[k];
  runs[k].rank = rule.count;
}

WIDE void Tree::place_charges(int index, bool own, std::array<bool, 2> halves) {
  Run& run = runs[index];
  const Run &one = runs[run.half[0]], &two = runs[run.half[1]];
  const int rank = run.rank;
  const auto& [node, share] = chebyshev_rule(rank);
  const RunMap map(run.interval);
  const std::array<int, 2> ranks = {one.rank, two.rank};
  own = own || run.placed != ranks;
  run.placed = ranks;
  for (int i = 0; own && i < rank; ++i) {
    Place place = theta_at(run.interval, std::asin(node[i] * map.sine) / map.c);
    theta[run.node + i] = place.theta;
    stretch[run.node + i] = place.stretch;
  }
  double* out = &interpolation[run.interpolation];
  for (int half = 0; half < 2; ++half) {
    const Run& child = runs[run.half[half]];
    if (own || halves[half])
      fill_interpolation(run.interval, map, node, share, &theta[child.node], &stretch[child.node],
                         child.rank, out);
    out += child.rank * rank;
  }
  fill_kernel(&theta[one.node], &stretch[one.node], one.rank, &theta[two.node], &stretch[two.node],
              two.rank, &kernel[run.kernel]);
}

bool Tree::place_anew(int index, const std::vector<Gap>& gaps, double digits, Flags& moved) {
  Run& run = runs[index];
  const auto [one, two] = run.half;
  if (run.rank > 0) {
    const Gap before = run.interval;
    run.interval = interval(gaps, run.range[0], run.range[1]);
    moved[index] = run.interval.end != before.end || run.interval.patch != before.patch;
    const int wanted = wanted_rank(run.interval, digits);
    if (wanted > run.room) return false;
    if (wanted > run.rank + 1) {  // one fewer errs about as much as the modes of gaps
      run.rank = wanted;
      moved[index] = true;
    }
  }
  place_charges(index, moved[index], {bool(moved[one]), bool(moved[two])});
  return true;
}

void Tree::factor(int index) {
  Run& run = runs[index];
  const Run &one = runs[run.half[0]], &two = runs[run.half[1]];
  const int n = one.rank, m = two.rank, r = run.rank;
  const double *first = &response[one.response], *second = &response[two.response];
  const double* k12 = &kernel[run.kernel];
  // (1 - H R1)⁻¹, H = K12 R2 K21
  const int stride = (n + 3) / 4 * 8;
  thread_local Vector room;
  room.resize(std::max(room.size(), size_t(2 * n * m + n * (2 * n + stride) + (2 * n + m) * r)));
  double *k21 = room.data(), *half = k21 + m * n, *reflected = half + n * m;
  double *matrix = reflected + n * n, *eliminated = matrix + n * n;
  double *drive = eliminated + n * stride, *charges = drive + n * r;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < m; ++j) k21[j * n + i] = k12[i * m + j];
  multiply(k12, second, n, m, m, half);
  multiply(half, k21, n, m, n, reflected, nullptr, true);
  multiply(reflected, first, n, n, n, matrix);
  const double squares = trace_of_square(matrix, n);
  std::fill_n(eliminated, n * stride, 0.0);
  for (int i = 0; i < n; ++i) {
    double* row = eliminated + i * stride;
    for (int j = 0; j < n; ++j) row[j] = (i == j ? 1 : 0) - matrix[i * n + j];
    row[stride / 2 + i] = 1;
  }
  double* unit = &inverse[run.inverse];
  invert(eliminated, n, stride, unit);
  // With H = K12 R2 K21 a pair of halves has n - count [[H, 1], [1, R1]] negative eigenvalues more
  // than its halves: Haynsworth's formula, applied twice. These are none where the eigenvalues of
  // H R1, real if one of both is definite, are below one.
  run.count = {one.count.negative + two.count.negative, 1};
  // Below so large a sum of squares none is near one, and none is counted.
  const double weak = 1 - 1 / SOFT_EDGE;
  if (squares > weak * weak || (one.count.negative > 0 && two.count.negative > 0)) {
    Vector own_first(first, first + n * n);
    const NegativeCount pair = count_negative(reflected, own_first.data(), n);
    run.count.negative += n - pair.negative;
    run.count.nearest = pair.nearest;
  }
  if (r == 0) return;
  const double *e1 = &interpolation[run.interpolation], *e2 = e1 + n * r;
  double *d1 = &inner_potential[run.interpolation], *d2 = d1 + n * r;
  // D1 = (1 - H R1)⁻¹ (E1 + K12 R2 E2), D2 = E2 + K21 R1 D1
  // `drive` and `charges` are by the potential, with the other sign
  multiply(half, e2, n, m, r, drive, e1);
  multiply(unit, drive, n, n, r, d1);
  multiply(first, d1, n, n, r, charges);
  multiply_transposed(k12, charges, n, m, r, d2, e2);
  multiply(second, d2, m, m, r, charges + n * r);
  double* own = &response[run.response];
  multiply_transposed(e1, charges, n + m, r, r, own, nullptr, true);
}

WIDE void Tree::charge(int index, Charges& charges) const {
  const Run& run = runs[index];
  const Run &one = runs[run.half[0]], &two = runs[run.half[1]];
  const int n = one.rank, m = two.rank, r = run.rank;
  const double *first = &response[one.response], *second = &response[two.response];
  const double* k12 = &kernel[run.kernel];
  double *g1 = &charges.potential_of_sibling[one.node],
         *g2 = &charges.potential_of_sibling[two.node];
  double q1[MOST_CHARGES], q2[MOST_CHARGES], g[MOST_CHARGES], alone[2 * MOST_CHARGES];
  std::copy_n(&charges.isolated[one.node], n, alone);
  std::copy_n(&charges.isolated[two.node], m, alone + n);
  // g1 = -(1 - H R1)⁻¹ K12 (q2° + R2 K21 q1°);  g2 = -K21 q1
  apply_transposed(k12, n, m, alone, g2);
  apply(second, m, m, g2, alone + n, q2);
  apply(k12, n, m, q2, nullptr, g);
  apply(&inverse[run.inverse], n, n, g, nullptr, g1);  // still with the other sign
  apply(first, n, n, g1, alone, q1);
  apply_transposed(k12, n, m, q1, g2);
  for (int i = 0; i < n; ++i) g1[i] = -g1[i];
  for (int i = 0; i < m; ++i) g2[i] = -g2[i];
  // q = D1ᵀ q1° + D2ᵀ q2°: the responses are symmetric
  apply_transposed(&inner_potential[run.interpolation], n + m, r, alone,
                   &charges.isolated[run.node]);
}

WIDE void Tree::pass_down(const Flags& wanted, std::span<const Charges> charges,
                          std::span<Vector> potential) const {
  for (int index = run_count() - 1; index >= count; --index) {
    if (!wanted[index]) continue;
    const Run& run = runs[index];
    const double* inward = &inner_potential[run.interpolation];
    for (int half : run.half) {
      const Run& child = runs[half];
      for (size_t load = 0; wanted[half] && load < charges.size(); ++load)
        apply(inward, child.rank, run.rank, potential[load].data() + run.node,
              charges[load].potential_of_sibling.data() + child.node,
              potential[load].data() + child.node);
      inward += child.rank * run.rank;
    }
  }
}

}  // namespace adhesis
