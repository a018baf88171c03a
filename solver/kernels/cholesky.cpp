#include "cholesky.hpp"

namespace adhesis {

namespace {

void subtract(double c, const double* __restrict row, double* __restrict out, int columns) {
  for (int j = 0; j < columns; ++j) out[j] -= c * row[j];
}

void scale(double factor, double* x, int count) {
  for (int j = 0; j < count; ++j) x[j] *= factor;
}

}  // namespace

WIDE bool factor_rows(double* a, int n) {
  for (int k = n - 1; k >= 0; --k) {
    double* row = a + k * n;
    for (int i = k + 1; i < n; ++i) subtract(a[i * n + k], a + i * n, row, k + 1);
    if (!(row[k] > 0)) return false;
    scale(1 / std::sqrt(row[k]), row, k + 1);
  }
  return true;
}

WIDE void solve_column(const double* factor, int n, double* x) {
  for (int i = n - 1; i >= 0; --i) {
    x[i] /= factor[i * n + i];
    subtract(x[i], factor + i * n, x, i);
  }
  for (int i = 0; i < n; ++i) x[i] = (x[i] - dot(factor + i * n, x, i)) / factor[i * n + i];
}

WIDE bool invert_definite(const double* matrix, int n, double* inverse) {
  thread_local Vector factor, unit;
  factor.assign(matrix, matrix + n * n);
  unit.assign(n * n, 0.0);
  if (!factor_rows(factor.data(), n)) return false;
  for (int i = 0; i < n; ++i) unit[i * n + i] = 1;
  // Lᵀ Y = 1, then L X = Y, for all columns at once
  for (int k = n - 1; k >= 0; --k) {
    double* row = unit.data() + k * n;
    for (int i = k + 1; i < n; ++i) subtract(factor[i * n + k], unit.data() + i * n, row, n);
    scale(1 / factor[k * n + k], row, n);
  }
  for (int k = 0; k < n; ++k) {
    double* row = unit.data() + k * n;
    for (int i = 0; i < k; ++i) subtract(factor[k * n + i], unit.data() + i * n, row, n);
    scale(1 / factor[k * n + k], row, n);
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) inverse[i * n + j] = 0.5 * (unit[i * n + j] + unit[j * n + i]);
  return true;
}

}  // namespace adhesis
