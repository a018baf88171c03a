#include "cholesky.hpp"

namespace adhesis {

namespace {

constexpr int block = 8;  // rows that are subtracted at once

// Subtract Σ c_i row_i from `out`, of eight rows of `stride`.
void subtract_eight(const double* c, const double* __restrict rows, int stride,
                    double* __restrict out, int columns) {
  const double *r0 = rows, *r1 = r0 + stride, *r2 = r1 + stride, *r3 = r2 + stride;
  const double *r4 = r3 + stride, *r5 = r4 + stride, *r6 = r5 + stride, *r7 = r6 + stride;
  for (int j = 0; j < columns; ++j)
    out[j] -= c[0] * r0[j] + c[1] * r1[j] + c[2] * r2[j] + c[3] * r3[j] + c[4] * r4[j] +
              c[5] * r5[j] + c[6] * r6[j] + c[7] * r7[j];
}

void subtract(double c, const double* __restrict row, double* __restrict out, int columns) {
  for (int j = 0; j < columns; ++j) out[j] -= c * row[j];
}

void scale(double factor, double* x, int count) {
  for (int j = 0; j < count; ++j) x[j] *= factor;
}

// Solve Lᵀ y = x for all columns of x, in place.
void solve_backward(const double* f, int n, int stride, double* x, int columns) {
  for (int last = n; last > 0;) {
    const int first = std::max(last - block, 0);
    for (int k = last - 1; k >= first; --k) {
      for (int i = k + 1; i < last; ++i)
        subtract(f[i * stride + k], x + i * columns, x + k * columns, columns);
      scale(1 / f[k * stride + k], x + k * columns, columns);
    }
    for (int i = 0; i < first; ++i) {
      double c[block];
      for (int r = 0; r < block; ++r) c[r] = f[(first + r) * stride + i];
      subtract_eight(c, x + first * columns, columns, x + i * columns, columns);
    }
    last = first;
  }
}

// Solve L y = x for all columns of x, in place.
void solve_forward(const double* f, int n, int stride, double* x, int columns) {
  for (int first = 0; first < n; first += block) {
    const int stop = std::min(first + block, n);
    for (int k = first; k < stop; ++k) {
      for (int i = first; i < k; ++i)
        subtract(f[k * stride + i], x + i * columns, x + k * columns, columns);
      scale(1 / f[k * stride + k], x + k * columns, columns);
    }
    for (int i = stop; i < n; ++i)
      subtract_eight(f + i * stride + first, x + first * columns, columns, x + i * columns,
                     columns);
  }
}

}  // namespace

WIDE bool factor_rows(double* a, int n, int stride) {
  for (int last = n; last > 0;) {
    const int first = std::max(last - block, 0);
    for (int k = last - 1; k >= first; --k) {
      double* row = a + k * stride;
      for (int i = k + 1; i < last; ++i) subtract(a[i * stride + k], a + i * stride, row, k + 1);
      if (!(row[k] > 0)) return false;
      scale(1 / std::sqrt(row[k]), row, k + 1);
    }
    for (int i = 0; i < first; ++i) {
      double c[block];
      for (int r = 0; r < block; ++r) c[r] = a[(first + r) * stride + i];
      subtract_eight(c, a + first * stride, stride, a + i * stride,
                     std::min(i - i % block + block, stride));
    }
    last = first;
  }
  return true;
}

WIDE void solve_column(const double* factor, int n, int stride, double* x) {
  for (int i = n - 1; i >= 0; --i) {
    x[i] /= factor[i * stride + i];
    subtract(x[i], factor + i * stride, x, i);
  }
  for (int i = 0; i < n; ++i)
    x[i] = (x[i] - dot(factor + i * stride, x, i)) / factor[i * stride + i];
}

WIDE bool invert_definite(const double* matrix, int n, double* inverse) {
  Vector factor(matrix, matrix + n * n), unit(n * n, 0.0);
  if (!factor_rows(factor.data(), n, n)) return false;
  for (int i = 0; i < n; ++i) unit[i * n + i] = 1;
  solve_backward(factor.data(), n, n, unit.data(), n);
  solve_forward(factor.data(), n, n, unit.data(), n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) inverse[i * n + j] = 0.5 * (unit[i * n + j] + unit[j * n + i]);
  return true;
}

}  // namespace adhesis
