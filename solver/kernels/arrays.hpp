// Names for arrays, and sums whose order does not depend on the processor.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <vector>

// Functions of long loops, which g++ makes for vectors of four numbers, too, and chooses when the
// module is loaded. Sums in fixed lanes and no contracted a·b + c: both have the same bits.
#if defined(__x86_64__) && !defined(__clang__)
#define WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define WIDE
#endif

namespace adhesis {

using Vector = std::vector<double>;
using Integers = std::vector<int>;
using Pair = std::array<Vector, 2>;
using Flags = std::vector<char>;  // true or false; not bool, so that each has an address

// Numbers that are computed before they are read: setting many to zero takes long.
using Unset = std::unique_ptr<double[]>;
inline Unset unset(int count) { return std::make_unique_for_overwrite<double[]>(count); }

using std::numbers::pi;
inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// Four numbers that are computed together, by whatever vectors the processor has. Their alignment
// is given, or g++ takes 16 in a common function and 32 in one for wider vectors: numbers on the
// heap that the first has placed crash the second. A template's argument loses it, hence no
// std::array.
typedef double Four __attribute__((vector_size(32), aligned(32)));
static_assert(alignof(Four) == sizeof(Four));

[[gnu::always_inline]] inline Four load_four(const double* from) {
  Four out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

[[gnu::always_inline]] inline void store_four(Four value, double* to) {
  std::memcpy(to, &value, sizeof value);
}

// Sum a_i b_i: every fourth product apart, in two turns, then these eight in pairs.
inline double dot(const double* a, const double* b, int count) {
  Four even = {}, odd = {};
  int i = 0;
  for (; i + 8 <= count; i += 8) {
    even += load_four(a + i) * load_four(b + i);
    odd += load_four(a + i + 4) * load_four(b + i + 4);
  }
  Four both = even + odd;
  double total = (both[0] + both[1]) + (both[2] + both[3]);
  for (; i < count; ++i) total += a[i] * b[i];
  return total;
}

// Add up the numbers of each of four, in pairs.
[[gnu::always_inline]] inline Four sum_each(const Four (&x)[4]) {
  const Four even = __builtin_shufflevector(x[0], x[1], 0, 4, 2, 6);
  const Four odd = __builtin_shufflevector(x[0], x[1], 1, 5, 3, 7);
  const Four even_below = __builtin_shufflevector(x[2], x[3], 0, 4, 2, 6);
  const Four odd_below = __builtin_shufflevector(x[2], x[3], 1, 5, 3, 7);
  const Four first = even + odd, last = even_below + odd_below;
  return __builtin_shufflevector(first, last, 0, 1, 4, 5) +
         __builtin_shufflevector(first, last, 2, 3, 6, 7);
}

// Compute out = base + a x, without a base a x, four rows at a time; `a` has at least four rows and
// columns, or no columns.
[[gnu::always_inline]] inline void apply(const double* a, int rows, int columns, const double* x,
                                         const double* base, double* out) {
  const int last = columns - 4;
  Four rest = {};  // the columns after the last whole four, behind some that count no more
  for (int j = columns - columns % 4; j < columns; ++j) rest[j - last] = x[j];
  for (int i = 0; i < rows; i += 4) {
    const int row = std::min(i, rows - 4);
    Four sum[4] = {};
    for (int j = 0; j < columns; j += 4) {
      const int at = std::min(j, last);
      const Four here = at == j ? load_four(x + j) : rest;
      for (int r = 0; r < 4; ++r) sum[r] += load_four(a + (row + r) * columns + at) * here;
    }
    const Four product = sum_each(sum);
    store_four(base ? load_four(base + row) + product : product, out + row);
  }
}

// Add factor x_i to every out_i.
inline void add_scaled(double factor, const double* x, double* out, int count) {
  for (int i = 0; i < count; ++i) out[i] += factor * x[i];
}

inline double largest(const Vector& values) {
  double size = 0;
  for (double value : values) size = std::max(size, std::abs(value));
  return size;
}

inline double norm(const Vector& values) {
  double square = 0;
  for (double value : values) square += value * value;
  return std::sqrt(square);
}

// Indices of those that are marked.
inline Integers indices(const Flags& marked) {
  Integers out;
  for (int i = 0; i < int(marked.size()); ++i)
    if (marked[i]) out.push_back(i);
  return out;
}

// Throw if a signal's handler in Python raises: an interrupt, or a time limit. Long kernels call it
// between their steps, where what they change is complete.
void check_signals();

}  // namespace adhesis
