#include "gap.hpp"

namespace adhesis {

namespace {

constexpr int per_unit = 32;  // entries of the table of exp(y) - 1 for a unit of y

// y is at most the α of a gap, twice: below 40, as patches are wider than rounding
Vector tabulate_expm1() {
  Vector table(40 * per_unit);
  for (int i = 0; i < int(table.size()); ++i) table[i] = std::expm1(double(i) / per_unit);
  return table;
}

}  // namespace

WIDE void place_nodes(const Gap& gap, std::span<const double> cosine, std::span<const double> sine,
                      double* __restrict theta, double* __restrict theta_by_t) {
  static const Vector kept = tabulate_expm1();
  const double* table = kept.data();
  const int count = int(cosine.size());
  const double alpha = 2 * gap.alpha;
  const int middle = (count + 1) / 2;  // nodes up to it are measured from the right end
  for (int side = 0; side < 2; ++side) {
    auto poles = poles_of(gap, side);
    const double near = poles.near, far = poles.far, end = gap.end[side];
    const double inwards = 1.0 - 2 * side, slope = alpha / (near + far), product = near * far;
    for (int i = side == 1 ? 0 : middle, last = side == 1 ? middle : count; i < last; ++i) {
      double y = alpha * (1 + inwards * cosine[i]);
      int entry = int(y * per_unit);
      double x = y - double(entry) / per_unit;
      double grown = 1.0 / 24 + x * (1.0 / 120 + x * (1.0 / 720 + x * (1.0 / 5040)));
      grown = x * (1 + x * (0.5 + x * (1.0 / 6 + x * grown)));
      grown = table[entry] + grown * (1 + table[entry]);
      double r = grown * product / (far + (1 + grown) * near);
      theta_by_t[i] = slope * (near + r) * (far - r) * sine[i];
      theta[i] = end + inwards * r;
    }
  }
}

}  // namespace adhesis
